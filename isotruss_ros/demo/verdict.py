# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Verdict on the phases of the demonstration: held, on target, and at the desired rate."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_ros.core import Status
from isotruss_ros.demo.client import LEVER_ARM
from isotruss_ros.demo.record import PhaseRecord
from isotruss_ros.nodes.framework.cycle import MIN_RATE_SHARE
from isotruss_ros.nodes.grasp.grasp_report import GraspCode
import numpy as np
from rich.console import Console

#: Largest difference between the measured and the executed displacement of the object, if no
#: control cycle was late [m].
MAX_POSITION_ERROR = 1e-3
MAX_ANGLE_ERROR = np.deg2rad(0.25)
#: Value in place of `MAX_POSITION_ERROR` with simulated sensor faults [m].
MAX_REAL_ERROR = 1e-2


def print_verdict(
    records: Sequence[PhaseRecord], real: bool, rate: float, console: Console
) -> int:
    """
    Print failures; return 0 if the object was held and reached its targets, else 1.

    :param rate: desired rate of the control loop [Hz].
    """
    code, limit = 0, MAX_REAL_ERROR if real else MAX_POSITION_ERROR
    for record in records:
        if not real:
            _print_anomalies(record, console)
        slowness = ''
        if record.lowest_rate < MIN_RATE_SHARE * rate:
            slowness = (
                f'the loop reached only {record.lowest_rate:.0f} of {rate:g} Hz in its slowest '
                'second'
            )
        if record.shortfall > limit:
            shortfall = f'{1e3 * record.shortfall:.1f} mm'
            console.print(
                f'{record.name}: limits shortened the motion by {shortfall}', style='yellow'
            )
        faults = []
        if real and min(record.squeezes) <= 0.0:
            faults.append('the object was not held')
        if not real and record.held_fraction < 1.0:
            faults.append(
                f'the object was held in only {100.0 * record.held_fraction:.1f} % of the analyses'
            )
        # A command that is executed for longer than one cycle moves the object too far.
        turned = not real and record.angle_error > MAX_ANGLE_ERROR + record.delay / LEVER_ARM
        if turned or record.position_error > limit + record.delay:
            angle = '' if real else ' or 0.25 degrees'
            cycles = f'with cycles of up to {1e3 * record.longest_cycle:.0f} ms'
            faults.append(f'the error is larger than {1e3 * limit:g} mm{angle}, {cycles}')
        if slowness and not faults:
            console.print(f'{record.name}: {slowness}', style='yellow')
        for fault in faults:
            words = '; '.join(filter(None, (fault, slowness)))
            console.print(f'{record.name}: {words}', style='red')
            code = 1
    return code


def _print_anomalies(record: PhaseRecord, console: Console) -> None:
    """Print unusual statuses, and the effect of an external force."""
    odd = {
        str(status) for status in record.statuses - {Status.OK, Status.IDLE, Status.ACCELERATING}
    }
    codes = {GraspCode(grasp.code) for grasp in record.grasps}
    odd |= {f'grasp: {code}' for code in codes - {GraspCode.OK}}
    if odd:
        console.print(f'{record.name}: {", ".join(sorted(odd))}', style='yellow')
    if record.pull is not None:
        size = float(np.hypot(*record.pull[:2]))
        console.print(
            f'{record.name}: a pull of {size:g} N moved the object by up to '
            f'{1e3 * record.max_shift:.1f} mm; afterwards its error was '
            f'{1e3 * record.position_error:.2f} mm'
        )
