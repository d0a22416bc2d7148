# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Point the CMake files of the ROS wheels at this virtual environment.

The wheels were built against a Python under /opt/python, and the targets that they export to CMake
still name its headers and NumPy's; CMake refuses targets whose include folders do not exist.
"""

from pathlib import Path
import re
import sys

import numpy as np

PYTHON_HEADERS = re.compile(r'/opt/python/cp\d+-cp\d+/include/python3\.\d+')
NUMPY_HEADERS = re.compile(
    r'/opt/python/cp\d+-cp\d+/lib/python3\.\d+/site-packages/numpy/(?:_core|core)/include'
)


def main() -> None:
    """Replace paths of the build machine in the CMake exports of the wheels."""
    prefix = Path(sys.prefix)
    python_headers = prefix / 'include' / 'python{}.{}'.format(*sys.version_info)
    for path in prefix.glob('share/*/cmake/*Export.cmake'):
        text = path.read_text()
        relocated = PYTHON_HEADERS.sub(str(python_headers), text)
        relocated = NUMPY_HEADERS.sub(np.get_include(), relocated)
        if relocated != text:
            # pip may have hard-linked the file; a new one leaves other environments alone.
            path.unlink()
            path.write_text(relocated)


if __name__ == '__main__':
    main()
