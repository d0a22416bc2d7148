# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Executable `demo`, which plans a grasp, closes the grip and carries the object along a path."""

from __future__ import annotations

from collections.abc import Sequence
import importlib
import importlib.util
import sys

from isotruss_ros.nodes import NO_MESSAGES


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run the demonstration; Ctrl-C ends it and its nodes at any time.

    :param arguments: arguments of the command line; None: the arguments of the process.
    :return: 0 if the object was held and reached its targets, 1 if not or if the message types are
        not built, 130 after Ctrl-C.
    """
    if importlib.util.find_spec('isotruss_msgs') is None:
        print(NO_MESSAGES, file=sys.stderr)
        return 1
    try:
        # Ctrl-C may come while this is imported, which takes a second.
        return importlib.import_module('isotruss_ros.demo.run').run(arguments)
    except KeyboardInterrupt:
        print('demo stopped')
        return 130


if __name__ == '__main__':
    sys.exit(main())
