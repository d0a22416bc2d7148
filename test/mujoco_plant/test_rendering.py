# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recorded states survive a round trip, and pictures agree with the geometry."""

from isotruss_ros.mujoco_plant import rendering
from isotruss_ros.mujoco_plant.options import PlantError
from isotruss_ros.mujoco_plant.recording import read_recording
from isotruss_ros.mujoco_plant.rendering import PlantRenderer, require_egl
from mujoco_worlds import CENTER, DIAMETER, needs_egl, needs_mujoco, record, ROBOT
import numpy as np
import pytest

SIZE = WIDTH, HEIGHT = 240, 200


def orange(picture):
    """Return the place of the object in a picture, (x, y) from the lower left, and its area."""
    r, g, b = np.moveaxis(picture.astype(int), -1, 0)
    rows, columns = np.nonzero((r > g + 40) & (g > b + 20))
    return np.array([columns.mean(), HEIGHT - rows.mean()]), len(rows)


@needs_mujoco
def test_recorded_states_survive_a_round_trip(tmp_path):
    plant = record(tmp_path / 'states')
    recording = read_recording(tmp_path / 'states')
    assert recording.text == plant.text
    np.testing.assert_allclose(np.diff(recording.times), 0.04, atol=1e-9)
    assert recording.times[0] == 0.0
    pieces = plant.model.geom_size[:, 1], plant.model.geom_pos[:, 0]
    state = np.concatenate([plant.data.qpos, *pieces])
    last = recording.at(5.0)
    assert last.shape == state.shape
    # Since the last state the rollers went on for four hundredths of a second.
    assert 0.0 < np.abs(last - state).max() < 0.01
    assert np.array_equal(recording.at(-1.0), recording.states[0])
    assert np.array_equal(recording.at(0.059), recording.states[1])


@needs_mujoco
def test_a_state_whose_writing_was_interrupted_is_left_out(tmp_path):
    path = tmp_path / 'states'
    record(path)
    whole = read_recording(path)
    path.write_bytes(path.read_bytes()[:-100])
    assert len(read_recording(path).times) == len(whole.times) - 1


@pytest.mark.parametrize('content', [None, b'', b'no recording'])
def test_files_that_are_no_recordings_are_refused(tmp_path, content):
    path = tmp_path / 'states'
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(PlantError, match='states is not a recording'):
        read_recording(path)


@needs_mujoco
@needs_egl
def test_a_picture_shows_robot_and_object_where_they_are(tmp_path):
    record(tmp_path / 'states', seconds=0.1)
    with PlantRenderer(read_recording(tmp_path / 'states'), *SIZE) as renderer:
        picture = renderer.draw(0.0)
        marked = renderer.draw(0.0, [(0.2, 0.1), (0.8, 0.1)], ((0.2, 0.9), (0.8, 0.9)))
    assert picture.shape == (HEIGHT, WIDTH, 3)
    nodes = ROBOT.home.nodes
    scale = min(SIZE / ((1.0 + 2.0 * rendering.VIEW_MARGIN) * np.ptp(nodes, axis=0)))
    middle = 0.5 * (nodes.max(axis=0) + nodes.min(axis=0))
    place, area = orange(picture)
    wanted = 0.5 * np.array(SIZE) + scale * (np.array([CENTER.real, CENTER.imag]) - middle)
    assert np.abs(place - wanted).max() < 3.0
    # The mark on it is white, and its upper face is nearer than the plane.
    assert area == pytest.approx(0.25 * np.pi * (scale * DIAMETER) ** 2, rel=0.15)
    r, _, b = np.moveaxis(picture.astype(int), -1, 0)
    blue = (b > r + 60).sum()
    tubes = 3.0 * 1.02 * ROBOT.description.tube_diameter * scale**2
    assert blue == pytest.approx(tubes, rel=0.3)
    rows = np.nonzero((marked != picture).any(axis=2).sum(axis=1) > 30)[0]
    assert rows.min() < 0.5 * HEIGHT < rows.max()


@needs_mujoco
def test_without_egl_it_says_what_to_install(monkeypatch):
    real = rendering.importlib.import_module

    def no_egl(name, *rest):
        if name == 'mujoco.egl':
            raise ImportError('Unable to load EGL library')
        return real(name, *rest)

    monkeypatch.setattr(rendering.importlib, 'import_module', no_egl)
    with pytest.raises(PlantError, match='apt install libegl1'):
        require_egl()
