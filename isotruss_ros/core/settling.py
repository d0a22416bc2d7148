"""Where an object comes to rest between tubes that press on it, with friction."""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.grasp_analysis import analyze_grasp, Cylinder, GraspAnalysis
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MAX_STEPS = 60
#: No step is longer than this share of the diameter, and the object comes no further than that.
MAX_STEP, MAX_WAY = 0.01, 0.1
#: Less than this holds nothing: on its way out the object comes to where next to nothing presses
#: on it, and next to nothing has to be balanced there [N].
LEAST_FORCE = 1e-3


@dataclass(frozen=True)
class Settled:
    """
    An object that friction holds.

    :ivar cylinder: the object, where it came to rest.
    :ivar analysis: of its grasp there.
    """

    cylinder: Cylinder
    analysis: GraspAnalysis


def settle(
    config: Configuration,
    cylinder: Cylinder,
    friction: float = 0.5,
    external_wrench: ArrayLike = (0.0, 0.0, 0.0),
    spacing: float = 0.005,
) -> Settled | None:
    """
    Let an object give way to what friction cannot balance, until it can: until (10) holds.

    Where it would go together with its points of contact is the unbalanced wrench over the
    stiffness of the grasp. As it slides along tubes that are stiff along themselves, that is far
    too short in some directions; how it changes with each step tells by how much (secants).
    Unlike `find_resting_pose`, it stays where friction first holds it.

    :param friction: coefficient between tube and object.
    :param external_wrench: (fx, fy, m) on the object about its centre [N, N m].
    :param spacing: see `analyze_grasp`.
    :return: None where the object slips out, does not come to rest, or nothing touches it.
    :raises GraspError: an argument is not usable.
    :raises StructureError: see `analyze_grasp`.
    :raises SolverError: see `analyze_grasp`.
    """
    start, arm = complex(*cylinder.center), 0.5 * cylinder.diameter
    analysis: GraspAnalysis | None = None
    before = move = np.zeros(2)
    slope = -np.eye(2)
    for _ in range(MAX_STEPS):
        analysis = analyze_grasp(
            config, cylinder, friction, external_wrench, spacing=spacing, previous=analysis
        )
        if float(analysis.normal_forces.sum()) < LEAST_FORCE:
            return None
        if analysis.force_closure:
            return Settled(cylinder, analysis)
        left = _unbalanced(analysis, np.asarray(external_wrench, dtype=float), arm)
        along = np.linalg.lstsq(analysis.stiffness, left, rcond=None)[0][:2]
        if move.any():
            slope = slope + np.outer(along - before - slope @ move, move) / (move @ move)
        move, before = np.linalg.lstsq(slope, -along, rcond=None)[0], along
        if move @ along <= 0.0:  # never against what pushes
            slope, move = -np.eye(2), along
        size, longest = float(np.linalg.norm(move)), MAX_STEP * cylinder.diameter
        if size == 0.0:
            return None
        move = move * min(1.0, longest / size)
        center = complex(*cylinder.center) + complex(*move)
        if abs(center - start) > MAX_WAY * cylinder.diameter:
            return None
        cylinder = replace(cylinder, center=(center.real, center.imag))
    return None


def _unbalanced(analysis: GraspAnalysis, external_wrench: Array, arm: float) -> Array:
    """Return the wrench on the object (fx, fy, m) that friction leaves [N, N m]."""
    tangents = np.column_stack([-analysis.normals[:, 1], analysis.normals[:, 0]])
    friction = np.append(analysis.friction_forces @ tangents, arm * analysis.friction_forces.sum())
    return analysis.normal_wrench + external_wrench + friction
