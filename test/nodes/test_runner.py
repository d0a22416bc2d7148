# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a process does before its first cycle."""

import subprocess
import sys

START = """
import sys

from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.framework.runner import run, USED_LATE

assert not set(USED_LATE) & set(sys.modules)

def make_node():
    assert set(USED_LATE) <= set(sys.modules)
    raise IsotrussError('as expected')

assert run(make_node) == 1
"""


def test_no_cycle_waits_for_an_import():
    subprocess.run([sys.executable, '-c', START], check=True, timeout=300)
