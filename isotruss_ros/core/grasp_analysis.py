"""The statics of a grasp: contact forces, force closure and stiffness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from isotruss_ros.core.arrays import circle, finite_array, pairs
from isotruss_ros.core.candidates import Candidates, find_candidates
from isotruss_ros.core.closure import close
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.contact import ContactState, solve_contact
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.gas import raised_pressure
from isotruss_ros.core.relaxation import relax_contact
from isotruss_ros.core.structure import Structure
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Candidates closer than this are one point to the tube, further apart they miss the object.
SPACINGS = (1e-4, 0.1)


@dataclass(frozen=True)
class Cylinder:
    """
    An object with a circular cross-section.

    :ivar center: (x, y) in the robot frame [m].
    :ivar diameter: its own diameter d [m].
    :raises GraspError: the centre is not two finite numbers, or the diameter not positive.
    """

    center: tuple[float, float]
    diameter: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        center, diameter = circle(self.center, self.diameter)
        object.__setattr__(self, 'center', center)
        object.__setattr__(self, 'diameter', diameter)


@dataclass(frozen=True, eq=False)
class GraspAnalysis:
    """
    What holds an object, and how well; k candidate points.

    :ivar points: (k, 2) candidates on the deformed centre lines of the tubes, robot frame [m].
    :ivar gaps: (k,) distance of the tube's skin from the object there, not negative [m].
    :ivar normals: (k, 2) unit normals of the object's surface, outward: toward the tube.
    :ivar normal_forces: (k,) pressing tube and object apart, not negative [N].
    :ivar friction_forces: (k,) on the object, along the tangent, counter-clockwise [N].
    :ivar normal_wrench: (fx, fy, m) of the normal forces on the object about its centre [N, N m].
    :ivar force_closure: whether the object is touched, and friction balances normal forces and
        external wrench.
    :ivar closure_residual: what friction leaves, moments over d/2 [N].
    :ivar closure_tolerance: below which the residual counts as none [N].
    :ivar required_friction: smallest coefficient that closes; infinite if none does.
    :ivar closure_margin: largest extra wrench of any direction that friction still balances,
        moments over d/2 [N]; negative where the grasp is open.
    :ivar contact_lengths: length of tube in contact by member, of those in contact [m].
    :ivar contact_forces: sum of the normal forces by member, of those in contact [N].
    :ivar pressures: gauge pressure by tube, raised by the object where `gas` is asked for [Pa].
    :ivar stiffness: (3, 3) wrench (fx, fy, m) that a displacement (dx, dy, dtheta) of the object
        with all its contact points takes [N/m, N, N m].
    """

    points: Array
    gaps: Array
    normals: Array
    normal_forces: Array
    friction_forces: Array
    normal_wrench: Array
    force_closure: bool
    closure_residual: float
    closure_tolerance: float
    required_friction: float
    closure_margin: float
    contact_lengths: dict[str, float]
    contact_forces: dict[str, float]
    pressures: dict[str, float]
    stiffness: Array


def analyze_grasp(
    config: Configuration,
    cylinder: Cylinder,
    friction: float = 0.5,
    external_wrench: ArrayLike = (0.0, 0.0, 0.0),
    method: Literal['exact', 'relaxation'] = 'exact',
    spacing: float = 0.005,
    gas: bool = False,
    previous: GraspAnalysis | None = None,
) -> GraspAnalysis:
    """
    Analyse a grasp: contact (5) to (9), force closure (10), grasp stiffness.

    :param config: where the robot is; its rollers do not turn.
    :param cylinder: the object, in its place.
    :param friction: coefficient between tube and object, not negative.
    :param external_wrench: (fx, fy, m) on the object about its centre [N, N m].
    :param method: 'exact' (complementarity by pivoting) or 'relaxation' (the paper's (9)).
    :param spacing: of the candidate points along the tubes [m].
    :param previous: analysis of a similar grasp, where the search for the contact begins. Where
        a deep indentation has several equilibria, it decides which one is found.
    :param gas: whether the object raises the pressure of the tubes that it indents.
    :raises GraspError: an argument is not usable.
    :raises StructureError: the robot is a mechanism, or its stiffness laws are contradictory.
    :raises SolverError: the contact problem was not solved.
    """
    mu, gap = finite_array([friction, spacing], 2, 'friction and spacing [m]', GraspError)
    if mu < 0.0:
        raise GraspError(f'friction {friction!r}: must not be negative')
    if not SPACINGS[0] <= gap <= SPACINGS[1]:
        raise GraspError(f'spacing {spacing!r} m: must be from {SPACINGS[0]} to {SPACINGS[1]} m')
    wrench = finite_array(external_wrench, 3, 'the external wrench (fx, fy, m)', GraspError)
    solvers = {'exact': solve_contact, 'relaxation': relax_contact}
    if method not in solvers:
        raise GraspError(f'method {method!r}: must be one of {", ".join(solvers)}')
    center, arm = complex(*cylinder.center), 0.5 * cylinder.diameter
    radius = arm + 0.5 * config.robot.description.tube_diameter
    candidates = find_candidates(config.structure, center, radius, gap)
    pressure = np.full(len(config.robot.layout.tube_names), config.robot.description.pressure)
    if gas:
        pressure = raised_pressure(config, candidates, center, radius)
        structure = Structure(config, pressure[config.robot.layout.tube])
        candidates = find_candidates(structure, center, radius, gap)
    start = None
    if previous is not None and len(previous.normal_forces) == len(candidates.points):
        start = previous.normal_forces
    contact = solvers[method](candidates, center, radius, start)
    normals = pairs(contact.normals)
    pressed = -contact.forces @ normals
    tangents = pairs(1j * contact.normals)
    load = np.array([pressed[0] + wrench[0], pressed[1] + wrench[1], wrench[2] / arm])
    closure = close(tangents, contact.forces, load, float(mu))
    moved = candidates.points + contact.displacements
    return GraspAnalysis(
        points=pairs(moved),
        gaps=contact.gaps,
        normals=normals,
        normal_forces=contact.forces,
        friction_forces=closure.friction_forces,
        normal_wrench=np.array([pressed[0], pressed[1], 0.0]),
        # Without a touch all is in balance, but nothing is held.
        force_closure=closure.closed and bool((contact.forces > 0.0).any()),
        closure_residual=closure.residual,
        closure_tolerance=closure.tolerance,
        required_friction=closure.required_friction,
        closure_margin=closure.margin,
        contact_lengths=_by_member(config, candidates, contact, candidates.spacing),
        contact_forces=_by_member(config, candidates, contact, contact.forces),
        pressures=dict(zip(config.robot.layout.tube_names, pressure.tolist(), strict=True)),
        stiffness=_stiffness(candidates, contact, center),
    )


def _by_member(
    config: Configuration, candidates: Candidates, contact: ContactState, parts: ArrayLike
) -> dict[str, float]:
    """Return sums over the candidates in contact, by member, of those in contact."""
    names, m = config.robot.member_names, config.robot.layout.n_modules
    touching = contact.forces > 0.0
    parts = np.broadcast_to(parts, touching.shape)
    sums = np.bincount(candidates.member[touching], parts[touching], m)
    return {names[i]: float(sums[i]) for i in np.flatnonzero(sums)}


def _stiffness(candidates: Candidates, contact: ContactState, center: complex) -> Array:
    """Return the wrench that a small motion of the object with its contact points takes."""
    touching = np.flatnonzero(contact.forces > 0.0)
    if len(touching) == 0:
        return np.zeros((3, 3))
    compliance = candidates[touching].compliance
    size = 2 * len(touching)
    arms = (candidates.points + contact.displacements)[touching] - center
    motion = np.zeros((len(touching), 2, 3))
    motion[:, 0, 0] = motion[:, 1, 1] = 1.0
    motion[:, 0, 2], motion[:, 1, 2] = -arms.imag, arms.real
    motion = motion.reshape(size, 3)
    stiffness = motion.T @ np.linalg.solve(compliance.reshape(size, size), motion)
    return 0.5 * (stiffness + stiffness.T)
