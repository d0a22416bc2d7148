# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measured run of the records of cycles, from the first contact on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
import itertools
import math
from typing import Any

from isotruss_ros.core import Robot, Status
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.status import GRIP_FAULTS
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.recording.recorded_cycle import RecordedCycle
from isotruss_ros.core.recording.repeated_run import read_robot
from isotruss_ros.identification.gauge import Gauge
from isotruss_ros.identification.measured_run import (
    Halt,
    interpolate,
    MeasuredRun,
    RunError,
    Samples,
)
import numpy as np

#: Number of intervals over which a run is averaged, smallest number of samples, and number of
#: intervals in which contact is searched [-].
COUNT, MIN_COUNT, SEARCHED = 60, 10, 1000
#: Time after the last contact that is compared as well, because a loss is seen there [s].
AFTER = 1.0
INPUTS = ('rollers', 'pose', 'pressures')


def read_run(
    cycles: Iterable[RecordedCycle],
    robot: Robot | None = None,
    gauge: Gauge | None = None,
    count: int = COUNT,
) -> MeasuredRun:
    """
    Return the measured run of recorded cycles, while the object is between the members.

    :param robot: robot of recordings without robot file.
    :param gauge: forces of gauges; None: not measured.
    :param count: number of intervals.
    :raises RunError: rollers, poses or contacts are missing.
    :raises MeasurementError: the gauge and the run have different times.
    """
    samples = _collect(cycles, robot)
    whole = samples.average(None, SEARCHED)
    return samples.between(*_find_contact(whole)).average(gauge, count)


def _collect(cycles: Iterable[RecordedCycle], robot: Robot | None) -> Samples:
    """Return the measurements of cycles up to the first slip."""
    found: dict[str, dict[float, Any]] = {name: {} for name in INPUTS}
    halts: list[Halt] = []
    first, last = None, Status.OK
    for cycle in cycles:
        first = first or cycle
        for name, values in found.items():
            if isinstance(given := cycle.inputs.get(name), StampedInput):
                values[given.time] = _plain(name, given.value, cycle.inputs)
        status = cycle.decision.get('status', Status.OK)
        if status is not last and status >= Status.HALT_NO_TWIST:
            halts.append((cycle.now, status, cycle.decision.get('message', '')))
        last = status
        if status in GRIP_FAULTS:
            break
    if first is None:
        raise RunError('no cycle of manipulation is recorded; must have at least one')
    robot = read_robot(first) or robot
    if robot is None:
        raise RunError('the recording has no robot file: name one by --robot')
    if min(len(found['rollers']), len(found['pose'])) < MIN_COUNT:
        raise RunError(
            f'{len(found["rollers"])} roller states and {len(found["pose"])} poses are recorded '
            f'before the end or the first slip; must be at least {MIN_COUNT} of each'
        )
    times, poses = _table(found['pose'])
    poses[:, 2] = np.unwrap(poses[:, 2])
    grip = first.settings.grip
    return Samples(
        robot,
        grip,
        math.nan if 'settings' in first.absent else grip.friction,
        times,
        poses,
        interpolate(times, *_table(found['rollers'])),
        _table(found['pressures']) if found['pressures'] else None,
        tuple(halts),
    )


def _plain(name: str, value: Any, inputs: Mapping[str, Any]) -> Array:
    """Return a measured value as numbers; roller travel with the estimated offsets."""
    if name != 'rollers':
        return np.asarray(value, dtype=float)
    estimate = inputs.get('estimate')
    offsets = estimate.value.offsets if isinstance(estimate, StampedInput) else 0.0
    return value.positions + offsets


def _table(samples: Mapping[float, Any]) -> tuple[Array, Array]:
    """Return the times (k,) in order [s], and the values (k, c)."""
    times = np.array(sorted(samples))
    return times, np.array([samples[time] for time in times.tolist()])


def _find_contact(run: MeasuredRun) -> tuple[float, float]:
    """Return begin and end [s] of the longest time in which all members overlap the object."""
    config, depths = run.robot.configuration(run.travel[0]), []
    for travel, pose in zip(run.travel, run.poses, strict=True):
        config = config.moved_to(travel)
        body = run.grip.body.moved_to(pose)
        depths.append(float(member_depths(config, body)[run.members].min()))
    stretches, place = [(0, 0)], 0
    for is_in_contact, group in itertools.groupby(depth > 0.0 for depth in depths):
        length = len(list(group))
        if is_in_contact:
            stretches.append((length, place))
        place += length
    length, begin = max(stretches)
    if length < MIN_COUNT:
        raise RunError(
            f'the object is between {" and ".join(run.grip.members)} in {length} of '
            f'{len(depths)} intervals of the run; must be at least {MIN_COUNT}; it is at most '
            f'{1e3 * max(depths):.1f} mm deep in both: zeros, tracker or size of the object may '
            'be wrong'
        )
    times = run.times.tolist()
    # The first and the last interval extend beyond their means.
    start = -math.inf if begin == 0 else times[begin]
    end = math.inf if begin + length == len(times) else times[begin + length - 1] + AFTER
    return start, end
