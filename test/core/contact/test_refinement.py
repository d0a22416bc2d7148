# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact points as fine as the regions need: convergence, whatever the search began with."""

from hypothesis import example, given, strategies
from isotruss_ros.core import (
    analyze_grasp,
    ConvexObject,
    Ellipse,
    IsotrussError,
    load_robot,
    place_between,
    Polygon,
    tangent_center,
)
from isotruss_ros.core.contact.refinement import DIVISIONS, REGION_POINTS
from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.manipulation.grip import members_at
import numpy as np
import pytest
import robots

ROBOT = load_robot('nine_member')
SPACING = 0.005


def pressed(seed):
    """Return a random configuration and an object pressed into a random corner."""
    draw = np.random.default_rng(seed)
    while True:
        module = ROBOT.module_names[draw.integers(len(ROBOT.module_names))]
        diameter, depth = draw.uniform(0.15, 0.5), draw.uniform(0.003, 0.025)
        try:
            config = ROBOT.configuration(draw.uniform(-0.15, 0.15, len(ROBOT.roller_names)))
            return config, ConvexObject.disc(
                tangent_center(config, module, diameter, depth), diameter
            )
        except IsotrussError:
            continue


@robots.examples(15)
@given(strategies.integers(0, 2**32 - 1))
@example(1910)  # here two spacings are enough for themselves
@example(2126)
@example(2189)
def test_solution_is_independent_of_the_initial_guess(seed):
    config, cylinder = pressed(seed)
    cold = analyze_grasp(config, cylinder)
    x, y = cylinder.pose[:2]
    for shift in (0.0, 2e-3, 0.012, 0.05, 50.0):
        begun = analyze_grasp(config, ConvexObject.disc((x + shift, y), cylinder.shape.diameter))
        warm = analyze_grasp(config, cylinder, previous=begun)
        slack = 1e-6 * cold.normal_forces.sum()
        assert warm.places == pytest.approx(cold.places)
        assert warm.normal_forces == pytest.approx(cold.normal_forces, abs=slack)


@robots.examples(15)
@given(strategies.integers(0, 2**32 - 1))
def test_all_figures_are_converged_at_the_default_spacing(seed):
    config, cylinder = pressed(seed)
    coarse, fine = (analyze_grasp(config, cylinder, spacing=s) for s in (SPACING, SPACING / 4))
    size = fine.normal_forces.sum()
    assert coarse.contact_forces == pytest.approx(fine.contact_forces, rel=0.02)
    assert coarse.contact_lengths == pytest.approx(fine.contact_lengths, rel=0.02)
    assert coarse.contact_pressures == pytest.approx(fine.contact_pressures, rel=0.02)
    assert coarse.utilisation == pytest.approx(fine.utilisation, rel=0.02)
    assert coarse.required_friction == pytest.approx(fine.required_friction, rel=0.02)
    assert coarse.closure_margin == pytest.approx(fine.closure_margin, abs=0.02 * size)
    assert coarse.closure_residual == pytest.approx(fine.closure_residual, abs=0.02 * size)
    # Points lie where contact is, and are enough.
    for member in np.unique(coarse.members):
        here = np.sort(coarse.places[coarse.members == member])
        start, end = coarse.contact_spans[ROBOT.member_names[member]]
        assert start - SPACING <= here[0] < start
        assert end < here[-1] <= end + SPACING
        touching = (coarse.normal_forces[coarse.members == member] > 0.0).sum()
        step = np.median(np.diff(here))
        assert touching >= REGION_POINTS - 2 or step == pytest.approx(SPACING / DIVISIONS[-1])


def test_tubes_that_give_way_are_not_answered_by_straight_ones():
    document = robots.example()
    document['joints'] = {
        'A': [5.24085382407068, 0.09908767159548276],
        'B': [3.377522962431704, 1.9518580233568228],
        'C': [1.2032126263108107, 1.1645474975643613],
        'D': [4.053262086399243, -2.3597314878646465],
        'E': [1.0473156907379741, -1.597529167309133],
    }
    document['tubes'] = {'t': {'joints': ['E', 'D', 'A', 'B', 'C'], 'passive': 'A'}}
    document['module'] |= {
        'pinch_separation': 0.1142,
        'rod_length': 0.224,
        'guide_ring_distance': 0.05,
    }
    document['supports'] = {'A': ['x', 'y'], 'C': ['x', 'y'], 'E': ['x']}
    document['members'] = {'min_length': 0.15, 'max_length': 20.0}
    config = robots.load(document).configuration([0.19292, -0.76027, -1.00508, 0.58768])
    pressed_in = ConvexObject(Ellipse((0.1564, 0.0848)), (1.34983, -1.78687, -2.79205))
    with pytest.raises(SolverError, match='structure becomes unstable'):
        analyze_grasp(config, pressed_in)


def test_a_soft_structure_is_solved_to_rounding():
    # A joint gives by a metre for five newtons: 1e-8 m are beyond the rounding of member forces.
    travel = [0.1610, 0.0556, 0.3739, -0.0004, -0.1239, -0.6970, -0.0974, -0.2843]
    config = load_robot('ring_of_four').configuration(travel)
    analysis = analyze_grasp(config, ConvexObject.disc((0.8419, 0.4786), 0.2166))
    assert analysis.normal_forces.sum() == pytest.approx(12.8, rel=0.02)


def test_small_object_missed_by_the_final_points_is_refused():
    travel = [0.00236432, 0.09009274, -0.07116808, 0.08972989, -0.03763371, -0.01533471]
    config = ROBOT.configuration(travel)
    small = ConvexObject.disc((1.4295648734228052, -0.19796723469443755), 0.06603594342697769)
    with pytest.raises(SolverError, match='where contact is not modelled'):
        analyze_grasp(config, small)


@pytest.mark.parametrize(('depth', 'error'), [(8e-4, 0.25), (1.5e-3, 0.1), (3e-3, 0.03)])
def test_shallow_corner_between_two_points_is_in_contact(depth, error):
    box = Polygon([(-0.16, -0.13), (0.16, -0.13), (0.16, 0.13), (-0.16, 0.13)])
    members = members_at(ROBOT, 'north/Z')
    body = place_between(ROBOT.home, members, box, angle=-0.29, indentation=depth).body
    coarse, fine = (analyze_grasp(ROBOT.home, body, spacing=s) for s in (SPACING, SPACING / 8))
    assert coarse.contact_forces == pytest.approx(fine.contact_forces, rel=error)


def test_thin_object_whose_contact_is_lost_on_the_way_in_is_refused():
    # A first step of the indentation ends without contact.
    pose = (0.715820729508848, 0.9493758857055798, 0.004968614350578049)
    thin = ConvexObject(Ellipse((0.05426568656321512, 0.0007537796275689775)), pose)
    with pytest.raises(SolverError, match=r'^north/.*: the structure becomes unstable'):
        analyze_grasp(ROBOT.home, thin)


def test_object_deeper_than_a_tube_is_refused_without_steps():
    body = ConvexObject.disc(tangent_center(ROBOT.home, 'north/Z', 1.2), 1.2)
    with pytest.raises(SolverError, match='no equilibrium of the tubes'):
        analyze_grasp(ROBOT.home, body)
