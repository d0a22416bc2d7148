# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inputs from several messages: the latest of them, and joint states with some rollers each."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence

from isotruss_ros.core.inputs import (
    CLOCK_SKEW,
    Input,
    InputFault,
    RejectedInput,
    RollerState,
    StampedInput,
    Timeline,
)
import numpy as np


def keep_latest(kept: Input, received: StampedInput | RejectedInput, now: float) -> Input:
    """
    Return the later of two inputs with checked stamps, unless the later input is rejected.

    Messages may arrive in the wrong order; an earlier message is dropped. A rejected message does
    not replace a measurement, which stays valid until its timeout; the rejection is stored with
    the measurement. If the previous input has a later stamp than `now` [s], the clock was set
    back, and the previous input is dropped.
    """
    if not isinstance(kept, StampedInput) or kept.time > now + CLOCK_SKEW:
        return received
    if isinstance(received, RejectedInput):
        return kept._replace(rejected=received)
    return kept if received.time < kept.time else received


class RollerParts:
    """
    Last readings of each roller, from joint states with all or some of the rollers.

    The merged state has the time of the oldest reading; newer readings are interpolated to this
    time.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        #: (time [s], position [m] + 1j speed [m/s]) of each roller, in order of time.
        self._readings = [deque[tuple[float, complex]]() for _ in names]

    def clear(self) -> None:
        """Discard the readings of all rollers."""
        for readings in self._readings:
            readings.clear()

    def take(self, part: Mapping[int, tuple[float, float]], time: float, now: float) -> None:
        """
        Store the positions [m] and speeds [m/s] by roller index that are newer than the stored.

        Stored readings later than `now` [s], before the clock was set back, are discarded.
        """
        for number, reading in part.items():
            readings = self._readings[number]
            if readings and readings[-1][0] > now:
                readings.clear()
            if readings and readings[-1][0] > time:
                continue
            if readings and readings[-1][0] == time:
                readings.pop()
            readings.append((time, complex(*reading)))

    def merged(self) -> StampedInput | RejectedInput:
        """Return the merged state of all rollers; a rejection if a roller was in no message."""
        readings = self._readings
        missing = [self._names[i] for i, stored in enumerate(readings) if not stored]
        if missing:
            return RejectedInput(
                f'joint states: rollers {", ".join(missing)} are missing; must name '
                f'{", ".join(self._names)}, in one message or in parts'
            )
        times = [stored[-1][0] for stored in readings]
        time, newest = min(times), max(times)
        for stored in readings:
            while len(stored) > 1 and stored[1][0] <= time:
                stored.popleft()
        values, behind = np.array([Timeline(tuple(stored)).at(time) for stored in readings]), None
        if time < newest:
            oldest = self._names[times.index(time)]
            words = (
                f'joint states: roller {oldest} was read {newest - time:.3f} s before the others'
            )
            behind = RejectedInput(words, InputFault.STALE)
        return StampedInput(RollerState(values.real, values.imag), time, behind)
