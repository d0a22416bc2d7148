"""Where a grasped object comes to rest: normal forces alone balance the external wrench."""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core.arrays import finite_array, pairs
from isotruss_ros.core.candidates import Candidates, find_candidates
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.contact import ContactState, solve_contact
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.grasp_analysis import Cylinder
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MAX_STEPS = 100
#: At rest when the forces balance to this share of those that press.
TOLERANCE = 1e-9
#: No step is longer than this share of the object's diameter, and no search than the diameter.
MAX_STEP = 0.1


@dataclass(frozen=True)
class RestingPose:
    """
    A place where an object rests without friction.

    :ivar cylinder: the object in this place.
    :ivar stable: whether a small push away from it is answered by a force back.
    :ivar stiffness: smallest stiffness against moving away without friction [N/m].
    """

    cylinder: Cylinder
    stable: bool
    stiffness: float


def find_resting_pose(
    config: Configuration,
    cylinder: Cylinder,
    external_wrench: ArrayLike = (0.0, 0.0, 0.0),
    spacing: float = 0.005,
) -> RestingPose | None:
    """
    Find the place near a cylinder's where normal forces balance the external wrench.

    Normal forces have no moment about the centre, so that a wrench with one has no such place.

    :param external_wrench: (fx, fy, m) on the object [N, N m].
    :param spacing: see `analyze_grasp`.
    :return: None if there is none within a diameter, or none that keeps two sides in touch.
    :raises GraspError: the wrench is not three finite numbers.
    """
    wrench = finite_array(external_wrench, 3, 'the external wrench (fx, fy, m)', GraspError)
    if wrench[2] != 0.0:
        return None
    radius = 0.5 * (cylinder.diameter + config.robot.description.tube_diameter)
    start = center = complex(*cylinder.center)
    for _ in range(MAX_STEPS):
        candidates = find_candidates(config.structure, center, radius, spacing)
        contact = solve_contact(candidates, center, radius)
        pressing = float(contact.forces.sum())
        if pressing == 0.0 or abs(center - start) > cylinder.diameter:
            return None
        force = wrench[:2] - contact.forces @ pairs(contact.normals)
        tangent = _tangent(candidates, contact, radius)
        if np.linalg.norm(force) <= TOLERANCE * pressing:
            stiffness = float(np.linalg.eigvalsh(0.5 * (tangent + tangent.T)).min())
            place = (center.real, center.imag)
            return RestingPose(replace(cylinder, center=place), stiffness > 0.0, stiffness)
        step = complex(*np.linalg.lstsq(tangent, force, rcond=None)[0])
        longest = MAX_STEP * cylinder.diameter
        center += step * min(1.0, longest / abs(step))
    return None


def _tangent(candidates: Candidates, contact: ContactState, radius: float) -> Array:
    """
    Return how the normal forces on the object resist its motion, (2, 2) [N/m].

    Points in contact stay on the disc: they move with it along their normals, and turn these by
    what they slide along it.
    """
    places = np.flatnonzero(contact.forces > 0.0)
    touching, forces = candidates[places], contact.forces[places]
    normals = pairs(contact.normals[places])
    slides = pairs(1j * contact.normals[places])
    size = 2 * len(places)
    compliance = touching.compliance.reshape(size, size)
    # Unknowns: displacements u of the points for a motion c of the object, and change f of forces:
    # n u = n c;  u = C (f n + N dn),  dn = t t (u - c) / radius.
    turn = np.zeros((size, size))
    normal = np.zeros((size, len(places)))
    for axis in (0, 1):
        normal[axis::2][np.arange(len(places)), np.arange(len(places))] = normals[:, axis]
        for other in (0, 1):
            turn[axis::2, other::2] = np.diag(forces * slides[:, axis] * slides[:, other]) / radius
    motion = np.tile(np.eye(2), (len(places), 1))
    system = np.block(
        [
            [np.eye(size) - compliance @ turn, -compliance @ normal],
            [normal.T, np.zeros((len(places), len(places)))],
        ]
    )
    right = np.vstack([-compliance @ turn @ motion, normal.T @ motion])
    solution = np.linalg.solve(system, right)
    moved, changed = solution[:size], solution[size:]
    return motion.T @ (normal @ changed + turn @ (moved - motion))
