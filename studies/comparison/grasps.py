# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forces, friction and stiffness of grasps over wedge and shift."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import itertools

from isotruss_ros.core import settle_grasp
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from pressed_plants import FINE, press, PressedCase, release
from studies.comparison.section import Check, Section
from studies.paper.tables import number, Table

WEDGES, SHIFTS = (55.0, 40.0, 30.0), (0.01, 0.02, 0.04)
STEPS = "MuJoCo's tubes bend only between segments, and its friction creeps"
#: Coefficient of friction at which each wedge holds [-].
FRICTION = 0.8
#: Small wrenches that measure the stiffness [N, N, N m], and rest under each [s].
PULLS, REST = np.diag([0.3, 0.3, 0.03]), 2.0


@dataclass(frozen=True)
class Compared:
    """Results of one grasp in both models."""

    grip: PressedCase  #: wedge and object
    free: Array  #: (2, 2) normal forces on the free object: MuJoCo, model [N]
    required: Array  #: (2,) required friction: MuJoCo, model [-]
    utilisation: float  #: largest utilisation [-]
    stiffness: Array  #: (2, 3, 3) stiffness of the grasp: MuJoCo, model [N/m, N, N m]


def compare(wedges: Sequence[float] = WEDGES, shifts: Sequence[float] = SHIFTS) -> Section:
    """
    Compare grasps.

    :param wedges: angles between the grasping members [degrees].
    :param shifts: distances of the object from the tangent center toward the corner [m].
    """
    grips = [PressedCase(*pair) for pair in itertools.product(wedges, shifts)]
    found = [compare_one(grip) for grip in grips]
    return Section(
        'Forces, friction and stiffness of grasps',
        'An object of 0.3 m is pressed into the corner of the tube `north` at the joint `Z`. '
        f'Then it is free, with friction ({FRICTION:g}), and compared with `settle_grasp`. Small '
        'wrenches measure the stiffness. No bound applies to grasps in which a tube wrinkles.',
        _checks(found),
        _tables(found),
    )


def compare_one(grip: PressedCase) -> Compared:
    """
    Compare one grasp.

    :param grip: wedge and object.
    """
    plant, config, cylinder = press(grip, segments=FINE)
    release(plant, FRICTION)
    start = np.array(plant.object_pose())
    settled = settle_grasp(config, cylinder.moved_to(start), FRICTION)
    free = plant.contact_forces()
    names = sorted(settled.normal_forces)
    forces = [[free[name].normal, settled.normal_forces[name]] for name in names]
    used = max(abs(force.friction) / force.normal for force in free.values())
    return Compared(
        grip,
        np.array(forces).T,
        np.array([used, settled.required_friction]),
        max(settled.utilisation.values()),
        np.array([_stiffness(plant, start), settled.stiffness]),
    )


def _stiffness(plant: MujocoPlant, start: Array) -> Array:
    """Return the stiffness (3, 3) of the grasp by small pulls."""
    gives = []
    for wrench in PULLS:
        ends = []
        for sign in (1.0, -1.0):
            plant.pull(sign * wrench)
            plant.settle(REST)
            ends.append(np.array(plant.object_pose()))
        gives.append(0.5 * (ends[0] - ends[1]))
    plant.pull(np.zeros(3))
    return np.linalg.inv(np.array(gives).T @ np.linalg.inv(PULLS))


def _checks(found: Sequence[Compared]) -> tuple[Check, ...]:
    inside = [grasp for grasp in found if grasp.utilisation <= 1.0]

    def worst(share: Callable[[Compared], Array | float]) -> float:
        return max(float(np.max(share(grasp))) for grasp in inside)

    kinds: tuple[tuple[str, float, float, str, Callable[[Compared], Array | float]], ...] = (
        ('normal forces, free', 1.0, 1e2, '%', lambda g: _off(g.free)),
        ('required friction', 2.0, 1e2, '%', lambda g: _off(g.required)),
        ('grasp stiffness', 4.0, 1e2, '%', _stiffness_error),
    )
    return tuple(
        Check(what, scale * worst(share), bound, unit, STEPS)
        for what, bound, scale, unit, share in kinds
    )


def _off(values: Array) -> Array:
    """Return the relative differences of values (2, ...) of both models."""
    return np.abs(values[0] / values[1] - 1.0)


def _stiffness_error(grasp: Compared) -> float:
    """Return the largest relative difference of the compliance."""
    even = np.array([1.0, 1.0, 0.5 * grasp.grip.diameter])
    give = np.linalg.inv(grasp.stiffness) * np.outer(even, even)
    return float(np.linalg.norm(give[0] - give[1], 2) / np.linalg.norm(give[1], 2))


def _tables(found: Sequence[Compared]) -> tuple[Table, ...]:
    rows = []
    for grasp in found:
        grip = (f'{grasp.grip.degrees:.0f}', f'{1e3 * grasp.grip.shift:.0f}')
        forces = [number(float(forces.mean())) for forces in grasp.free]
        needs = [number(need) for need in grasp.required]
        off, used = number(100.0 * _stiffness_error(grasp), 2), number(grasp.utilisation, 2)
        rows.append((*grip, *forces, *needs, off, used))
    return (
        Table(
            'grasps_free',
            'Free object, held by friction. Stiffness matrices are compared by their inverses, '
            'the compliances',
            (
                'wedge [°]',
                'shift [mm]',
                'mean N MuJoCo [N]',
                'ours',
                'required friction MuJoCo',
                'ours',
                'stiffness off by [%]',
                'utilisation',
            ),
            rows,
            shown=False,
        ),
    )
