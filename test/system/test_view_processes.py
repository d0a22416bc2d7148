# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What `make view` starts, commanded from a terminal."""

import importlib.util
import subprocess
import sys

from mujoco_worlds import needs_mujoco
import pytest

pytestmark = [
    pytest.mark.system,
    pytest.mark.nightly,
    pytest.mark.skipif(importlib.util.find_spec('viser') is None, reason='pip install viser'),
    needs_mujoco,
]

PORT = 8433


@pytest.fixture
def shown():
    """Return after the view of MuJoCo's plant was printed."""
    command = [sys.executable, '-u', '-m', 'isotruss_ros.demo.view', '--plant', 'mujoco']
    with subprocess.Popen(
        [*command, '--port', str(PORT)], stdout=subprocess.PIPE, text=True
    ) as view:
        while 'viewer: http' not in (line := view.stdout.readline()):
            assert line, 'the view ended'
        yield
        view.terminate()


def test_the_view_of_mujoco_places_picks_and_moves(shown):
    said = []
    for words in ('place', 'pick --squeeze 15', 'move 0.75 0.7', 'place', 'pick'):
        command = [sys.executable, '-m', 'isotruss_ros.cli.operate', *words.split()]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, (words, done)
        said.append(done.stdout)
    assert 'held at north/' in said[1]
    assert 'off the end of the path' in said[2]
