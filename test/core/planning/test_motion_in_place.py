# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The squeeze of a held object changes in place, and what ends the motion is said."""

from dataclasses import replace
import functools
import math

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    GraspRequirements,
    load_robot,
    plan_grasps,
    Polygon,
    tangent_center,
)
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.limits import RollerSpeedLimit
from isotruss_ros.core.planning import motion_in_place
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.motion_in_place import squeeze_in_place
from isotruss_ros.core.planning.violations import RequirementError
import numpy as np
import pytest

HOME = load_robot('nine_member').home
MODULE = 'north/Z'
BODY = ConvexObject.disc(tangent_center(HOME, MODULE, 0.3, 0.01), 0.3)
SLOW, FAST = RollerSpeedLimit(1e-6), RollerSpeedLimit(1.0)
BOX = ((-0.12, -0.09), (0.12, -0.09), (0.12, 0.09), (-0.12, 0.09))


def pair(**fields):
    """Return what closes on a disc between two members, and how these hold it."""
    number = HOME.robot.module_names.index(MODULE)
    members = (number, int(HOME.robot.topology.previous[number]))
    closing = replace(Closing(BODY, members, (FAST,), 0.15), **fields)
    grasp = roll_grip(attach_grip(HOME, BODY, np.array(members)), HOME)
    return replace(closing, body=grasp.body), grasp


@functools.cache
def planned(shape, pose, **values):
    """Plan a grip."""
    needs = GraspRequirements(count=1, **values)
    body = ConvexObject(shape, pose)
    return plan_grasps(HOME, body, needs, max_rounds=1)[0]


def three(**fields):
    """Return what closes on a disc between three members, and how these hold it."""
    grasp = planned(Disc(0.6), (0.716, -0.4134, 0.2), squeeze=12.0)
    return held_by(grasp, **fields)


def held_by(grasp, **fields):
    """Return what closes in a planned grasp, and how its members hold the object."""
    members = tuple(HOME.robot.member_names.index(name) for name in grasp.grip.members)
    held = attach_grip(grasp.config, grasp.grip.body, np.array(members))
    held = roll_grip(held, grasp.config)
    return replace(Closing(held.body, members, (FAST,), 0.15), **fields), held


def ended(grasp, force, closing):
    """Return requirement, value and bound of what ends a motion, and what it took."""
    with pytest.raises(RequirementError) as end:
        squeeze_in_place(grasp, force, closing)
    return end.value.args, closing.tally.evaluations


BOTH = pytest.mark.parametrize('held', [pair, three])


@BOTH
def test_the_squeeze_becomes_what_is_wanted_in_place(held):
    closing, grasp = held()
    force = 1.1 * grasp.squeeze
    found = squeeze_in_place(grasp, force, closing)
    assert found.squeeze == pytest.approx(force, rel=1e-3)
    assert math.dist(found.pose[:2], grasp.pose[:2]) < 2e-5
    assert 0 < closing.tally.evaluations <= 4


def box():
    """Return how two members hold a box, a face of which lies on one of them."""
    pose = (0.6, 0.3, 0.3)
    return held_by(planned(Polygon(BOX, 0.02), pose, module=MODULE, squeeze=10.0))


@pytest.mark.parametrize('away', [5e-5, 0.02, 2.0 * math.pi, 6.3])
def test_what_has_been_turned_comes_back(away):
    closing, grasp = box()
    x, y, angle = grasp.pose
    turned = replace(closing, body=grasp.body.moved_to((x, y, angle + away)))
    placed = squeeze_in_place(grasp, grasp.squeeze, turned)
    assert math.remainder(placed.pose.angle - angle - away, 2.0 * math.pi) == pytest.approx(
        0.0, abs=1e-3
    )


@BOTH
def test_limits_end_the_squeeze(held):
    closing, grasp = held(limits=(SLOW,))
    force = 1.1 * grasp.squeeze
    assert ended(grasp, force, closing) == (('squeeze', pytest.approx(grasp.squeeze), force), 0)


def fail(*arguments):
    """Stand for what has no configuration."""
    raise ConfigurationError('no configuration')


def test_what_is_beyond_a_bound_ends_the_motion(monkeypatch):
    closing, grasp = pair(min_rigidity=100.0)
    force = 1.1 * grasp.squeeze
    assert ended(grasp, force, closing)[0] == ('rigidity', pytest.approx(1.0, abs=0.05), 100.0)
    closing, grasp = pair()
    with monkeypatch.context() as patched:
        patched.setattr(motion_in_place, 'roll_grip', lambda *_: None)
        assert ended(grasp, force, closing)[0] == ('held', 0.0, 1.0)
    monkeypatch.setattr(Configuration, 'moved_to', fail)
    assert ended(grasp, force, closing)[0] == ('rigidity', 0.0, 0.15)


@pytest.mark.parametrize('share', [0.2, 0.3])
def test_what_rollers_cannot_bring_back_goes_along_a_little(share, monkeypatch):
    closing, grasp = pair()
    monkeypatch.setattr(motion_in_place, 'MAX_CONTRACTION', -1.0)  # the first step ends it
    x, y, angle = grasp.pose
    tube = HOME.robot.description.tube_diameter
    closing = replace(closing, body=grasp.body.moved_to((x + share * tube, y, angle)))
    if share < 0.25:
        assert squeeze_in_place(grasp, grasp.squeeze, closing) is grasp
    else:
        bound = pytest.approx(0.25 * tube)
        said, _ = ended(grasp, grasp.squeeze, closing)
        assert said == ('in_place', pytest.approx(share * tube), bound)
