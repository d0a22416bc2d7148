# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Equilibria of many grasps at once are those of the same grasps alone."""

from concurrent.futures import ThreadPoolExecutor
import pickle
import re

from isotruss_ros import core
from isotruss_ros.core import ConvexObject, HoldStatus, place_between, settle_grasp, settle_grasps
from isotruss_ros.core.errors import ArgumentError, GraspError, StructureError
from isotruss_ros.core.holding.roll_grip import roll_grip
from nightly import some_now
import numpy as np
import pytest
from robots import preset
from shapes import random_polygon

NINE = preset('nine_member')
HOME = NINE.home
MEMBERS = ('north/P-Z', 'north/Z-R')
NAMES = NINE.member_names
SQUARE = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])


def random_shape(rng):
    """Return a disc, an ellipse, a box or another polygon."""
    size = rng.uniform(0.1, 0.35)
    x, y = 0.5 * size, 0.5 * size * rng.uniform(0.5, 1.0)
    shapes = (
        core.Disc(size),
        core.Ellipse((size, size * rng.uniform(0.6, 1.0))),
        core.Polygon([(-x, -y), (x, -y), (x, y), (-x, y)]),
        random_polygon(rng, 0.5 * size),
    )
    return shapes[rng.integers(len(shapes))]


def random_grasps(count, seed):
    """Return arguments of grasps of random objects, some of which are lost, loaded or squashed."""
    rng = np.random.default_rng(seed)
    configs, bodies = [], []
    for _ in range(count):
        config = NINE.configuration(rng.uniform(-0.1, 0.1, 6))
        members = [NAMES[i] for i in rng.choice(9, 2, replace=False)]
        depth = rng.uniform(-0.02, 0.03)
        try:
            grip = place_between(config, members, random_shape(rng), rng.uniform(-3, 3), depth)
            body = grip.body
        except GraspError:  # the members meet at no place for this object
            x, y = rng.uniform(0.0, 1.0, 2)
            body = ConvexObject(random_shape(rng), (x, y, 0.0))
        configs.append(config)
        bodies.append(body)
    is_loaded = rng.random(count) < 0.5
    return {
        'configs': configs,
        'bodies': bodies,
        'friction': rng.uniform(0.1, 1.5, count),
        'external_wrench': is_loaded[:, None] * rng.uniform(-1.0, 1.0, (count, 3)) * (2, 2, 0.1),
        'pressure': np.where(rng.random((count, 1)) < 0.5, 4e4, 5e4),
        'stiffness': rng.choice([0.9, 1.0, 1.2], count),
    }


def alone(grasps, i):
    """Return the settled grasp i of arguments of `settle_grasps`."""
    config, body, friction, wrench, pressure, scale = (values[i] for values in grasps.values())
    return settle_grasp(config, body, friction, wrench, pressure.item(), stiffness=scale)


def assert_equal(settled, i, expected):
    """Assert that grasp i has the values of a settled grasp."""
    assert settled.hold[i] is expected.hold
    assert settled.reason[i] == expected.reason
    near = {'rel': 1e-10, 'abs': 1e-10}
    assert settled.slip_margin[i] == pytest.approx(expected.slip_margin, **near)
    assert settled.required_friction[i] == pytest.approx(expected.required_friction, **near)
    assert settled.pose[i] == pytest.approx(expected.pose, **near)
    assert settled.displacement[i] == pytest.approx(expected.displacement, **near)
    forces = expected.normal_forces.values()
    assert settled.squeeze[i] == pytest.approx(np.mean([*forces]) if forces else 0.0, **near)
    for name in ('normal_forces', 'friction_forces', 'utilisation'):
        by_member = {member: values[i] for member, values in getattr(settled, name).items()}
        assert by_member == pytest.approx({**dict.fromkeys(NAMES, 0.0), **getattr(expected, name)})


@pytest.mark.parametrize('seed', some_now(range(3)))
def test_each_of_many_grasps_is_that_of_settle_grasp(seed):
    grasps = random_grasps(12, seed)
    settled = settle_grasps(**grasps)
    for i in range(len(settled)):
        assert_equal(settled, i, alone(grasps, i))


DISC = place_between(HOME, MEMBERS, ConvexObject.disc((0.0, 0.0), 0.3).shape, 0.0, 0.01).body
X, Y, _ = DISC.pose
POSES = [(X, Y, 0.0), (X, Y + 0.003, 0.1), (X, Y + 1.0, 0.0)]


