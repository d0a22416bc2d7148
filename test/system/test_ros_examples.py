# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The examples of nodes run as they stand."""

from pathlib import Path
import subprocess
import sys

from isotruss_msgs.msg import GraspState
import pytest
from robot_processes import robot

pytestmark = pytest.mark.system

EXAMPLES = Path(__file__).parents[2] / 'examples'
#: What each prints, beside whatever else.
PRINTED = {
    'ros_analyze_box': 'held: True',
    'ros_grasp_state': 'held: ',
    'ros_twist': 'the object moved up by',
}


def test_all_are_run():
    # One needs more nodes than the others: test_pick_and_place.
    found = {path.stem for path in EXAMPLES.glob('ros_*.py')}
    assert found == {*PRINTED, 'ros_pick_and_place'}


def test_they_run_beside_the_nodes(tmp_path):
    with robot(tmp_path) as r:
        r.start('simulator', indentation=0.01)
        r.start('manipulation')
        r.start('grasp_analysis')
        states = r.w.probe.seen['state']
        r.w.until(lambda: states and states[-1][1].code == GraspState.OK)
        for name, words in PRINTED.items():
            done = subprocess.run(
                [sys.executable, EXAMPLES / f'{name}.py'],
                capture_output=True,
                text=True,
                timeout=300,
                check=True,
            )
            assert words in done.stdout
