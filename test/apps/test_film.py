# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The animation of the demonstration in MuJoCo, drawn from a recording."""

import math

from isotruss_ros.core import Pose
from isotruss_ros.demo.figures import FRAMES_PER_SECOND, SPEED_UP
from isotruss_ros.demo.film import film
from isotruss_ros.demo.record import PhaseRecord, Snapshot
from mujoco_worlds import CENTER, needs_egl, needs_mujoco, record
import numpy as np
from PIL import Image


@needs_mujoco
@needs_egl
def test_frames_show_states_path_and_pull(tmp_path):
    record(tmp_path / 'states')
    times, x, y = np.arange(0.0, 1.0, 0.01), CENTER.real, CENTER.imag
    snapshots = [Snapshot(t, np.zeros(2), Pose(x - 0.3 * t, y, 0.0)) for t in times]
    still = PhaseRecord('approach', snapshots=snapshots[:50])
    pulled = PhaseRecord('arc', pull=(0.0, -5.0, 0.0), pulled=(0.5, 1.0), snapshots=snapshots[50:])
    film(tmp_path / 'states', [still, pulled], tmp_path / 'film.gif')
    with Image.open(tmp_path / 'film.gif') as animation:
        assert animation.n_frames == 2 * math.ceil(0.5 * FRAMES_PER_SECOND / SPEED_UP)
        assert animation.info['duration'] == 80  # in hundredths of a second
        pages = []
        for i in (0, animation.n_frames - 1):
            animation.seek(i)
            pages.append(np.asarray(animation.convert('RGB')).astype(int))
    path, pull = [], []
    for r, g, b in (np.moveaxis(page, -1, 0) for page in pages):
        path.append((g > np.maximum(r, b) + 25).sum())
        pull.append((r > np.maximum(g, b) + 110).sum())
    assert path[0] < 0.2 * path[1]
    assert pull[1] > pull[0] + 50
