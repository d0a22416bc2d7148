# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs of the twist servo with random faults of its inputs, and what it decides."""

from grips import gripped
from held_grips import HOME
from isotruss_ros.core import Disc, Grip, place_between, Status
from isotruss_ros.core.estimation.state_estimate import EstimatedTravel
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.inputs import RejectedInput, RollerState, StampedInput
import numpy as np

CONFIG, BODY = gripped(35.0, squeeze=0.1)
MEMBERS = ('north/P-Z', 'north/Z-R')
DISC = place_between(HOME, MEMBERS, Disc(0.2), indentation=0.01).body
GRIPS = {
    'wedge': (CONFIG, Grip.at_module(CONFIG.robot, 'north/Z', BODY, 0.5)),
    'home': (HOME, Grip(MEMBERS, attach_grip(HOME, DISC).body, 0.8)),
}


class Faults:
    """Random twists and inputs, of which each kind lasts for some cycles."""

    def __init__(self, loop, rng):
        self.loop, self.rng, self.until = loop, rng, 0
        self.offsets = np.zeros(6)

    def cycle(self, number):
        """Execute a cycle of the loop."""
        loop, rng = self.loop, self.rng
        if number >= self.until:
            self.until = number + int(rng.integers(4, 12))
            self.kind = rng.choice(
                ['twist', 'twist', 'rest', 'jump', 'repeat', 'bad', 'gone', 'offsets', 'stop']
            )
            self.twist = rng.normal(size=3) * (0.03, 0.03, 0.15)
            self.away = rng.normal(size=3) * (3e-3, 3e-3, 0.0)
            halt = (Status.HALT_EMERGENCY_STOP, 'stop') if self.kind == 'stop' else None
            loop.servo.receive(halt=halt)
            if self.kind == 'offsets':
                self.offsets = 2e-3 * rng.normal(size=6)
        inputs, away = {}, {'jump': self.away, 'gone': (5.0, 5.0, 0.0)}.get(self.kind, (0.0,) * 3)
        positions = loop.plant.roller_positions + self.offsets
        state = RollerState(positions, loop.plant.roller_velocities, self.offsets)
        inputs['rollers'] = StampedInput(state, loop.now)
        estimate = EstimatedTravel(self.offsets, 1e-6 * np.eye(6))
        inputs['estimate'] = StampedInput(estimate, loop.now)
        if self.kind == 'repeat' and number:
            inputs['pose'] = loop.servo.inputs.pose
        if self.kind == 'bad':
            inputs['pose'] = RejectedInput('no pose')
        twist = None if self.kind == 'rest' else self.twist
        return loop.cycle(twist, away=away, **inputs)


def numbers(decision):
    """Return the parts of a decision."""
    command = decision.command
    return (
        command.roller_velocities.tolist(),
        command.achieved_twist.tolist(),
        (command.scale, command.status, command.limiting, decision.message),
        (decision.squeeze, decision.desired_pose, decision.pose_gain, decision.pose_delay),
    )
