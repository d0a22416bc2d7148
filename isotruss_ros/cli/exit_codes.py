# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exit codes of programs that compute in worker processes."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import BrokenExecutor
import sys

from isotruss_ros.core import IsotrussError

#: A second Ctrl-C ends the process by the signal, without an exit code of this list.
BAD_ARGUMENTS, FAILED, INTERRUPTED = 2, 3, 130


def run_program(name: str, run: Callable[[], int], interrupted: str = '') -> int:
    """
    Execute a program, print the reason if it fails, and return its exit code.

    :param interrupted: text that is printed after Ctrl-C; empty: nothing.
    """
    try:
        return run()
    except (IsotrussError, OSError) as error:
        print(f'{name}: {error}', file=sys.stderr)
        return BAD_ARGUMENTS
    except BrokenExecutor as error:
        print(f'{name}: a worker process died: {error}', file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        if interrupted:
            print(f'{name}: {interrupted}', file=sys.stderr)
        return INTERRUPTED
