# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts of faces: patches with their pressures, and ends that touch or lift."""

from functools import cache

from held_grips import APART, BOX, CORNER, held, HOME, NINE
from isotruss_ros import core
from isotruss_ros.core.estimation.equilibrium_cache import attach_model
from isotruss_ros.core.holding.contact_search import measure_gaps
from nightly import some_now
import numpy as np
import pytest
from robots import preset
from skin_depths import contact_loads, corner_depths

ROBOT = preset('triangle')
TURNED = ROBOT.configuration([0.051, 0.069])
FRICTION, ANGLE = 0.9, 0.5733


@cache
def face_turned_by(milliradians):
    """Return the settled grasp of a polygon whose face turns toward a tube."""
    corners = [(0.068, -0.12), (0.011, 0.281), (-0.235, 0.176), (-0.19, -0.083), (-0.079, -0.192)]
    shape = core.Polygon(corners, (0.0, 0.09, 0.14, 0.0, 0.09))
    body = core.ConvexObject(shape, (0.8462, 0.7344, ANGLE + 1e-3 * milliradians))
    return core.settle_grasp(TURNED, body, FRICTION, members=ROBOT.member_names[1:])


def test_stiffness_and_slip_margin_are_continuous_where_an_end_of_a_face_touches():
    apart, touching = -18.0, -6.0
    for _ in range(12):
        middle = 0.5 * (apart + touching)
        if len(face_turned_by(middle).equilibrium.contacts.members) == 2:
            apart = middle
        else:
            touching = middle
    before, after = face_turned_by(apart), face_turned_by(touching)
    size = np.abs(before.stiffness).max()
    assert after.stiffness == pytest.approx(before.stiffness, abs=1e-3 * size)
    assert after.slip_margin == pytest.approx(before.slip_margin, rel=0.01)


@pytest.mark.parametrize('turns', some_now([range(-18, -5, 2), range(-30, 31)]))
def test_an_end_of_a_face_that_grazes_touches_without_force(turns):
    kinds, poses = [], []
    for turn in turns:
        grasp = face_turned_by(turn)
        grip = grasp.equilibrium
        normal, count = grip.state.normal_forces, len(grip.contacts.members)
        kinds.append(count)
        poses.append(np.array(grasp.pose))
        if count == 3:
            end = int(normal.argmin())
            depth = corner_depths(grip, ROBOT.member_names[grip.contacts.members[end]])
            assert normal[end] == pytest.approx(0.0, abs=1e-9)
            assert grip.state.friction_forces[end] == pytest.approx(0.0, abs=1e-9)
            assert depth[grip.contacts.corners[end]] == pytest.approx(0.0, abs=1e-4)
        else:
            assert grasp.pose.angle == pytest.approx(ANGLE + 1e-3 * turn, abs=1e-9)
    # The end comes into contact once, and the pose does not jump there.
    assert kinds == sorted(kinds)
    assert {2, 3} == set(kinds)
    assert np.abs(np.diff(poses, axis=0)).max() < 5e-3


FACE_FRICTION = 0.8
#: Roller offsets that incline the tubes by half a degree against the face.
OFFSETS = 0.01 * np.random.default_rng(0).normal(size=(7, 6))[[5, 6]]


@pytest.mark.parametrize('offsets', OFFSETS)
def test_wrong_offsets_do_not_lift_a_box_off_its_face(offsets):
    held_box = held(BOX, 0.0)
    grip = core.Grip(held_box.member_names, held_box.body, FACE_FRICTION)
    config = HOME.moved_to(offsets)
    exact, unsure = attach_model(config, grip), attach_model(config, grip, None, 0.01)
    assert exact.required_friction > FACE_FRICTION > unsure.required_friction
    assert len(unsure.contacts.members) == 3
    assert abs(unsure.pose.angle - grip.body.pose.angle) < np.radians(1.0)


RADIUS = 0.5 * NINE.description.tube_diameter
GAUGE = 34500.0


