# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

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
