# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Faults of a grip: oscillation, slip and loss, which remain until a client acknowledges them.

Their thresholds are in `fault_thresholds`. A belief that was lost, without another one, is a loss
as well, see `SqueezeControl`.
"""

from __future__ import annotations

from dataclasses import dataclass
import math

from isotruss_ros.core.estimation.fault_thresholds import JUMP_LENGTH, REST_TIME
from isotruss_ros.core.estimation.grip_belief import GripBelief
from isotruss_ros.core.manipulation.status import GRIP_FAULTS, Status
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.frozen import replace
from isotruss_ros.core.servo.swing_watch import SwingWatch
import numpy as np


@dataclass(frozen=True, eq=False)
class GripFaults:
    """
    Fault of a grip, and what its detection remembers.

    :ivar fault: status of the halt; None without a fault. It remains until a client acknowledges
        it; only the fault of an oscillation ends by itself.
    :ivar why: cause of a fault that persists.
    :ivar softening: factor on the gain after oscillations [-].
    :ivar rest: remaining time at rest after an oscillation [s].
    :ivar slipped: length of a slip after which the object is still held, otherwise 0 [m].
    :ivar swings: detector of oscillations, replaced with each new belief.
    """

    fault: Status | None = None
    why: str = ''
    softening: float = 1.0
    rest: float = 0.0
    slipped: float = 0.0
    swings: SwingWatch | None = None

    def failed(self, fault: Status, why: str) -> GripFaults:
        """Return the faults with another one and its cause, unless one that persists is set."""
        if self.fault not in (None, Status.HALT_OSCILLATES):
            return self
        return replace(self, fault=fault, why=why)

    def rested(self, elapsed: float) -> GripFaults:
        """Return the faults after a time [s]; a rest ends the fault of an oscillation."""
        if self.fault is not Status.HALT_OSCILLATES:
            return self
        rest = self.rest - elapsed
        if rest > 0.0:
            return replace(self, rest=rest)
        return replace(self, rest=rest, fault=None, swings=self.swings.restarted())

    def judged(self, belief: GripBelief, elapsed: float, velocity: Array) -> GripFaults:
        """
        Return the faults by the belief after a new pose.

        An oscillation halves the gain, and is a fault until `REST_TIME` has passed.

        :param elapsed: time since the previous pose [s].
        :param velocity: (3,) executed part of the twist [m/s, rad/s].
        """
        state = belief.state
        noise = math.sqrt(state.noise.variances.max())
        travel = elapsed * float(np.linalg.norm(belief.scale * velocity))
        swings, oscillates = self.swings.updated(belief.displacement, noise, elapsed, travel)
        slip, slipped = state.walk.length, self.slipped
        if state.jump:
            slipped = slip
        elif slip < 0.5 * slipped:
            slipped = 0.0
        faults = replace(self, swings=swings, slipped=slipped)
        if self.fault is None and oscillates:
            rest, softening = REST_TIME, 0.5 * self.softening
            fault = Status.HALT_OSCILLATES
            faults = replace(faults, fault=fault, rest=rest, softening=softening)
        moved = f'the object moved by {1e3 * slip:.0f} mm against the members'
        cause = f'{moved}, or the tracker turned or jumped'
        if state.jump > JUMP_LENGTH:
            return faults.failed(Status.HALT_NOT_HELD, cause)
        return faults.failed(Status.HALT_SLIPPED, cause) if belief.slipped else faults

    def describe(self, gain: float) -> str:
        """Return a sentence on the fault, for a pose gain [1/s]; empty without a fault."""
        if self.fault is Status.HALT_OSCILLATES:
            return f'the object oscillates: the pose gain is reduced to {gain:.3g} 1/s'
        if self.fault is not None:
            return f'{self.why}; next step: {GRIP_FAULTS[self.fault].remedy}'
        return ''
