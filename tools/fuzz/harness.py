# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Common part of the fuzz targets: the input as a file, and the start of libFuzzer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import resource
import sys
import tempfile
import warnings

import atheris

#: Largest memory that an input may need [kB].
MAX_MEMORY = 500_000

Mutator = Callable[[bytes, int, int], bytes]


def fuzz_file(read: Callable[[Path], None], suffix: str, mutate: Mutator | None = None) -> None:
    """
    Let libFuzzer call a reader, with libFuzzer's options from the command line.

    :param read: function that reads a file; each exception and each warning is a finding.
    :param mutate: function that changes an input, given the largest size and a seed; None:
        libFuzzer's.
    """
    warnings.simplefilter('error')
    with tempfile.TemporaryDirectory(prefix='isotruss_fuzz_') as folder:
        path = Path(folder, f'input{suffix}')

        def test_one_input(data: bytes) -> None:
            path.write_bytes(data)
            # The peak of one input: what libFuzzer keeps grows with the time that it runs.
            before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            read(path)
            needed = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
            if needed > MAX_MEMORY:
                raise MemoryError(f'{needed} kB for an input of {len(data)} bytes')

        options = {} if mutate is None else {'custom_mutator': mutate}
        atheris.Setup(sys.argv, test_one_input, **options)
        atheris.Fuzz()
