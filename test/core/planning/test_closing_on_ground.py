# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How hard the sides of a grip must press: what is found holds, and what is not is told."""

import contextlib
import dataclasses
import functools

import closings
from isotruss_ros.core import (
    analyze_grasp,
    ConvexObject,
    GraspRequirements,
    load_robot,
    settle_grasp,
)
from isotruss_ros.core.planning.approach import approach
from isotruss_ros.core.planning.closing_step import press
from isotruss_ros.core.planning.grasp_candidate import close_grip
from isotruss_ros.core.planning.seeds import find_seeds
from isotruss_ros.core.planning.violations import RequirementError, SearchTally
import numpy as np
import pytest
from scipy.optimize import linprog

THREE = ('south/P-Q', 'east/Q-R', 'north/R-P')
SPACINGS = (0.00125, 0.0025, 0.005)
#: What the numbers change by with the spacing, against the sum of the forces.
SLACK = {0.00125: 0.005, 0.0025: 0.005, 0.005: 1e-6}
NEEDS = GraspRequirements(min_margin=0.0)
#: Without a bound on the bending moments.
UNBOUNDED = GraspRequirements(min_margin=0.0, max_utilisation=np.inf)
#: Grips that are found: preset, module or members, centre and diameter of the object.
GRIPS = {
    'top': ('triangle', {'module': 'main/T'}, (0.716, 0.5), 0.4),
    'tight': ('triangle', {'module': 'main/T'}, (0.716, 0.48), 0.44),
    'north': ('nine_member', {'module': 'north/P'}, (0.5, 0.4), 0.3),
    'narrow': ('nine_member', {'module': 'north/P'}, (0.716, 0.43), 0.3),
    'three': ('nine_member', {'members': THREE}, (0.716, -0.42), 0.6),
}


@functools.lru_cache(maxsize=16)
def opened(name):
    """Return an open grip, and what closes."""
    preset, who, center, diameter = GRIPS[name]
    config, body = load_robot(preset).home, ConvexObject.disc(center, diameter)
    seed = find_seeds(config, body, GraspRequirements(**who), 0, 0)[0]
    *_, there = approach(config, seed)
    return there, dataclasses.replace(seed, facing=None)


@functools.lru_cache(maxsize=32)
def squeezed(name, needs=NEEDS):
    """Return the path from the touch to a grasp on the ground, and the grasp."""
    return close_grip(*opened(name), needs)


def missed_by(name, needs):
    """Return the violation of what is no grasp."""
    config, closing = opened(name)
    closing = dataclasses.replace(closing, tally=SearchTally())
    assert close_grip(config, closing, needs) is None
    return closing.tally.closest


def others(config, closing):
    """Return how far all else is from the object [m]."""
    members, *modules = closings.gaps(config, closing.body)
    return np.append(np.delete(members, list(closing.members)), modules)


def unbalanced(analysis, body, needs):
    """Return what friction leaves of the load at best [N], moments over d/2: a linear program."""
    forces, normals = analysis.normal_forces, analysis.normals
    segments = forces[:, None] * np.column_stack(
        [-normals[:, 1], normals[:, 0], np.ones(len(forces))]
    )
    arm = np.array([1.0, 1.0, body.arm])
    load = np.append(-forces @ normals, 0.0) + np.array(needs.external_wrench) / arm
    rows = np.block([[segments.T, -np.ones((3, 1))], [-segments.T, -np.ones((3, 1))]])
    bounds = [(-needs.friction, needs.friction)] * len(forces)
    cost = np.append(np.zeros(len(forces)), 1.0)
    return linprog(cost, rows, np.append(-load, load), bounds=[*bounds, (0.0, None)]).fun


