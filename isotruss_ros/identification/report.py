# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Printed report of a compared run: quantities, hypotheses, and a block to paste."""

from __future__ import annotations

from collections.abc import Iterator
import math

from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.manipulation.status import GRIP_FAULTS
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.identification.hypotheses import ComparedRun, Hypothesis, NAMED, NONE
from isotruss_ros.identification.residuals import FRICTION_ERROR
from isotruss_ros.identification.rolled_run import Parameters
import numpy as np

#: Parameters by hypothesis: words, factor of the unit, unit.
WORDS = {
    'friction': ('coefficient of friction', 1.0, ''),
    'tube': ('stiffness of the tubes', 100.0, ' %'),
    'offsets': ('zeros of the rollers', 1e3, ' mm'),
    'pressure': ('pressures, and their rise', 100.0, ' %'),
    'delay': ('delay of the poses', 1e3, ' ms'),
    'creep': ('loss of stiffness until the end', 100.0, ' %'),
    'mass': ('mass of the object', 100.0, ' %'),
}


def describe(compared: ComparedRun, told: Array | None = None) -> Iterator[str]:
    """
    Yield the lines of the report.

    :param told: (k, 3) times [s], squeeze and its standard deviation [N] of the control loop.
    """
    yield from _describe_run(compared)
    yield ''
    yield f'{"quantity":<28}{"measured":>15}{"model":>12}{"deviation":>12}'
    for name, value, model, deviation in quantities(compared, told):
        yield f'{name:<28}{value:>15}{model:>12}{deviation:>12}'
    yield ''
    yield f'{"hypothesis":<12}{"evidence":>9}  what deviates from files and settings'
    for one in compared.hypotheses.values():
        if one.name != NONE:
            yield f'{one.name:<12}{_evidence(one)}  {describe_estimate(compared, one)}'
    yield ''
    yield f'named: {compared.named} (evidence of more than {NAMED:g})'
    if compared.alike:
        yield f'this run does not tell it apart from: {", ".join(compared.alike)}'


def _describe_run(compared: ComparedRun) -> Iterator[str]:
    run, lost = compared.run, compared.lost
    duration = run.times[-1] - run.times[0]
    yield f'{run.robot.name}, {" and ".join(run.grip.members)}: {duration:.1f} s'
    for time, status, message in run.halts:
        kind = 'slip' if status in GRIP_FAULTS else 'halt'
        yield f'{kind} after {time - run.times[0]:.2f} s: {status.name}: {message}'
    if lost is None:
        yield 'held until the end' if not run.slips else 'reported as slipped, and not moved'
    else:
        yield f'lost after {run.times[lost] - run.times[0]:.2f} s'


def quantities(compared: ComparedRun, told: Array | None) -> Iterator[tuple[str, str, str, str]]:
    """Yield name, measured value, modelled value and standard deviation of each quantity."""
    run, model, settings = compared.run, compared.nominal, EstimatorSettings()
    used = len(run.times) if compared.lost is None else compared.lost + 1
    rms = np.sqrt(np.mean((run.poses - model.poses)[:used] ** 2, axis=0))
    for name, value in zip('xy', rms[:2], strict=True):
        shown = f'{1e3 * settings.pose_error:.1f} mm'
        yield f'{name}, rms difference', f'{1e3 * value:.2f} mm', '0', shown
    turn = math.degrees(settings.pose_error / run.grip.body.arm)
    yield 'angle, rms difference', f'{math.degrees(rms[2]):.2f} deg', '0', f'{turn:.2f} deg'
    is_read = np.isfinite(run.squeeze[:used])
    if is_read.any():
        gauge = float(run.squeeze[:used][is_read].mean())
        ours = float(model.squeeze[:used][is_read].mean())
        error = settings.squeeze_error * ours
        yield 'mean squeeze of the gauge', f'{gauge:.2f} N', f'{ours:.2f} N', f'{error:.2f} N'
        if told is not None and len(told):
            loop = np.interp(run.times[:used][is_read], told[:, 0], told[:, 1]).mean()
            deviation = f'{np.median(told[:, 2]):.2f} N'
            yield 'squeeze told by the loop', f'{gauge:.2f} N', f'{loop:.2f} N', deviation
    else:
        yield 'squeeze', 'no gauge', f'{model.squeeze[:used].mean():.2f} N', ''
    required = model.required[:used]
    value = float(required.max() if compared.lost is None else required[-1])
    words = 'friction used at most' if compared.lost is None else 'friction at the loss'
    known = 'unknown' if math.isnan(run.friction) else f'{run.friction:.3f}'
    yield words, f'{value:.3f}', known, f'{FRICTION_ERROR * value:.3f}'
    if compared.friction_range is not None:
        limits = ' - '.join(f'{limit:.3f}' for limit in compared.friction_range)
        yield 'range by contact history', limits, known, ''


