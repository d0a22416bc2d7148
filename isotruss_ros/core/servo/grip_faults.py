# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of the grip under squeeze control, with their causes and the client's next steps."""

from __future__ import annotations

from isotruss_ros.core.estimation.contact_walk import JUMP_LENGTH
from isotruss_ros.core.estimation.grip_belief import GripBelief
from isotruss_ros.core.estimation.state_estimate import is_squeeze_known
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.servo.decision import describe_squeeze
from isotruss_ros.core.servo.swing_watch import SwingWatch
import numpy as np

#: Time at rest after an oscillation [s]; each oscillation also halves the gain.
REST_TIME = 1.0
#: What a client does after a fault that persists.
NEXT_STEPS = {
    Status.HALT_SLIPPED: 'resume the grip (service resume_grip)',
    Status.HALT_NOT_HELD: 'pick up the object (action pick_object)',
}


class GripFaults:
    """
    Fault of the grip of a held object.

    :ivar fault: status of the halt for the fault; None without a fault. It remains until a client
        acknowledges it; only the fault of an oscillation ends by itself.
    :ivar gain: pose gain of the squeeze control [1/s].
    :ivar swings: detector of oscillations, replaced with each new belief.
    :ivar softening: factor on the gain after oscillations [-].
    :ivar slipped: length of a slip after which the object is still held, otherwise 0 [m].
    """

    gain: float
    swings: SwingWatch
    _rest: float  # remaining time at rest after an oscillation [s]
    slipped: float

    def acknowledge(self) -> None:
        """Clear the fault after a client has reacted to it."""
        self.fault: Status | None = None
        self.softening, self._why = 1.0, ''

    def fail(self, fault: Status, why: str) -> None:
        """Store a fault of the grip and its cause, unless there is one that persists."""
        if self.fault in (None, Status.HALT_OSCILLATES):
            self.fault, self._why = fault, why

    def note(self, squeeze: tuple[float, float] | None = None) -> str:
        """
        Return a sentence that describes the fault of the grip; empty if there is none.

        :param squeeze: estimated squeeze and its standard deviation [N]; None without a belief.
        """
        if self.fault is Status.HALT_OSCILLATES:
            return f'the object oscillates: the pose gain is reduced to {self.gain:.3g} 1/s'
        if self.fault is not None:
            return f'{self._why}; next step: {NEXT_STEPS[self.fault]}'
        notes = [f'slipped by {1e3 * self.slipped:.0f} mm, held'] if self.slipped else []
        if squeeze is not None and not is_squeeze_known(*squeeze):
            notes.append(f'held, {describe_squeeze(*squeeze)}')
        return '; '.join(notes)

    def judge(self, belief: GripBelief, elapsed: float, velocity: Array) -> None:
        """
        Detect oscillation, slip and loss from the belief after a new pose.

        An oscillation halves the gain, and is a fault until `REST_TIME` has passed.

        :param elapsed: time since the previous pose [s].
        :param velocity: (3,) executed part of the commanded twist [m/s, rad/s].
        """
        state, surface = belief.state, velocity * np.array([1.0, 1.0, belief.grasp.arm])
        travel = elapsed * float(np.linalg.norm(surface))
        if self.fault is Status.HALT_OSCILLATES:
            self._rest -= elapsed
            if self._rest <= 0.0:
                self.fault = None
                self.swings.forget()
        swings = self.swings.update(belief.correction, state.noise.deviation, elapsed, travel)
        if self.fault is None and swings:
            self.fault = Status.HALT_OSCILLATES
            self._rest, self.softening = REST_TIME, 0.5 * self.softening
        walked = state.walk.length
        if state.jump:
            self.slipped = walked
        elif walked < 0.5 * self.slipped:
            self.slipped = 0.0
        cause = f'the object moved by {1e3 * walked:.0f} mm against the members'
        if state.jump > JUMP_LENGTH:
            self.fail(Status.HALT_NOT_HELD, cause)
        elif belief.slipped:
            self.fail(Status.HALT_SLIPPED, cause)
