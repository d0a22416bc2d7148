# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decisions of a servo, computed again from its memory at any cycle and the inputs that follow."""

import pickle

from faulty_runs import Faults, GRIPS, numbers
from isotruss_ros.core import TwistServo
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from nightly import some_now
import numpy as np
import pytest
from squeeze_loop import SqueezeLoop

CYCLES = 60


@pytest.mark.parametrize('name', sorted(GRIPS))
@pytest.mark.parametrize('seed', some_now(list(range(8)), 2))
def test_a_pickled_memory_and_the_inputs_that_follow_give_the_same_decisions(name, seed):
    rng = np.random.default_rng(seed)
    servo = {'bounds': ShapeBounds() if seed % 2 else None}
    loop = SqueezeLoop(*GRIPS[name], noise=1e-4, more=1.05, servo=servo)
    faults, recorded, memories = Faults(loop, rng), [], []
    for number in range(CYCLES):
        memories.append(pickle.dumps(loop.servo.memory))
        now, decision = loop.now, faults.cycle(number)
        recorded.append((pickle.dumps(loop.servo.inputs), now, decision))
    for first in rng.integers(CYCLES, size=2):
        again = TwistServo(loop.servo.robot, loop.servo.settings)
        again.memory = pickle.loads(memories[first])
        for inputs, now, decision in recorded[first:]:
            again.inputs = pickle.loads(inputs)
            assert numbers(again.decide(now)) == numbers(decision)
