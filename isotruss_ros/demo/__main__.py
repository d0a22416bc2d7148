# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Executable `demo`, which plans a grasp, closes the grip and carries the object along a path."""

from __future__ import annotations

from collections.abc import Sequence
import importlib
import sys

from isotruss_ros.extras import explained_imports


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run the demonstration; Ctrl-C ends it and its nodes at any time.

    :return: 0 if the object was held and reached its targets, 1 if not, 130 after Ctrl-C.
    """
    print('demonstration: loading, usually 2 s; all of it 80 s', flush=True)
    try:
        # Ctrl-C may come while this is imported, which takes a second.
        with explained_imports():
            demo = importlib.import_module('isotruss_ros.demo.run')
        return demo.run(arguments)
    except KeyboardInterrupt:
        print('demo stopped')
        return 130


if __name__ == '__main__':
    sys.exit(main())
