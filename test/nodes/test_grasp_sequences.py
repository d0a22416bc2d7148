# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Refusals of the sequences of `pick_and_place`, without the nodes under it."""

from concurrent.futures import Future
import math
from types import SimpleNamespace

from isotruss_msgs.action import PlaceObject
from isotruss_ros.core import load_robot, Pose
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.planning.release import Release
from isotruss_ros.core.planning.violations import Violation
from isotruss_ros.nodes.pick_and_place.action_steps import StepError, StepOutcome
from isotruss_ros.nodes.pick_and_place.grasp_sequences import GraspSequences
import numpy as np
import pytest

HOME = load_robot('nine_member').home


def placing(turned, asked):
    """Return sequences whose release turns the object by an angle [rad]; note the bound."""

    def submit(_plan, *arguments):
        asked.append(arguments[-1])
        done = Future()
        violation = Violation('turned', turned, arguments[-1]) if turned > arguments[-1] else None
        done.set_result(Release(np.zeros((2, 6)), 1, violation))
        return done

    def held(_outcome):
        yield 0.0
        return SimpleNamespace(grasping_members=['north/P-Z', 'north/Z-R'])

    def drive(*_arguments):
        yield 0.0

    values = SimpleNamespace(object='', object_diameter=0.2)
    return SimpleNamespace(
        stage=0,
        pose=StampedInput(Pose(0.6, 0.3, 0.0), 0.0),
        held_grip=None,
        timeout=0.2,
        configuration=lambda _now: HOME,
        _await_held=held,
        _drive=drive,
        _confirm=drive,
        _robot=HOME.robot,
        _node=SimpleNamespace(now=lambda: 0.0, values=values),
        _thread=SimpleNamespace(submit=submit),
    )


def place(turned, max_rotation):
    """Place an object; return the bound of its rotation and the result."""
    asked = []
    steps = GraspSequences.place(
        placing(turned, asked), PlaceObject.Goal(max_rotation=max_rotation)
    )
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return asked[0], end.value


def test_a_place_that_would_turn_the_object_by_more_than_its_bound_is_refused_with_the_angle():
    with pytest.raises(StepError, match=r'turns by 0\.175 rad') as refused:
        place(math.radians(10.0), 0.0)
    assert refused.value.outcome is StepOutcome.NO_MOTION_FOUND
    assert refused.value.details['violated_requirement'] == 'turned'


def test_a_place_has_the_bound_of_its_goal_on_the_rotation():
    bound, result = place(math.radians(10.0), math.radians(12.0))
    assert bound == pytest.approx(math.radians(12.0))
    assert result.message.startswith('free')
