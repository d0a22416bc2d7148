# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Merging of joint states that contain only some of the rollers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from isotruss_ros.core.inputs import InputFault, RejectedInput, RollerState, StampedInput
import numpy as np


class RollerParts:
    """
    Last readings of each roller, from joint states with all or some of the rollers.

    The merged state has the time of the oldest reading; newer readings are interpolated to this
    time.

    :param names: names of the rollers.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        #: Position [m] + 1j speed [m/s] of each roller.
        self._readings: list[list[tuple[float, complex]]] = [[] for _ in names]

    def clear(self) -> None:
        """Discard the readings of all rollers."""
        for readings in self._readings:
            readings.clear()

    def take(self, part: Mapping[int, tuple[float, float]], time: float, now: float) -> None:
        """
        Store the readings of a message that are newer than the stored readings.

        :param part: position [m] and speed [m/s] for the index of each roller in the message.
        :param time: time of the readings, not later than `now` [s].
        :param now: current time on the same clock [s]. If the clock was set back, stored readings
            later than `now` are discarded.
        """
        for number, (position, speed) in part.items():
            readings = self._readings[number]
            if readings and readings[-1][0] > now:
                readings.clear()
            if not readings or time > readings[-1][0]:
                readings.append((time, complex(position, speed)))
            elif time == readings[-1][0]:
                readings[-1] = time, complex(position, speed)

    def merged(self) -> StampedInput | RejectedInput:
        """Return the merged state of all rollers; a rejection if a roller was in no message."""
        readings = self._readings
        missing = [n for n, known in zip(self._names, readings, strict=True) if not known]
        if missing:
            return RejectedInput(
                f'joint states: rollers {", ".join(missing)} are missing; must name '
                f'{", ".join(self._names)}, in one message or in parts'
            )
        times = [known[-1][0] for known in readings]
        time, newest = min(times), max(times)
        for known in readings:
            while len(known) > 1 and known[1][0] <= time:
                del known[0]
        values = np.array(
            [
                known[0][1] if len(known) == 1 else np.interp(time, *zip(*known, strict=True))
                for known in readings
            ]
        )
        behind = None
        if time < newest:
            oldest = self._names[times.index(time)]
            words = (
                f'joint states: roller {oldest} was read {newest - time:.3f} s before the others'
            )
            behind = RejectedInput(words, InputFault.STALE)
        return StampedInput(RollerState(values.real, values.imag), time, behind)
