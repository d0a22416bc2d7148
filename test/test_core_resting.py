"""The resting pose: where normal forces alone carry the object, and whether it comes back."""

from isotruss_ros.core import (
    analyze_grasp,
    Cylinder,
    find_resting_pose,
    GraspError,
    load_robot,
    resting,
    snug_center,
)
from isotruss_ros.core.candidates import find_candidates
from isotruss_ros.core.contact import solve_contact
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
HOME = ROBOT.home
MODULE, DIAMETER = 'north/Z', 0.3
CENTER = np.array(snug_center(HOME, MODULE, DIAMETER))
RADIUS = 0.5 * (DIAMETER + ROBOT.description.tube_diameter)


def squeezed(dx=0.0, dy=0.005):
    """Return an object that is pressed toward the corner."""
    return Cylinder((CENTER[0] + dx, CENTER[1] + dy), DIAMETER)


@pytest.mark.parametrize('wrench', [(0.0, 5.0, 0.0), (1.0, 5.0, 0.0), (-0.5, 12.0, 0.0)])
def test_normal_forces_balance_the_wrench_at_rest(wrench):
    pose = find_resting_pose(HOME, squeezed(), wrench)
    analysis = analyze_grasp(HOME, pose.cylinder, friction=0.0, external_wrench=wrench)
    assert analysis.normal_wrench[:2] == pytest.approx(-np.array(wrench[:2]), abs=1e-7)
    assert analysis.force_closure
    assert analysis.required_friction < 1e-6
    assert pose.stable


def test_rest_does_not_depend_on_where_the_search_begins():
    wrench = (0.5, 8.0, 0.0)
    places = [
        find_resting_pose(HOME, squeezed(dx, dy), wrench).cylinder.center
        for dx, dy in ((0.0, 0.005), (0.01, 0.02), (-0.004, 0.03))
    ]
    assert places[1] == pytest.approx(places[0], abs=1e-8)
    assert places[2] == pytest.approx(places[0], abs=1e-8)


def test_tangent_is_the_derivative_of_the_force():
    center, step = complex(*squeezed(0.001, 0.01).center), 1e-6
    candidates = find_candidates(HOME.structure, center, RADIUS, 0.005)

    def force(at):
        contact = solve_contact(candidates, at, RADIUS)
        return -contact.forces @ contact.normals.view(np.float64).reshape(-1, 2)

    tangent = resting._tangent(candidates, solve_contact(candidates, center, RADIUS), RADIUS)
    found = -np.column_stack(
        [(force(center + d * step) - force(center - d * step)) / (2.0 * step) for d in (1, 1j)]
    )
    assert tangent == pytest.approx(found, rel=1e-5)
    # Frictionless contact with an elastic robot has a potential.
    assert tangent == pytest.approx(tangent.T, rel=1e-9)


def test_a_pull_out_of_the_corner_has_no_place_to_rest():
    assert find_resting_pose(HOME, squeezed(), (0.0, -5.0, 0.0)) is None


def test_no_load_is_no_grasp():
    assert find_resting_pose(HOME, squeezed(), (0.0, 0.0, 0.0)) is None


def test_normal_forces_have_no_moment():
    assert find_resting_pose(HOME, squeezed(), (0.0, 5.0, 0.1)) is None


def test_far_from_everything_there_is_no_rest():
    assert find_resting_pose(HOME, Cylinder((9.0, 9.0), 0.3), (0.0, 5.0, 0.0)) is None


def test_bad_wrenches_are_refused():
    with pytest.raises(GraspError, match='external wrench'):
        find_resting_pose(HOME, squeezed(), (0.0, np.nan, 0.0))