def _evidence(one: Hypothesis) -> str:
    return f'{one.evidence:>9.1f}' if one.is_determined else f'{"-":>9}'


def describe_estimate(compared: ComparedRun, one: Hypothesis) -> str:
    """Return the estimate of a hypothesis in words."""
    words, factor, unit = WORDS[one.name]
    if not one.is_determined:
        return f'{words}: not determined by this run'
    part = getattr(Parameters.of(compared.run), one.name)
    pairs = zip(factor * one.estimate[part], factor * one.deviation[part], strict=True)
    shown = [f'{value:+.3g} ± {deviation:.2g}{unit}' for value, deviation in pairs]
    if one.name == 'offsets':
        names = compared.run.robot.roller_names
        shown = [f'{name} {text}' for name, text in zip(names, shown, strict=True)]
    bound = factor * one.smallest
    named = '' if math.isnan(bound) else f'; named from ±{bound:.2g}{unit} on'
    return f'{words}: {", ".join(shown)}{named}'


def block(compared: ComparedRun) -> str:
    """Return lines for the robot file, the object file and `core.Uncertainty`."""
    run, parts = compared.run, Parameters.of(compared.run)
    best = compared.hypotheses[compared.named]
    file, lines = run.robot.description, []

    def change(part: slice) -> float:
        return float(best.estimate[part][0])

    if best.name == 'tube':
        scale = file.stiffness_scale * (1.0 + change(parts.tube))
        lines += ['# robot file', f'tube: {{stiffness_scale: {scale:.3g}}}']
    elif best.name == 'pressure':
        level = 1.0 + change(parts.pressure)
        pressures = ', '.join(f'{level * value:.0f}' for value in file.pressures.values())
        lines += [f'# robot file, pressures of the tubes [Pa]: {pressures}']
    elif best.name == 'friction':
        friction = run.friction + change(parts.friction)
        lines += ['# object file', f'friction: {friction:.3g}']
    elif best.name == 'mass' and run.grip.body.mass is not None:
        mass = run.grip.body.mass * (1.0 + change(parts.mass))
        lines += ['# object file', f'mass: {mass:.3g}']
    elif best.name == 'offsets':
        lines += ['# zeros of the rollers: isotruss calibrate_home']
    elif best.name == 'delay':
        lines += [f'# stamps of the poses: {change(parts.delay):.3f} s earlier']
    elif best.name == 'creep':
        lines += [f'# tubes: {100.0 * change(parts.creep):.0f} % softer at the end of the run']
    deviations = {
        'friction': compared.deviations[parts.friction][0],
        'stiffness': compared.deviations[parts.tube][0],
        'roller_offset': compared.deviations[parts.offsets].max(),
        'position': compared.deviations[parts.pose][:2].max(),
        'angle': compared.deviations[parts.pose][2],
    }
    shown = {name: f'{value:.2g}' for name, value in deviations.items()}
    keys = ', '.join(f'{name}: {value}' for name, value in shown.items())
    arguments = ', '.join(f'{name}={value}' for name, value in shown.items())
    lines += ['# robot file or object file', f'uncertainty: {{{keys}}}']
    return '\n'.join([*lines, f'# core.Uncertainty({arguments})'])
