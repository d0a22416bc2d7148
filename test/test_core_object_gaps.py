"""Distances of an object from members and modules, and how the rollers change them."""

from hypothesis import given, settings
from hypothesis import strategies as st
from isotruss_ros.core import Cylinder, load_robot
from isotruss_ros.core.clearance import bodies
from isotruss_ros.core.object_gaps import encloses, object_gaps
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
ROLLERS = len(ROBOT.roller_names)
POSITIONS = st.lists(st.floats(-0.12, 0.12), min_size=ROLLERS, max_size=ROLLERS)
CENTERS = st.tuples(st.floats(-0.6, 1.6), st.floats(-1.0, 1.0))


@settings(max_examples=25, deadline=None)
@given(positions=POSITIONS, center=CENTERS, diameter=st.floats(0.05, 0.6))
def test_distances_are_those_of_many_points(positions, center, diameter):
    config = ROBOT.configuration(positions)
    gaps = object_gaps(config, Cylinder(center, diameter))
    layout, points = ROBOT.layout, config.points
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    start, end = points[layout.b], points[layout.c[layout.following]]
    away = np.abs(start + share * (end - start) - complex(*center)).min(axis=0)
    skin = away - 0.5 * (diameter + ROBOT.description.tube_diameter)
    assert gaps.members == pytest.approx(skin, abs=1e-4)
    middle = 0.5 * (points[layout.b] + points[layout.c])
    disc = np.abs(middle - complex(*center)) - 0.5 * diameter - bodies(ROBOT).radius
    assert gaps.modules == pytest.approx(disc, abs=1e-9)


@settings(max_examples=25, deadline=None)
@given(positions=POSITIONS)
def test_openings_are_the_angles_between_the_sides(positions):
    config = ROBOT.configuration(positions)
    layout, points = ROBOT.layout, config.points
    along = points[layout.c[layout.following]] - points[layout.b]
    for i, opening in enumerate(object_gaps(config, Cylinder((0.5, 0.3), 0.3)).openings):
        one, other = along[i], -along[layout.previous[i]]
        cosine = (one.conjugate() * other).real / abs(one) / abs(other)
        assert opening == pytest.approx(np.arccos(cosine), abs=1e-7)


@settings(max_examples=25, deadline=None)
@given(positions=POSITIONS, center=CENTERS)
def test_derivatives_are_those_of_differences(positions, center):
    config, cylinder, step = ROBOT.configuration(positions), Cylinder(center, 0.3), 1e-6
    gaps = object_gaps(config, cylinder)

    def all_at(move):
        return np.concatenate(
            object_gaps(config.moved_to(config.roller_positions + move), cylinder)[:3]
        )

    moves = step * np.eye(ROLLERS)
    numeric = np.column_stack([(all_at(m) - all_at(-m)) / (2.0 * step) for m in moves])
    # Where the nearest point passes from a side to its end the second derivative jumps.
    assert gaps.by_rollers == pytest.approx(numeric, abs=2e-5)


@settings(max_examples=50, deadline=None)
@given(positions=POSITIONS, center=CENTERS)
def test_a_loop_encloses_what_a_ray_leaves_once(positions, center):
    config = ROBOT.configuration(positions)
    layout = ROBOT.layout
    for tube in range(len(layout.tube_names)):
        modules = np.flatnonzero(layout.tube == tube)
        corners = [config.points[node] for i in modules for node in (layout.c[i], layout.b[i])]
        inside = False
        for one, other in zip(corners, corners[1:] + corners[:1], strict=True):
            if (one.imag > center[1]) != (other.imag > center[1]):
                share = (center[1] - one.imag) / (other.imag - one.imag)
                inside ^= center[0] < one.real + share * (other.real - one.real)
        assert encloses(config, tube, complex(*center)) == inside