def test_one_object_at_many_poses_is_settled_at_each():
    settled = settle_grasps(HOME, DISC, 0.8, poses=POSES)
    assert len(settled) == 3
    for i, pose in enumerate(POSES):
        assert_equal(settled, i, settle_grasp(HOME, DISC.moved_to(pose), 0.8))
    assert settled.hold[2] is HoldStatus.NO_CONTACT


def test_a_grasp_of_the_result_is_that_of_settle_grasp():
    (*_, last) = settled = settle_grasps(HOME, DISC, 0.8, poses=POSES)
    expected = settle_grasp(HOME, DISC.moved_to(POSES[1]), 0.8)
    assert settled[1].pose == pytest.approx(expected.pose, abs=1e-12)
    assert settled[1].normal_forces == pytest.approx(expected.normal_forces, rel=1e-10)
    assert settled[-1].hold is last.hold is HoldStatus.NO_CONTACT
    with pytest.raises(IndexError):
        settled[3]


@pytest.mark.parametrize('workers', [0, 1])
def test_a_grasp_of_the_result_has_exactly_its_values(workers):
    grasps = random_grasps(24, 5)
    with ThreadPoolExecutor(1) as executor:
        settled = settle_grasps(**grasps, executor=executor if workers else None)
    for i, grasp in enumerate(settled):
        assert (grasp.hold, grasp.reason) == (settled.hold[i], settled.reason[i])
        assert grasp.slip_margin == settled.slip_margin[i]
        assert grasp.required_friction == settled.required_friction[i]
        assert np.array_equal(grasp.pose, settled.pose[i])
        for name in ('normal_forces', 'friction_forces', 'utilisation'):
            for member, value in getattr(grasp, name).items():
                assert value == getattr(settled, name)[member][i]
    assert settled.hold.count(HoldStatus.HELD) > 2


BOX = place_between(HOME, MEMBERS, core.Polygon(0.1 * SQUARE), 0.3, 0.012).body


@pytest.mark.parametrize('body', [DISC, BOX])
@pytest.mark.parametrize('force', [0.0, 1.0])
def test_a_pickled_grasp_takes_at_most_20_kilobytes_and_rolls_as_the_original(body, force):
    settled = settle_grasp(HOME, body, 0.8, (force, 0.0, 0.0))
    data = settled.to_dict()  # with all values that are found when they are read
    pickled = pickle.dumps(settled)
    assert len(pickled) <= 20_000
    restored = pickle.loads(pickled)
    assert restored.to_dict() == data
    there = HOME.moved_to([1e-3, -1e-3, 5e-4, 0.0, 1e-3, 0.0])
    pair = (roll_grip(grasp.equilibrium, there) for grasp in (settled, restored))
    rolled, again = (grip.state.unknowns for grip in pair)
    assert np.array_equal(rolled, again)


def test_columns_of_a_data_frame_have_a_value_for_each_grasp():
    columns = settle_grasps(HOME, DISC, 0.8, poses=POSES).to_dict()
    assert {len(values) for values in columns.values()} == {3}
    assert columns['held'] == [True, True, False]
    assert columns['x'][2] == POSES[2][0]
    assert columns['required_friction'][2] is None  # infinite
    assert columns['normal_forces north/P-Z'][0] > 1.0


@pytest.mark.parametrize(
    'pressures', [5e4, [5e4, 5e4, 5e4], {'north': 5e4, 'east': 5e4, 'south': 5e4}, [[5e4]] * 3]
)
def test_pressures_are_one_for_all_grasps_or_one_for_each(pressures):
    settled = settle_grasps(HOME, DISC, 0.8, pressure=pressures, poses=POSES)
    assert_equal(settled, 0, settle_grasp(HOME, DISC, 0.8, pressure=5e4))


def test_an_executor_computes_the_same_grasps_with_progress():
    shares = []
    poses = POSES * 70
    with ThreadPoolExecutor(1) as executor:
        settled = settle_grasps(
            HOME, DISC, 0.8, poses=poses, executor=executor, on_progress=shares.append
        )
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert settled == settle_grasps(HOME, DISC, 0.8, poses=poses)