def settled(shape, angle=0.4, depth=0.01):
    """Return an object that is pressed into two sides."""
    body = core.place_between(HOME, APART, shape, angle, depth).body
    return core.settle_grasp(HOME, body, 5.0, members=APART)


@pytest.mark.parametrize('shape', [core.Disc(0.4), core.Ellipse((0.25, 0.2)), BOX])
@pytest.mark.parametrize('angle', [0.0, 0.4])
def test_mean_pressure_times_area_is_the_normal_force(shape, angle):
    grasp = settled(shape, angle)
    for name, force in grasp.normal_forces.items():
        carried = grasp.contact_pressures[name] * grasp.contact_areas[name]
        assert carried == pytest.approx(force, rel=1e-9)
        assert GAUGE <= grasp.contact_pressures[name] <= grasp.peak_pressures[name]
        widest = grasp.contact_widths[name]
        assert widest <= np.pi * RADIUS
        assert grasp.contact_areas[name] <= widest * grasp.contact_lengths[name]
    if shape is not BOX:  # one dent on each member
        patches = grasp.equilibrium.patches
        assert np.ptp(patches.spans, axis=1) == pytest.approx(patches.lengths)


def test_both_ends_of_a_dent_under_uneven_curvature_are_equally_deep():
    body = core.place_between(HOME, CORNER, core.Ellipse((0.25, 0.08)), 0.6, 0.01).body
    grip = core.settle_grasp(HOME, body, 5.0, members=CORNER).equilibrium
    ends, _ = grip.bent_lines(np.repeat(grip.members, 2), grip.patches.spans.ravel())
    assert np.ptp(grip.body.nearest(ends).gaps.reshape(2, 2), axis=1).max() < 6e-5


@pytest.mark.parametrize('depth', [0.004, 0.012])
def test_pressure_of_a_disc_is_gas_pressure_plus_wall_tension_over_its_radius(depth):
    grasp = settled(core.Disc(0.4), depth=depth)
    grip = grasp.equilibrium
    bent = core.deform(HOME, {}, tube_loads=contact_loads(grip))
    ends, layout = bent.state.end_forces, bent.frame.layout
    for number, name in enumerate(grip.member_names):
        before, behind = ends[layout.before[number]], ends[layout.behind[number]]
        # The moment at the contact compresses the wall on the object's side.
        moment = 0.5 * (abs(before[5]) + abs(behind[2]))
        pull = GAUGE * np.pi * RADIUS**2 - 2.0 / RADIUS * moment
        pull -= max(-before[3], behind[0])
        pressure = GAUGE + pull / (2.0 * np.pi * RADIUS) / 0.2
        assert grasp.contact_pressures[name] == pytest.approx(pressure, rel=2e-3)


@pytest.mark.parametrize('angle', [-0.03, 0.03, 0.04])
def test_gaps_of_free_corners_are_their_distances_from_the_bent_tubes(angle):
    grip = held(BOX, angle)
    (gap,) = measure_gaps(grip, 0.5).gaps
    depth = corner_depths(grip, grip.member_names[gap.owner])[gap.corner]
    assert gap.width == pytest.approx(-depth, abs=5e-5)


def test_pressures_within_the_guide_rings_at_either_end_of_a_member_are_equal():
    body = core.place_between(HOME, CORNER, core.Disc(0.08), indentation=0.006).body
    grasp = core.settle_grasp(HOME, body, 5.0, members=CORNER)
    one, other = grasp.contact_pressures.values()
    assert one == pytest.approx(other, rel=1e-9)


def test_a_section_is_flat_where_the_contact_is_as_wide_as_half_of_the_circumference():
    grasp = settled(core.Disc(0.4))
    assert not grasp.flattened
    grip = grasp.equilibrium
    deep = grip.patches_under(300.0 * grip.state.normal_forces)
    assert deep.flattened.all()
    assert deep.widths == pytest.approx(np.pi * RADIUS)
    assert deep.pressures.min() > GAUGE
