# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The command export_mujoco: a file that MuJoCo opens by itself."""

from isotruss_ros.cli.export_mujoco import main
from mujoco_worlds import needs_mujoco
import pytest


@needs_mujoco
@pytest.mark.parametrize('name', ['nine_member', 'triangle'])
def test_the_file_is_opened_by_mujoco_and_rests(name, tmp_path):
    import mujoco

    written, path = tmp_path / 'model.xml', tmp_path / 'elsewhere' / 'model.xml'
    assert main([name, str(written), '--object', '5', '5', '0.3']) == 0
    path.parent.mkdir()
    written.rename(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 100)
    assert abs(data.qpos).max() < 1e-9


def test_a_robot_that_does_not_exist_is_refused(tmp_path, capsys):
    assert main(['nobody', str(tmp_path / 'model.xml')]) == 2
    assert 'export_mujoco: ' in capsys.readouterr().err
