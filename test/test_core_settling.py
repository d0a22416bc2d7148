"""Where an object comes to rest with friction: it stays, gives way a little, or slips out."""

from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import (
    analyze_grasp,
    Cylinder,
    find_resting_pose,
    GraspError,
    GraspRequirements,
    load_robot,
    plan_grasps,
    settle,
    snug_center,
)
from isotruss_ros.core.settling import LEAST_FORCE, MAX_WAY
import numpy as np
import pytest
import robots
import tubes

ROBOT = load_robot('nine_member')
HOME = ROBOT.home
FREE = Cylinder((0.5, 0.4), 0.3)
FRICTION = 0.5
NOTHING = (0.0, 0.0, 0.0)


def moved(settled, cylinder):
    """Return how far an object went [m]."""
    return float(np.hypot(*np.subtract(settled.cylinder.center, cylinder.center)))


def check_held(config, settled, friction=FRICTION, external=NOTHING):
    """Check by an analysis that knows nothing of the way that the object is held where it is."""
    fresh = analyze_grasp(config, settled.cylinder, friction, external)
    assert fresh.force_closure
    assert fresh.normal_forces.sum() >= LEAST_FORCE
    assert fresh.normal_forces == pytest.approx(
        settled.analysis.normal_forces, abs=1e-5 * fresh.normal_forces.sum()
    )
    # All that acts on the object, added up: the tubes press inward, and rub along their skin.
    kept = settled.analysis
    pressing, rubbing = kept.normal_forces, kept.friction_forces
    assert (pressing >= 0.0).all()
    assert (np.abs(rubbing) <= friction * pressing * (1.0 + 1e-9)).all()
    inward = -kept.normals
    along = np.column_stack([-kept.normals[:, 1], kept.normals[:, 0]])
    forces = pressing[:, None] * inward + rubbing[:, None] * along
    arms = 0.5 * settled.cylinder.diameter * kept.normals
    moment = (arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]).sum()
    slack = 2e-6 * (pressing.sum() + np.abs(external).max())
    assert forces.sum(axis=0) == pytest.approx(-np.array(external[:2]), abs=slack)
    assert moment == pytest.approx(-external[2], abs=slack * settled.cylinder.diameter)


@pytest.fixture(scope='module')
def gripped():
    """Return a configuration that grips an object, barely as it is, by two sides."""
    needs = GraspRequirements(min_margin=0.01, count=1)
    (grasp,) = plan_grasps(HOME, FREE, needs, thorough=False).grasps
    assert len(grasp.members) == 2
    return grasp.config


def test_what_is_held_stays(gripped):
    settled = settle(gripped, FREE)
    assert settled.cylinder == FREE
    check_held(gripped, settled)


def test_gives_way_a_little_where_the_rollers_are_off(gripped):
    rng = np.random.default_rng(0)
    gave_way = 0
    for _ in range(25):
        off = gripped.roller_positions + rng.uniform(-1e-3, 1e-3, len(ROBOT.roller_names))
        config = gripped.moved_to(off)
        settled = settle(config, FREE)
        check_held(config, settled)
        assert moved(settled, FREE) < 3e-3
        gave_way += moved(settled, FREE) > 1e-4
    assert gave_way > 12


def test_gives_way_a_little_where_it_is_off_itself_and_stops_where_friction_holds_it(gripped):
    gave_way = 0
    for place in 1e-3 * np.exp(0.25j * np.pi * np.arange(8)):
        off = Cylinder((FREE.center[0] + place.real, FREE.center[1] + place.imag), FREE.diameter)
        settled = settle(gripped, off)
        check_held(gripped, settled)
        way = np.subtract(settled.cylinder.center, off.center)
        assert np.hypot(*way) < 2e-3
        if np.hypot(*way) < 1e-4:
            continue
        gave_way += 1
        before = Cylinder(tuple(off.center + 0.98 * way), FREE.diameter)
        assert not analyze_grasp(gripped, before).force_closure
    assert gave_way > 4


def test_comes_to_rest_only_where_friction_suffices(gripped):
    assert settle(gripped, FREE, friction=0.0) is None
    # Between the sides at home, a wedge of some 60 degrees: tan 30 degrees is 0.58.
    wedge = Cylinder(snug_center(HOME, 'north/Z', 0.3, 0.01), 0.3)
    for friction in (0.0, 0.3, 0.5, 0.55):
        assert settle(HOME, wedge, friction) is None
    for friction in (0.6, 1.0, 5.0):
        check_held(HOME, settle(HOME, wedge, friction), friction)


