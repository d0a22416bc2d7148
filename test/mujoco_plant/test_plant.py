# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion, friction, obstacles, recorded states and pictures of the plant in MuJoCo."""

from dataclasses import replace
import importlib

from isotruss_ros import core
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.model.obstacle import HalfPlane
from isotruss_ros.mujoco_plant import rendering
from isotruss_ros.mujoco_plant.options import load_mujoco, PlantError, PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from isotruss_ros.mujoco_plant.recording import PlantRecorder, read_recording
from isotruss_ros.mujoco_plant.rendering import PlantRenderer, require_egl
from mujoco_worlds import needs_mujoco
import numpy as np
from pressed_plants import move_to, press, PressedCase, release, STILL
import pytest
from robots import preset


@needs_mujoco
def test_weight_of_the_modules_follows_their_mass():
    file = core.load_robot('triangle').description

    def sag(mass):
        robot = core.Robot(replace(file, module=replace(file.module, mass=mass)))
        plant = MujocoPlant(robot, options=replace(STILL, gravity=(0.0, -0.05)))
        plant.settle(4.0)
        return plant.nodes - robot.home.nodes

    light, middle, heavy = sag(1.0), sag(2.0), sag(3.0)
    assert np.abs(middle - light).max() > 1e-5
    assert (middle - light)[:, 1].sum() < 0.0
    # Each kilogram adds as much; what the tubes weigh is in all of them.
    np.testing.assert_allclose(heavy - middle, middle - light, atol=1e-2 * np.abs(middle).max())


@needs_mujoco
def test_a_carried_object_follows_and_is_lost_if_friction_is_too_low():
    plant, config, body = press(PressedCase(40.0, 0.04))
    release(plant, 0.8)
    start = np.array(plant.object_pose())
    held = attach_grip(config, body.moved_to(start))
    travel = plant.travel + np.array([0.01, -0.01, 0.01, 0.01, -0.005, 0.01])
    there = config.moved_to(travel)
    move_to(plant, travel)
    result, expected = np.array(plant.object_pose()), np.array(roll_grip(held, there).pose)
    way = np.linalg.norm(result[:2] - start[:2])
    assert way > 0.01
    assert np.linalg.norm((result - expected)[:2]) < max(1e-3, 0.05 * way)
    assert len(plant.contact_forces()) == 2
    needed = max(abs(f.friction) / f.normal for f in plant.contact_forces().values())
    plant.set_friction(1.05 * needed)
    plant.settle(2.0)
    assert len(plant.contact_forces()) == 2
    plant.set_friction(0.9 * needed)
    plant.settle(3.0)
    assert np.linalg.norm(np.array(plant.object_pose())[:2] - result[:2]) > 0.01


def test_without_mujoco_a_sentence_says_what_to_install(monkeypatch):
    def missing(name):
        raise ImportError(f'No module named {name!r}')

    load_mujoco.cache_clear()
    monkeypatch.setattr(importlib, 'import_module', missing)
    with pytest.raises(PlantError, match=r"pip install 'mujoco>=3.11,<4' in"):
        MujocoPlant(core.load_robot('triangle'))


UNUSABLE = {'object_mass': 0.0, 'friction': -0.1, 'segments': 0, 'time_step': np.nan}
UNUSABLE |= {'module_friction': -1.0, 'roller_lag': np.nan, 'roller_force': 0.0}
UNUSABLE |= {'gravity': (0.0, np.inf)}


@pytest.mark.parametrize('option', UNUSABLE)
def test_unusable_options_are_refused(option):
    with pytest.raises(PlantError, match='MuJoCo plant'):
        PlantOptions(**{option: UNUSABLE[option]})


NINE = preset('nine_member')
BODY = core.ConvexObject.disc((0.716, 0.45), 0.3)
SHAPES = [
    core.Disc(0.1),
    core.Ellipse((0.05, 0.1)),
    core.Polygon(((-0.05, -0.1), (0.05, -0.1), (0.05, 0.1), (-0.05, 0.1))),
]


@needs_mujoco
@pytest.mark.parametrize('shape', SHAPES, ids=lambda shape: type(shape).__name__)
@pytest.mark.parametrize('gap', [0.01, -0.002])
def test_contacts_with_an_obstacle_are_counted_by_its_name(shape, gap):
    reach = 0.15 + 0.05
    near = core.Obstacle('near', core.ConvexObject(shape, (0.716 + reach + gap, 0.45, 0.0)))
    far = core.Obstacle('far', core.ConvexObject(shape, (5.0, 5.0, 0.0)))
    plant = MujocoPlant(NINE, BODY, obstacles=[far, near])
    plant.advance(0.02, [0.0] * len(NINE.roller_names))
    touched = {name for name, count in plant.obstacle_contacts.items() if count}
    assert touched == (set() if gap > 0.0 else {'near'})


@needs_mujoco
def test_wall_stops_an_object_that_is_pulled_toward_it():
    """The robot is far away, at x < 2.3 m."""
    wall = core.Obstacle('wall', core.ConvexObject(HalfPlane(), (2.86, 0.0, np.pi)))
    plant = MujocoPlant(NINE, BODY.moved_to((2.7, 0.5, 0.0)), obstacles=[wall])
    plant.pull((5.0, 0.0, 0.0))
    plant.settle(1.0)
    assert plant.object_pose().x == pytest.approx(2.71, abs=2e-3)
    assert plant.obstacle_contacts['wall'] > 10


@needs_mujoco
def test_moved_obstacle_touches_the_object():
    post = core.Obstacle('post', core.ConvexObject.disc((3.0, 0.45), 0.1))
    plant = MujocoPlant(NINE, BODY, obstacles=[post])
    plant.settle(0.02)
    assert not plant.obstacle_contacts
    plant.move_obstacles([replace(post, body=post.body.moved_to((0.716 + 0.198, 0.45, 0.3)))])
    plant.settle(0.02)
    assert plant.obstacle_contacts['post']
    with pytest.raises(PlantError, match='obstacles: must be those of the plant, post'):
        plant.move_obstacles([])


#: What is recorded: a triangle with a disc in its middle.
ROBOT = preset('triangle')
CENTER, DIAMETER = ROBOT.home.points.mean(), 0.3
SIZE = WIDTH, HEIGHT = 240, 200


def needs_egl(test):
    """Skip a test where there is nothing to draw with."""
    try:
        require_egl()
    except PlantError as error:
        return pytest.mark.skip(reason=str(error))(test)
    return test


def record(path, seconds=1.0):
    """Record a robot whose rollers turn; return the plant."""
    plant = MujocoPlant(ROBOT, core.ConvexObject.disc((CENTER.real, CENTER.imag), DIAMETER))
    recorder = PlantRecorder(plant, path, 25.0)
    for _ in range(round(100 * seconds)):
        recorder.record(plant.time)
        plant.advance(0.01, (0.05, 0.0))
    recorder.close()
    return plant


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
