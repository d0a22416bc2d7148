# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Convergence of the analysis of a grasp with the spacing of its contact points.

Grasps of the nine-member robot are random: roller travel within 0.15 m of home, and an object of
0.15 to 0.5 m that is pressed 3 to 25 mm into the corner of a random module. Each grasp is analysed
at the default spacing and at a quarter of it. The table shows the distribution of the differences.
Differences of forces, friction and margins are relative to the sum of the normal forces;
differences of lengths and pressures are relative to their values.
"""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.measuring import part, Table
from isotruss_ros.core import (
    analyze_grasp,
    Configuration,
    ConvexObject,
    IsotrussError,
    load_robot,
    tangent_center,
)
from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
import numpy as np

ROBOT = load_robot('nine_member')
SEED, GRASPS = 2, part(200)
SPACING, FINER = 0.005, 4
REACH, DIAMETERS, DEPTHS = 0.15, (0.15, 0.5), (0.003, 0.025)
FRICTION = 0.5


def random_grasps(count: int) -> Iterator[tuple[Configuration, ConvexObject]]:
    """Yield configurations with an object pressed into a corner."""
    draw = np.random.default_rng(SEED)
    while count:
        module = ROBOT.module_names[draw.integers(len(ROBOT.module_names))]
        diameter, depth = draw.uniform(*DIAMETERS), draw.uniform(*DEPTHS)
        try:
            config = ROBOT.configuration(draw.uniform(-REACH, REACH, len(ROBOT.roller_names)))
            center = tangent_center(config, module, diameter, depth)
        except IsotrussError:
            continue  # no such shape, or no room for the object
        yield config, ConvexObject.disc(center, diameter)
        count -= 1


def differences(coarse: GraspAnalysis, fine: GraspAnalysis) -> dict[str, float]:
    """Return the relative change of each result of an analysis."""
    total = float(fine.normal_forces.sum())

    def largest(name: str) -> float:
        one, other = getattr(coarse, name), getattr(fine, name)
        most = max(other.values())
        return max(
            (abs(one.get(key, 0.0) - value) / (value if name != 'utilisation' else most))
            for key, value in other.items()
        )

    finite = [value for value in (coarse, fine) if np.isfinite(value.required_friction)]
    friction = 0.0
    if len(finite) == 2:
        friction = coarse.required_friction / fine.required_friction - 1.0
    return {
        'force of a member': largest('contact_forces'),
        'contact length of a member': largest('contact_lengths'),
        'pressure of contact': largest('contact_pressures'),
        'utilisation': largest('utilisation'),
        'required friction': abs(friction),
        'closure margin': abs(coarse.closure_margin - fine.closure_margin) / total,
        'grasp stiffness': float(
            np.abs(coarse.stiffness - fine.stiffness).max() / np.abs(fine.stiffness).max()
        ),
    }


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    found, flips = [], 0
    for config, cylinder in random_grasps(GRASPS):
        coarse, fine = (
            analyze_grasp(config, cylinder, FRICTION, spacing=spacing)
            for spacing in (SPACING, SPACING / FINER)
        )
        found.append(differences(coarse, fine))
        flips += coarse.closed_by_friction != fine.closed_by_friction
    rows = []
    for name in found[0]:
        values = 100.0 * np.array([each[name] for each in found])
        rows.append(
            [name, *(f'{x:.2f}' for x in (*np.percentile(values, [50, 95]), values.max()))]
        )
    title = f'{GRASPS} random grasps; force closure differs in {flips}.'
    yield Table(title, ('change [%]', 'median', '95 %', 'largest'), rows)