@pytest.mark.parametrize('force', [0.0, 1.0])
def test_nodes_that_can_move_in_an_unbraced_robot_are_named(force):
    words = 'mechanism: .*north/Z/B.* can move without resistance'
    wrench, unbraced = (force, 0.0, 0.0), 1e-12  # without stiffness, tubes do not brace the robot
    with pytest.raises(StructureError, match=words):
        settle_grasp(HOME, DISC, 0.8, wrench, stiffness=unbraced)
    settled = settle_grasps(HOME, DISC, 0.8, wrench, stiffness=[1.0, unbraced])
    assert settled.hold == (HoldStatus.HELD, None)
    assert re.search(words, settled.reason[1])


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ({'friction': [0.5, -1.0, 0.5]}, r'grasp 1: friction.*-1'),
        ({'external_wrench': [(0, 0, 0), (0, 0, 0), (np.nan, 0, 0)]}, r'grasp 2: the external'),
        ({'pressure': [[5e4], [5e4], [1.0]]}, r'grasp 2: gauge pressure'),
        ({'pressure': [5e4, 5e4]}, r'pressure: 2 values: .* 3 tubes; .* grasps .* \(n, 1\)'),
        ({'stiffness': [1.0, 0.0, 1.0]}, r'grasp 1: stiffness'),
        ({'poses': [(0, 0, 0), (0, 0), (0, 0, 0)]}, r'grasp 1: .*pose'),
        ({'poses': [(0, 0, 0), (716, 749, 0), (0, 0, 0)]}, r'grasp 1: .*pose.* if it is in mm'),
        ({'friction': [0.5, 0.5]}, r'friction: 2 values: must be 1, or one for each grasp'),
        ({'configs': [HOME, HOME, preset('triangle').home]}, r'configs\[2\]: .*nine_member'),
        ({'configs': []}, r'configs: 0 values'),
    ],
)
def test_an_invalid_argument_is_named_with_its_grasp(arguments, words):
    values = {'configs': HOME, 'bodies': DISC, 'poses': POSES, **arguments}
    with pytest.raises((GraspError, StructureError), match=words):
        settle_grasps(**values)


@pytest.mark.parametrize('name', ['configs', 'bodies'])
def test_an_argument_of_another_kind_is_named_with_its_number(name):
    values = {'configs': HOME, 'bodies': DISC, name: [HOME, DISC]}
    with pytest.raises(ArgumentError, match=rf'{name}\[{int(name == "configs")}\]: '):
        settle_grasps(**values)


def settle_along(name, rollers, shape, pose, steps, friction, **inputs):
    """Return the settled grasps of an object that is moved along x in steps [m]."""
    config = core.load_robot(name).configuration(rollers)
    x, y, angle = pose
    bodies = [core.ConvexObject(shape, (x + step, y, angle)) for step in steps]
    many = core.settle_grasps(config, bodies, friction, **inputs)
    assert (sum(many.normal_forces.values()) > 0.0).all()  # zero without an equilibrium
    return many


def assert_smooth(values, tolerance):
    """Assert that values at equal steps bend little."""
    assert np.abs(np.diff(values, 2)).max() < tolerance


@pytest.mark.parametrize(
    ('pressure', 'friction'), [(103500.0, 2.5), (34500.0, 1.5), (34500.0, 2.5)]
)
def test_triangle_on_soft_tubes_has_one_smooth_family_of_equilibria(pressure, friction):
    rollers = [
        *(0.05717275719424686, -0.08895108799654505, 0.0977550977594612, -0.04015177315795604),
        *(-0.016549285543717346, 0.04739373116746651, -0.036972696809580374),
        -0.008050733585965641,
    ]
    corners = [
        [-0.12749822796346125, -0.046970316619953864],
        [0.06575847985298382, -0.11890261184947186],
        [0.07560874533926228, 0.11289520098491358],
    ]
    many = settle_along(
        'ring_of_four',
        rollers,
        core.Polygon(corners, corner_radius=0.02),
        (1.852321740458615, 0.1887927286171504, 2.541271207693626),
        1e-3 * np.arange(-3.0, 3.1, 0.5),
        friction,
        external_wrench=(-1.439206355307486, 0.1188233860581156, 0.0038292301168298625),
        pressure=pressure,
        members=('east/L-E', 'east/M-L'),
    )
    for member in ('east/L-E', 'east/M-L'):
        assert_smooth(many.normal_forces[member], 0.1)


@pytest.mark.parametrize(
    ('wrench', 'stiffness'), [((0.42, 0.45, -0.096), 0.9), ((0.0, 0.0, 0.0), 0.9)]
)
def test_small_disc_moved_along_soft_tubes_keeps_its_equilibrium(wrench, stiffness):
    many = settle_along(
        'nine_member',
        [0.0032, -0.0768, 0.0247, 0.0553, 0.0226, 0.0835],
        core.Disc(0.11559),
        (0.86475, -1.06592, 0.0),
        1e-4 * np.arange(-12, 13),
        0.9,
        external_wrench=wrench,
        pressure=4e4,
        stiffness=stiffness,
    )
    for forces in many.normal_forces.values():
        assert_smooth(forces, 0.1)