@pytest.mark.parametrize('friction', [0.0, 0.5, 5.0])
def test_what_nothing_touches_is_not_held(friction):
    assert settle(HOME, FREE, friction) is None
    assert settle(HOME, Cylinder((9.0, 9.0), 0.3), friction, (0.0, -5.0, 0.0)) is None


@pytest.mark.parametrize('friction', [0.0, 0.5, 5.0])
def test_what_one_side_touches_is_pushed_away(friction):
    b, b_end = robots.side_ends(HOME, 'north/Z')[:2]
    out = 1j * (b_end - b) / abs(b_end - b)
    for side in (-1.0, 1.0):
        place = 0.5 * (b + b_end) + side * (0.05 + 0.5 * ROBOT.description.tube_diameter) * out
        touched = Cylinder((place.real, place.imag), 0.104)  # by 2 mm
        assert analyze_grasp(HOME, touched).normal_forces.sum() > 0.5
        assert settle(HOME, touched, friction) is None


def test_carries_an_external_wrench(gripped):
    rng = np.random.default_rng(1)
    for _ in range(10):
        external = rng.normal(size=3) * [3.0, 3.0, 0.2]
        settled = settle(gripped, FREE, FRICTION, external)
        check_held(gripped, settled, external=external)
        assert moved(settled, FREE) < 0.01
    for too_much in ((300.0, 0.0, 0.0), (0.0, -300.0, 0.0), (0.0, 0.0, 30.0)):
        assert settle(gripped, FREE, FRICTION, too_much) is None


@pytest.mark.parametrize('external', [(0.0, 5.0, 0.0), (1.0, 5.0, 0.0), (-0.5, 12.0, 0.0)])
def test_without_friction_it_rests_where_normal_forces_alone_carry_the_wrench(external):
    start = Cylinder(snug_center(HOME, 'north/Z', 0.3, 0.005), 0.3)
    settled = settle(HOME, start, 0.0, external)
    check_held(HOME, settled, 0.0, external)
    resting = find_resting_pose(HOME, start, external)
    # Friction has nothing to add: it is the one place, to what the forces may be off by.
    assert settled.cylinder.center == pytest.approx(resting.cylinder.center, abs=1e-6)


@pytest.mark.parametrize('off', [(0.0, 0.0), (0.01, 0.0), (0.01, 0.028)])
def test_three_sides_hold_without_friction(off):
    cage = Cylinder((off[0], -0.578 + off[1]), 0.7)
    settled = settle(HOME, cage, 0.0)
    check_held(HOME, settled, 0.0)
    assert set(settled.analysis.contact_forces) == {'south/P-Q', 'south/Q-X', 'south/X-P'}
    resting = settle(HOME, Cylinder((0.0, -0.578), 0.7), 0.0)
    assert settled.cylinder.center == pytest.approx(resting.cylinder.center, abs=1e-6)


# A wedge of two clamped tubes, touched at midspan: there they stay parallel to themselves


def wedge(degrees):
    """Return the configuration of a robot that is nothing but a wedge, open along x."""
    ends = np.exp(1j * np.radians([0.5 * degrees, -0.5 * degrees]))
    structure = tubes.bare(0.05 * ends, 1.05 * ends, 1.9e4, 25.0, 1.9e3)
    layout = structure.config.robot.layout
    layout.tube_names, layout.tube = ('t',), np.zeros(2, dtype=int)
    description = SimpleNamespace(tube_diameter=0.1, pressure=3e4)
    robot = SimpleNamespace(layout=layout, member_names=('a', 'b'), description=description)
    return SimpleNamespace(robot=robot, structure=structure)


def in_wedge(degrees, deep):
    """Return an object on the axis of a wedge, pressed in at the middle of both tubes."""
    half = np.radians(0.5 * degrees)
    return Cylinder((0.55 / np.cos(half), 0.0), 2.0 * (0.55 * np.tan(half) + deep) - 0.1)


@pytest.mark.parametrize('degrees', [26.0, 45.0, 60.0, 90.0])
def test_a_symmetric_wedge_holds_what_is_on_its_axis_from_the_tangent_of_half_its_angle(degrees):
    tangent = np.tan(np.radians(0.5 * degrees))
    for deep in (1e-4, 2e-3, 0.01):
        cylinder = in_wedge(degrees, deep)
        settled = settle(wedge(degrees), cylinder, 1.001 * tangent)
        assert settled.cylinder == cylinder
        check_held(wedge(degrees), settled, 1.001 * tangent)
        for share in (0.0, 0.5, 0.99):
            assert settle(wedge(degrees), cylinder, share * tangent) is None