@pytest.mark.parametrize('seed', range(12))
def test_sides_are_pressed_as_deep_as_is_said(seed):
    config, body, _ = closings.scene(seed)
    rng = np.random.default_rng(seed)
    for closing in find_seeds(config, body, NEEDS, 0, 0)[:6]:
        depths = rng.uniform(0.0, 0.03, len(closing.members))
        with contextlib.suppress(RequirementError):
            *_, start = approach(config, closing)
            closing = dataclasses.replace(closing, facing=None)
            there = press(start, closing, depths)
            reached = closings.gaps(there, body)[0][list(closing.members)]
            assert reached == pytest.approx(-depths, abs=1e-4)
            # Nothing else comes near that was not.
            least = np.minimum(0.005, others(start, closing))
            assert (others(there, closing) >= least - 2e-5).all()


@pytest.mark.parametrize(
    ('name', 'needs'),
    [
        *((name, NEEDS) for name in GRIPS),
        ('narrow', GraspRequirements(min_margin=0.0, max_contact_force=8.0)),
        ('north', GraspRequirements(min_margin=0.0, max_contact_force=12.0)),
        ('north', GraspRequirements(min_margin=0.0, max_utilisation=0.3)),
        ('north', GraspRequirements(min_margin=0.0, max_total_force=20.0)),
        ('tight', GraspRequirements(min_margin=0.0, max_total_force=20.0)),
        ('narrow', GraspRequirements(min_margin=0.02)),
        ('narrow', GraspRequirements(min_margin=0.0, friction=0.35)),
        ('narrow', GraspRequirements(min_margin=0.0, external_wrench=(0.3, -0.4, 0.02))),
        ('tight', GraspRequirements(min_margin=0.0, external_wrench=(0.8, -1.0, 0.05))),
    ],
)
def test_requirements_are_fulfilled_whatever_the_spacing(name, needs):
    _, closing = opened(name)
    _, pressed = squeezed(name, needs)
    names = pressed.config.robot.member_names
    assert set(pressed.analysis.contact_forces) == {names[i] for i in closing.members}
    assert others(pressed.config, closing).min() > 0.0
    config = pressed.config.robot.configuration(pressed.config.roller_positions)
    for spacing in SPACINGS:
        analysis = analyze_grasp(
            config, closing.body, needs.friction, needs.external_wrench, spacing=spacing
        )
        slack, total = SLACK[spacing], analysis.normal_forces.sum()
        assert total > 0.0
        assert max(analysis.contact_forces.values()) <= needs.max_contact_force * (1.0 + slack)
        assert total <= needs.max_total_force * (1.0 + slack)
        assert max(analysis.utilisation.values()) <= needs.max_utilisation * (1.0 + 4.0 * slack)
        assert analysis.closure_margin >= (needs.min_margin or 0.0) - slack * total
        assert unbalanced(analysis, closing.body, needs) < slack * total


@pytest.mark.parametrize('name', ['north', 'narrow'])
def test_tubes_bear_a_free_object_within_the_bound_too(name):
    _, pressed = squeezed(name)
    free = settle_grasp(pressed.config, pressed.body, NEEDS.friction)
    fast = most_used(pressed.analysis)
    assert pressed.loads['max_utilisation'] == max(most_used(free), fast) <= NEEDS.max_utilisation
    bound = 0.9 * most_used(free)
    _, eased = squeezed(name, GraspRequirements(min_margin=0.0, max_utilisation=bound))
    assert most_used(settle_grasp(eased.config, eased.body, NEEDS.friction)) <= bound


def most_used(analysis):
    """Return the largest share of the wrinkling moment that a tube bears."""
    return max(analysis.utilisation.values())


@pytest.mark.parametrize(
    ('name', 'missed', 'bound'),
    [
        ('top', 'max_contact_force', 1e-3),
        ('top', 'max_total_force', 1e-3),
        ('top', 'max_utilisation', 1e-4),
        ('narrow', 'min_margin', 1e3),
        ('narrow', 'friction', 0.1),
    ],
)
def test_what_is_missed_is_told(name, missed, bound):
    miss = missed_by(name, dataclasses.replace(UNBOUNDED, **{missed: bound}))
    assert miss.requirement == missed.replace('friction', 'closed_by_friction')
    assert miss.bound == bound
    assert (miss.value < bound) == missed.startswith('min_')
