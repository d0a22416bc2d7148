# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forces, friction and stiffness of grasps over wedge and indentation, fixed and free object."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import itertools

from comparison.grips import FINE, press, PressedCase, release
from comparison.section import Check, Section
from isotruss_ros.core import analyze_grasp, Configuration, settle_grasp
from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from paper.tables import number, Table

WEDGES, INDENTATIONS = (55.0, 40.0, 30.0), (0.01, 0.02, 0.04)
STEPS = "MuJoCo's tubes bend only between segments, and its friction creeps"
#: Coefficient of friction at which each wedge holds [-].
FRICTION = 0.8
#: Small wrenches that measure the stiffness [N, N, N m], and rest under each [s].
PULLS, REST = np.diag([0.3, 0.3, 0.03]), 2.0


@dataclass(frozen=True)
class Compared:
    """Results of one grasp in both models."""

    grip: PressedCase  #: wedge and object
    normals: Array  #: (2, 2) normal forces on the fixed object without friction: MuJoCo, model [N]
    places: Array  #: (2,) distances between the contacts of both models [m]
    gives: Array  #: (2, 3) displacement of the object at its release: MuJoCo, model [m, rad]
    free: Array  #: (2, 2) normal forces on the free object: MuJoCo, model [N]
    required: Array  #: (2,) required friction: MuJoCo, model [-]
    utilisation: float  #: largest utilisation [-]
    stiffness: Array  #: (2, 3, 3) stiffness of the grasp: MuJoCo, model [N/m, N, N m]


def compare(
    wedges: Sequence[float] = WEDGES, indentations: Sequence[float] = INDENTATIONS
) -> Section:
    """
    Compare grasps.

    :param wedges: angles between the grasping members [degrees].
    :param indentations: indentations of the members, for straight tubes [m].
    """
    grips = [PressedCase(*pair) for pair in itertools.product(wedges, indentations)]
    found = [compare_one(grip) for grip in grips]
    return Section(
        'Forces, friction and stiffness of grasps',
        'An object of 0.3 m is pressed into the corner of the tube `north` at the joint `Z`. '
        'First the object is fixed and without friction: normal forces and their positions are '
        f'compared with `analyze_grasp`. Then it is free, with friction ({FRICTION:g}). '
        'Its predicted displacement is the unbalanced wrench divided by the grasp stiffness; '
        'equilibrium, forces and required friction are compared with `settle_grasp`. Small '
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
    analysis, forces = analyze_grasp(config, cylinder), plant.contact_forces()
    names = sorted(analysis.contact_forces)
    normals = np.array(
        [
            [forces[name].normal for name in names],
            [analysis.contact_forces[name] for name in names],
        ]
    )
    places = np.array([forces[name].point - _place(config, name, analysis) for name in names])
    release(plant, FRICTION)
    start = np.array(plant.object_pose())
    settled = settle_grasp(config, cylinder.moved_to(start), FRICTION)
    free = plant.contact_forces()
    gives = [start - cylinder.pose]
    gives.append(np.linalg.solve(settled.stiffness, analysis.normal_wrench))
    return Compared(
        grip,
        normals,
        np.abs(places),
        np.array(gives),
        np.array(
            [
                [free[name].normal for name in names],
                [settled.normal_forces[name] for name in names],
            ]
        ),
        np.array(
            [
                max(abs(force.friction) / force.normal for force in free.values()),
                settled.required_friction,
            ]
        ),
        max(analysis.utilisation.values()),
        np.array([_stiffness(plant, start), settled.stiffness]),
    )


def _place(config: Configuration, name: str, analysis: GraspAnalysis) -> complex:
    """Return a member's centre of pressure in the analysis, x + iy [m]."""
    mine = analysis.members == config.robot.member_names.index(name)
    x, y = np.average(analysis.points[mine], axis=0, weights=analysis.normal_forces[mine])
    return complex(x, y)


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
        ('normal forces, fixed', 2.0, 1e2, '%', lambda g: _off(g.normals)),
        ('place of contact', 3.0, 1e3, 'mm', lambda g: g.places),
        ('displacement on release', 5.0, 1e2, '%', _give_error),
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


def _give_error(grasp: Compared) -> float:
    """Return the relative difference of the displacements on release (rotations × radius)."""
    even = np.array([1.0, 1.0, 0.5 * grasp.grip.diameter])
    gives = grasp.gives * even
    return float(np.linalg.norm(gives[0] - gives[1]) / np.linalg.norm(gives[1]))


def _stiffness_error(grasp: Compared) -> float:
    """Return the largest relative difference of the compliance."""
    even = np.array([1.0, 1.0, 0.5 * grasp.grip.diameter])
    give = np.linalg.inv(grasp.stiffness) * np.outer(even, even)
    return float(np.linalg.norm(give[0] - give[1], 2) / np.linalg.norm(give[1], 2))


def _tables(found: Sequence[Compared]) -> tuple[Table, ...]:
    fast, free = [], []
    for grasp in found:
        grip = (f'{grasp.grip.degrees:.0f}', f'{1e3 * grasp.grip.indentation:.0f}')
        pairs = [cell for theirs, our in grasp.normals.T for cell in (number(theirs), number(our))]
        used = number(grasp.utilisation, 2)
        fast.append((*grip, *pairs, number(1e3 * float(grasp.places.max()), 2), used))
        gives = [number(1e3 * float(np.hypot(*give[:2]))) for give in grasp.gives]
        forces = [number(float(forces.mean())) for forces in grasp.free]
        needs = [number(need) for need in grasp.required]
        off = number(100.0 * _stiffness_error(grasp), 2)
        free.append((*grip, *gives, *forces, *needs, off))
    wedge = ('wedge [°]', 'indentation [mm]')
    return (
        Table(
            'grasps_fast',
            'Fixed object, without friction',
            (
                *wedge,
                'N₁ MuJoCo [N]',
                'N₁ ours',
                'N₂ MuJoCo',
                'N₂ ours',
                'contacts apart [mm]',
                'utilisation',
            ),
            fast,
            shown=False,
        ),
        Table(
            'grasps_free',
            'Free object, held by friction. The give is the displacement of its centre when it is '
            'no longer fixed. Stiffness matrices are compared by their inverses, the compliances',
            (
                *wedge,
                'give MuJoCo [mm]',
                'ours',
                'mean N MuJoCo [N]',
                'ours',
                'required friction MuJoCo',
                'ours',
                'stiffness off by [%]',
            ),
            free,
            shown=False,
        ),
    )