@pytest.mark.parametrize('degrees', [26.0, 45.0, 60.0, 90.0])
@pytest.mark.parametrize('share', [0.0, 0.3, 0.8])
def test_a_load_along_the_axis_moves_it_until_the_sides_press_as_statics_says(degrees, share):
    """
    Each side presses with N: on its way out friction helps it, on its way in it hinders.

    2 N (sin a - mu cos a) = W, where it goes outward, 2 N (sin a + mu cos a) = W inward.
    """
    half = np.radians(0.5 * degrees)
    friction, config = share * np.tan(half), wedge(degrees)
    cylinder = in_wedge(degrees, 2e-3)
    pressing = 0.5 * analyze_grasp(config, cylinder).normal_forces.sum()
    outward = 2.0 * (np.sin(half) - friction * np.cos(half))
    inward = 2.0 * (np.sin(half) + friction * np.cos(half))
    for wanted, load in ((0.7, 0.7 * outward), (1.3, 1.3 * inward)):
        external = (-load * pressing, 0.0, 0.0)
        settled = settle(config, cylinder, friction, external)
        check_held(config, settled, friction, external)
        x, y = np.subtract(settled.cylinder.center, cylinder.center)
        assert y == pytest.approx(0.0, abs=1e-9)
        assert (x > 0.0) == (wanted < 1.0)
        # Off the middle the tubes turn a little as they bend.
        found = 0.5 * settled.analysis.normal_forces.sum() / pressing
        assert found == pytest.approx(wanted, rel=0.02)
    # Any load between the two is carried where it is.
    for load in (1.001 * outward, 0.999 * inward) if share else ():
        settled = settle(config, cylinder, friction, (-load * pressing, 0.0, 0.0))
        assert settled.cylinder == cylinder


def test_a_place_far_away_is_no_place_to_rest_in():
    """To half the pressing it has to go out by half its depth over the sine of half the angle."""
    half, config = np.radians(13.0), wedge(26.0)
    for deep, near in ((2e-3, True), (0.01, False)):
        cylinder = in_wedge(26.0, deep)
        pressing = 0.5 * analyze_grasp(config, cylinder).normal_forces.sum()
        assert (0.5 * deep / np.sin(half) < MAX_WAY * cylinder.diameter) == near
        settled = settle(config, cylinder, 0.0, (-pressing * np.sin(half), 0.0, 0.0))
        assert (settled is not None) == near


def random_squeeze(rng):
    """Return a configuration and an object that is pressed between the sides at some module."""
    while True:
        kind = rng.choice([*robots.PRESETS, ''])
        robot = load_robot(kind) if kind else robots.random_robot(int(rng.integers(2**32)))
        config = robots.random_state(robot, rng)
        module = robot.module_names[rng.integers(len(robot.module_names))]
        diameter, deep = rng.uniform(0.1, 0.7), 10.0 ** rng.uniform(-4.0, -1.7)
        try:
            return config, Cylinder(snug_center(config, module, diameter, deep), diameter)
        except GraspError:
            continue  # it does not fit there


@robots.examples(60)
@given(robots.generators(), st.sampled_from([0.0, 0.1, 0.5, 1.0, 2.0]))
def test_wherever_it_settles_it_is_held_and_not_far_away(rng, friction):
    config, cylinder = random_squeeze(rng)
    external = rng.normal(size=3) * rng.choice([0.0, 1.0, 10.0]) * [1.0, 1.0, 0.1]
    settled = settle(config, cylinder, friction, external)
    if settled is None:
        assert not analyze_grasp(config, cylinder, friction, external).force_closure
        return
    check_held(config, settled, friction, external)
    assert settled.cylinder.diameter == cylinder.diameter
    assert moved(settled, cylinder) <= MAX_WAY * cylinder.diameter
    again = settle(config, settled.cylinder, friction, external)
    assert again.cylinder == settled.cylinder


@pytest.mark.parametrize('spacing', [0.0025, 0.01])
def test_contact_points_are_as_far_apart_as_asked_for(gripped, spacing):
    off = Cylinder((FREE.center[0], FREE.center[1] + 1e-3), FREE.diameter)
    settled = settle(gripped, off, spacing=spacing)
    fresh = analyze_grasp(gripped, settled.cylinder, spacing=spacing)
    assert fresh.force_closure
    assert len(fresh.gaps) == len(settled.analysis.gaps)


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ({'friction': -0.1}, 'must not be negative'),
        ({'friction': np.nan}, 'friction'),
        ({'external_wrench': (0.0, 1.0)}, 'external wrench'),
        ({'external_wrench': (0.0, 1.0, np.inf)}, 'external wrench'),
        ({'external_wrench': 'down'}, 'external wrench'),
        ({'spacing': 0.0}, 'spacing'),
    ],
)
def test_bad_arguments_are_refused(arguments, words):
    with pytest.raises(GraspError, match=words):
        settle(HOME, FREE, **arguments)
