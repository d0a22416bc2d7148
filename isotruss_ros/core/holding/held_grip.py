# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Equilibria of convex objects held by members: of n samples, and one of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import enum
import functools
import math
from typing import Any, ClassVar, NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.contacts import (
    ContactForces,
    ContactPatches,
    find_patches,
    PressedContacts,
)
from isotruss_ros.core.holding.equations import (
    Grasps,
    History,
    Linear,
    linearize_grasps,
    Pushes,
)
from isotruss_ros.core.holding.grip_response import (
    find_response,
    GripResponse,
    open_grips,
    respond,
    slip_planes,
)
from isotruss_ros.core.holding.newton import are_on_members, Iterate, linearize_at
from isotruss_ros.core.holding.overlaps import (
    find_depths_in_others,
    find_free_corners,
    FreeCorner,
    HeldObjects,
)
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import BentParts
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.samples import take
from isotruss_ros.core.statics.bent_tubes import BentState, BentTubes, CenterLines, Motion
from isotruss_ros.core.statics.structure import structures_under
from isotruss_ros.core.statics.wrinkling import find_utilisation, Utilisation
import numpy as np

#: Number of points on each bent centre line, ends and a contact included [-]. The chords of a line
#: that is 40 mm off its straight place are within 0.3 mm of it.
LINE_POINTS = 15
#: Largest multiple of the previous change that is extrapolated [-].
MAX_EXTRAPOLATION = 2.0
#: Smallest slip margin of a moving object, relative to the squeeze [-]. It covers the error of the
#: required friction, 1.4 % against MuJoCo. Of 20 random boxes that were moved in MuJoCo without
#: this bound, a third of it admits two that slid by some millimetres, and three times of it
#: refuses five that did not slide.
MIN_RELATIVE_MARGIN = 0.01


class HoldStatus(enum.Enum):
    """Hold status: the object is held, or a condition for holding the object is violated."""

    HELD = 'held'
    NO_CONTACT = 'fewer than two members press on the object'
    NO_BALANCE = 'no pose near the given one balances the forces'
    FAR = 'the pose that balances the forces is too far from the given one'
    SLIPS = 'the equilibrium needs a larger coefficient of friction than the given one'
    UNSTABLE = 'the equilibrium is unstable'
    OFF_MEMBER = 'a contact is beyond the end of its member'
    OTHER_CONTACT = 'another member presses on the object'
    SEARCHED = 'the search for an equilibrium goes on in the next cycle'
    WRINKLES = 'a tube wrinkles, outside of the model'

    @property
    def at_rest(self) -> bool:
        """Return whether the object is at rest according to the model, even if a tube wrinkles."""
        return self in (HoldStatus.HELD, HoldStatus.WRINKLES)


class NotHeldError(GraspError):
    """Error: the members do not hold the object; `hold` is the violated condition."""

    def __init__(self, hold: HoldStatus) -> None:
        super().__init__(hold.value)
        self.hold = hold


class GraspInputs(NamedTuple):
    """First arguments of `attach_grip`."""

    config: Configuration  #: configuration of the robot
    body: ConvexObject  #: the object at its measured pose
    members: Indices | None  #: indices (m,) of the grasping members; None: not given
    wrench: Array  #: external wrench (fx, fy, m) on the object [N, N m]
    pressures: tuple[float, ...]  #: gauge pressure of each tube [Pa]
    stiffness: float = 1.0  #: factor on EA, EI and GA of the tubes [-]


@dataclass(frozen=True, eq=False)
class Equilibria:
    """Equilibria of n objects with the same contacts and one layout of the tubes."""

    shared: ClassVar[tuple[str, ...]] = ()
    g: Grasps  #: constants of the grasps
    iterate: Iterate  #: unknowns, and bent tubes
    #: equations before the last step of Newton's method; None: linearised when they are read
    tangent: Linear | None = None
    #: response to wrenches and utilisation of the tubes; None: found when they are read
    verdict: tuple[GripResponse, Utilisation] | None = None

    def __reduce__(self) -> tuple[Callable[..., Equilibria], tuple[Any, ...]]:
        """Return the numbers of the equilibria for pickling; equations follow from them."""
        g, about = self.g, None
        if self.tangent is not None:
            tubes = self.tangent.tubes
            about = self.tangent.unknowns, tubes.state, tubes.loads, tubes.received
        config: Any = g.structure.config
        structure = config.configs, g.structure.pressures, g.structure.stiffness
        constants = g.bodies.objects, g.contacts, g.wrench, g.grazing, g.history
        return _restore, (structure, constants, self.iterate, about, self.verdict)

    def judged(self, keeps_tangent: bool) -> Equilibria:
        """Return the equilibria with their verdict, with linearised tubes or without."""
        tangent = self.tangent if keeps_tangent else None
        return Equilibria(self.g, self.iterate, tangent, (self.response, self.sections))

    @functools.cached_property
    def linear(self) -> Linear:
        """Return the linearised equations."""
        return linearize_at(self.g, self.iterate) if self.tangent is None else self.tangent

    @functools.cached_property
    def bodies(self) -> ObjectSamples:
        """Return the objects at their poses in equilibrium."""
        return self.g.bodies.moved_to(self.iterate.unknowns[:, :3])

    @functools.cached_property
    def pushes(self) -> Pushes:
        """Return the loads of the contacts on the tubes."""
        return Pushes.of(self.g, self.iterate.unknowns)

    @functools.cached_property
    def normals(self) -> Points:
        """Return the unit normals from the objects toward the tubes, (n, k)."""
        inclinations = self.iterate.unknowns[:, self.g.places.inclinations]
        return self.g.straight_normals * np.exp(1j * inclinations)

    @functools.cached_property
    def history(self) -> History:
        """Return rolling invariants and angles, from which the contacts roll on."""
        unknowns = self.iterate.unknowns
        angles = self.g.find_angles(unknowns, self.normals)
        if self.g.history is not None and not self.g.history.frictionless:
            return History(self.g.history.anchors, angles)
        anchors = self.g.find_anchors(unknowns, self.normals)
        if self.g.history is not None:
            old = np.ones(anchors.shape[-1], dtype=bool)
            old[list(self.g.history.frictionless)] = False
            anchors = np.where(old, self.g.history.anchors, anchors)
        return History(anchors, angles)

    @functools.cached_property
    def normal_forces(self) -> Array:
        """Return the normal forces of the grasping members, (n, m) [N]."""
        forces = self.iterate.unknowns[:, self.g.places.normal]
        return self.g.contacts.sum_by_member(forces, axis=-1)

    @functools.cached_property
    def friction_forces(self) -> Array:
        """Return the friction force on each grasping member, (n, m), counter-clockwise [N]."""
        forces = self.iterate.unknowns[:, self.g.places.friction]
        return self.g.contacts.sum_by_member(forces, axis=-1)

    @functools.cached_property
    def required_friction(self) -> Array:
        """Return the smallest coefficients of friction (n,) at which no member slips."""
        with np.errstate(divide='ignore', invalid='ignore'):
            return (np.abs(self.friction_forces) / self.normal_forces).max(axis=-1)

    @functools.cached_property
    def are_on_members(self) -> Flags:
        """Return whether all contacts (n,) are between the ends of their members."""
        return are_on_members(self.g, self.iterate.unknowns)

    @functools.cached_property
    def center_lines(self) -> CenterLines:
        """Return the bent centre lines of the tubes."""
        return CenterLines.of(self.linear.tubes, self._change)

    @functools.cached_property
    def end_forces(self) -> tuple[Array, Array]:
        """Return end forces and axial forces of the tubes, see `BentTubes.end_forces`."""
        return self.linear.tubes.end_forces(self._change)

    @functools.cached_property
    def _change(self) -> Motion:
        """Return the change of the tubes since they were linearised."""
        feet = self.iterate.unknowns[:, self.g.places.feet]
        return self.linear.tubes.move(self.pushes.loads, feet)

    @functools.cached_property
    def sections(self) -> Utilisation:
        """Return the utilisation of the tubes under the contact forces."""
        if self.verdict is not None:
            return self.verdict[1]
        frame = self.linear.tubes.tangent.frame
        return find_utilisation(self.g.structure, frame, *self.end_forces)

    @functools.cached_property
    def response(self) -> GripResponse:
        """Return the objects' linear response to wrenches."""
        if self.verdict is not None:
            return self.verdict[0]
        return find_response(self.g, self.iterate.unknowns, self.linear, self.bodies, self.normals)

    @functools.cached_property
    def shifts(self) -> Array:
        """Return the distances (n,) of the centroids from their measured positions [m]."""
        return np.abs(self.bodies.middle - self.g.bodies.middle)

    @functools.cached_property
    def free_corners(self) -> list[list[FreeCorner]]:
        """Return the corners of each object that are near grasping members without contact."""
        return find_free_corners(self._objects, lambda: self.center_lines)

    @functools.cached_property
    def depths_in_others(self) -> tuple[Indices, Array]:
        """Return other members near the objects, and depths in them [m]."""
        return find_depths_in_others(self._objects, lambda: self.center_lines)

    @property
    def _objects(self) -> HeldObjects:
        return HeldObjects(self.g, self.bodies, self.normals)


@dataclass(frozen=True, eq=False)
class HeldGrip:
    """
    Equilibrium of a convex object between two or three members, with its rolling invariants.

    `attach_grip` finds the equilibrium near a measured pose; `roll_grip` finds it in another
    configuration, to which the contacts have rolled.
    """

    samples: Equilibria  #: equilibria of which this is one
    number: int = 0  #: its index among them
    #: changes of roller travel (r,) [m] and unknowns (3 + 4k,) since the previous configuration
    motion: tuple[Array, Array] | None = None

    @functools.cached_property
    def alone(self) -> Equilibria:
        """Return this equilibrium as the only sample."""
        if len(self.samples.iterate.unknowns) == 1:
            return self.samples
        return take(self.samples, np.array([self.number]))

    def with_anchors(self, anchors: Array, motion: tuple[Array, Array] | None = None) -> HeldGrip:
        """Return this equilibrium with contacts that roll on from other invariants (k,) [m]."""
        one = self.alone
        history = History(anchors[None], one.history.angles)
        changed = Equilibria(one.g._replace(history=history), one.iterate, one.linear, one.verdict)
        return HeldGrip(changed, motion=self.motion if motion is None else motion)

    @property
    def config(self) -> Configuration:
        """Return the configuration of the robot."""
        config: Any = self.samples.g.structure.config
        return config.configs[self.number]

    @property
    def pressures(self) -> tuple[float, ...]:
        """Return the gauge pressure of each tube, (t,) [Pa]."""
        return tuple(self.samples.g.structure.pressures[self.number].tolist())

    @property
    def stiffness(self) -> float:
        """Return the factor on EA, EI and GA of the tubes [-]."""
        return float(self.samples.g.structure.stiffness[self.number])

    @property
    def wrench(self) -> Array:
        """Return the wrench on the object, fx, fy and m / arm, see `ConvexObject.arm` [N]."""
        return self.samples.g.wrench[self.number]

    @property
    def measured(self) -> ConvexObject:
        """Return the object at its measured pose."""
        return self.samples.g.bodies.objects[self.number]

    @property
    def inputs(self) -> GraspInputs:
        """Return the inputs of which this is the equilibrium, if the contacts have not rolled."""
        wrench = self.wrench * (1.0, 1.0, self.arm)
        body = self.measured
        return GraspInputs(self.config, body, self.members, wrench, self.pressures, self.stiffness)

    @property
    def contacts(self) -> PressedContacts:
        """Return the k contacts of the object."""
        return self.samples.g.contacts

    @property
    def shape(self) -> Shape:
        """Return the shape of the object."""
        return self.measured.shape

    @property
    def unknowns(self) -> Array:
        """Return the unknowns, (3 + 4k,), see `ContactForces`."""
        return self.samples.iterate.unknowns[self.number]

    @functools.cached_property
    def state(self) -> ContactForces:
        """Return pose, contacts and forces of the object."""
        samples, i = self.samples, self.number
        loads = samples.pushes.loads[i].reshape(-1, 3)
        jacobian = samples.linear.jacobian[i]
        return ContactForces(samples.iterate.unknowns[i], samples.normals[i], loads, jacobian)

    def displaced(self, change: Array) -> HeldGrip:
        """Return the grip with unknowns changed by (3 + 4k,), at which an iteration may begin."""
        one = self.alone
        at = one.iterate._replace(unknowns=one.iterate.unknowns + change)
        return HeldGrip(Equilibria(one.g, at, one.tangent), motion=self.motion)

    @property
    def rolling_rows(self) -> Array:
        """Return the derivatives (k, 3 + 4k) of the rolling invariants by the unknowns."""
        return self.samples.g.rolling_rows(self.samples.linear.radii)[self.number]

    @property
    def anchor_rates(self) -> Array:
        """Return the derivatives (k, r) of the rolling invariants by roller travel."""
        return self.samples.g.anchor_rates[self.number]

    @property
    def anchors(self) -> Array:
        """Return the rolling invariants (k,), see `Grasps.find_anchors` [m]."""
        return self.samples.history.anchors[self.number]

    @property
    def angles(self) -> Array:
        """Return the angles of the normals in the object, (k,), continued beyond pi [rad]."""
        return self.samples.history.angles[self.number]

    @functools.cached_property
    def body(self) -> ConvexObject:
        """Return the object at its pose in equilibrium."""
        x, y, angle = self.unknowns[:3].tolist()
        return self.measured.moved_to((x, y, math.remainder(angle, 2.0 * math.pi)))

    @property
    def pose(self) -> Pose:
        """Return the object's pose; the angle is in [-pi, pi]."""
        return self.body.pose

    @property
    def arm(self) -> float:
        """Return the characteristic radius, see `ConvexObject.arm` [m]."""
        return self.measured.arm

    @functools.cached_property
    def members(self) -> Indices:
        """Return the indices (m,) of the grasping members."""
        return self.contacts.members[self.contacts.member_starts]

    @functools.cached_property
    def member_names(self) -> tuple[str, ...]:
        """Return the names of the grasping members."""
        return tuple(self.config.robot.member_names[i] for i in self.members)

    @property
    def free_corners(self) -> list[FreeCorner]:
        """Return the corners that are near grasping members without contact."""
        return self.samples.free_corners[self.number]

    def touching(self, friction: float) -> Grip:
        """Return the contacts of this equilibrium as a `Grip`, with the bent robot."""
        grip = Grip(self.member_names, self.body, friction, bent=self.bent_parts)
        return grip.touching(self.contacts.owners, self.contacts.corners)

    @property
    def normal_forces(self) -> Array:
        """Return the normal forces of the grasping members, (m,) [N]."""
        return self.samples.normal_forces[self.number]

    @property
    def friction_forces(self) -> Array:
        """Return the friction force on each grasping member, (m,), counter-clockwise [N]."""
        return self.samples.friction_forces[self.number]

    @functools.cached_property
    def squeeze(self) -> float:
        """Return the mean normal force of the grasping members [N]."""
        return float(self.normal_forces.mean())

    @property
    def required_friction(self) -> float:
        """Return the smallest coefficient of friction at which no member slips."""
        return float(self.samples.required_friction[self.number])

    def hold(self, friction: float) -> HoldStatus:
        """Return the object's hold status for a given coefficient of friction."""
        if self.normal_forces.min() <= 0.0:
            return HoldStatus.NO_CONTACT
        if not self.samples.are_on_members[self.number]:
            return HoldStatus.OFF_MEMBER
        return HoldStatus.SLIPS if self.required_friction > friction else HoldStatus.HELD

    @functools.cached_property
    def response(self) -> GripResponse | None:
        """Return the object's linear response to a wrench; None if the equilibrium is neutral."""
        response = take(self.samples.response, self.number)
        return None if response.is_neutral else response

    def slip_margin(self, friction: float) -> float:
        """Return the slip margin, see `SlipPlanes` [N]; zero in a neutral equilibrium."""
        return 0.0 if self.response is None else float(slip_planes(self.response, friction).margin)

    @property
    def displacements(self) -> Array:
        """Return ux, uy [m] and theta [rad] of the nodes of the bent frame, (n, 3)."""
        return self.samples.center_lines.displacements[self.number]

    def bent_lines(self, members: Indices, positions: Array) -> tuple[Points, Points]:
        """Return points (c,) of bent centre lines [m], and their rotations exp(i theta)."""
        points, rotations = self.alone.center_lines.at(members, positions[None])
        return points[0], rotations[0]

    @functools.cached_property
    def bent_parts(self) -> BentParts:
        """Return the displacements of the robot's parts by the contact forces."""
        config, topology = self.config, self.config.robot.topology
        positions, lines = self.member_lines()
        starts = config.points[topology.b, None]
        members = lines - starts - positions * config.member_axes[:, None]
        middles = 0.5 * (members[:, 0] + members[topology.previous, -1])
        joints = self.displacements[topology.joint]
        along, of_joints = np.linspace(0.0, 1.0, LINE_POINTS), joints[:, 0] + 1j * joints[:, 1]
        modules = np.repeat(middles[:, None], LINE_POINTS, axis=1)
        rods = of_joints[:, None] + along * (middles - of_joints)[:, None]
        ends = np.broadcast_to(along, positions.shape)
        shares = np.concatenate([positions / config.member_lengths[:, None], ends, ends])
        return BentParts(shares, np.concatenate([members, modules, rods]))

    def member_lines(self) -> tuple[Array, Points]:
        """Return s positions (m, s) on each member and the bent centre lines (m, s) there [m]."""
        length = self.config.member_lengths[:, None]
        positions = length * np.linspace(0.0, 1.0, LINE_POINTS)
        # A centre line has its kinks at the contacts.
        for member, foot in zip(self.contacts.members, self.state.feet, strict=True):
            inner = np.abs(positions[member, 1:-1] - foot)
            positions[member, 1 + int(inner.argmin())] = np.clip(foot, 0.0, length[member, 0])
        members = np.repeat(np.arange(len(positions)), LINE_POINTS)
        return positions, self.bent_lines(members, positions.ravel())[0].reshape(positions.shape)

    @property
    def end_forces(self) -> tuple[Array, Array]:
        """Return end forces and axial forces of the tubes, see `BentTubes.end_forces`."""
        return take(self.samples.end_forces, self.number)

    @functools.cached_property
    def sections(self) -> Utilisation:
        """Return the utilisation of the tubes under the contact forces."""
        return take(self.samples.sections, self.number)

    @functools.cached_property
    def patches(self) -> ContactPatches:
        """Return the contact patches on the grasping members."""
        return self.patches_under(self.state.normal_forces)

    def patches_under(self, normal_forces: Array) -> ContactPatches:
        """Return the contact patches on the bent tubes under normal forces (k,) on the skins."""
        samples, i = self.samples, self.number
        skins = samples.g.dents.take_samples(i).press(normal_forces, self.angles)
        tubes = samples.linear.tubes
        layout, directions = tubes.tangent.frame.layout, tubes.cuts.directions[i]
        gauge = samples.g.structure.pressures[i]
        return find_patches(
            self.contacts,
            self.state,
            self.config,
            gauge,
            layout,
            directions,
            self.end_forces,
            skins,
        )

    @functools.cached_property
    def nonlinearity(self) -> float:
        """Return the relative increase of the contact forces by the bending of the tubes [-]."""
        one = self.alone
        g, loads = one.g, one.pushes.loads
        feet = one.iterate.unknowns[:, g.places.feet]
        straight = BentState.straight(g.structure, feet, True)
        none = np.zeros(loads.shape)
        linear = BentTubes.of(g.structure, g.contacts.members, g.lines, straight, none)
        # Linear tubes would leave gaps, which changes of forces and pose close.
        residual = np.zeros(g.places.size)
        both = one.linear.tubes.respond(loads, feet), linear.respond(loads, feet)
        gaps = (both[0] - both[1])[..., :3]
        residual[: gaps.size] = gaps.ravel()
        try:
            change = np.linalg.solve(one.linear.jacobian[0], residual)
        except np.linalg.LinAlgError:
            return 0.0
        surplus = float(change[g.places.normal].sum())
        return -surplus / float(self.state.normal_forces.sum())

    def respond(self, residuals: Array) -> Array | None:
        """Return the unknowns' changes that cancel residuals (3 + 4k, ...); None if neutral."""
        one = self.alone
        columns = residuals.reshape(1, len(residuals), -1)
        rows = one.g.rolling_rows(one.linear.radii)
        changes = respond(one.g, one.iterate.unknowns, one.linear, rows, columns)
        return None if np.isnan(changes).any() else changes.reshape(residuals.shape)

    def squeeze_stiffness(self) -> float:
        """
        Return the derivative of the squeeze by the members' opening, negative [N/m].

        For two members the opening is the distance between their contacts. For three members it is
        twice the displacement of each member away from the object.
        """
        if self.response is None:
            return -0.0
        one = self.alone
        changes = self.respond(open_grips(one.g, one.iterate.unknowns, one.normals)[0])
        return float(changes[one.g.places.normal].sum()) / len(self.members)

    def sample_dents_ahead(self) -> None:
        """Compute the samples of dents that contacts need when they roll on."""
        self.samples.g.dents.take_samples(self.number).sample_ahead(self.angles)

    def extrapolate(self, travel: Array) -> Array:
        """Return the unknowns (3 + 4k,) predicted after additional roller travel (r,) [m]."""
        if self.motion is None:
            return self.unknowns
        previous_travel, change = self.motion
        square = float(previous_travel @ previous_travel)
        if square == 0.0:
            return self.unknowns
        # Multiple of the previous motion, bounded: a much shorter motion predicts nothing.
        multiple = float(travel @ previous_travel) / square
        multiple = max(-MAX_EXTRAPOLATION, min(multiple, MAX_EXTRAPOLATION))
        return self.unknowns + multiple * change


def _restore(
    structure: tuple[Sequence[Configuration], Array, Array],
    constants: tuple[Any, ...],
    iterate: Iterate,
    about: tuple[Any, ...] | None,
    verdict: tuple[GripResponse, Utilisation] | None,
) -> Equilibria:
    """Return pickled equilibria, see `Equilibria.__reduce__`."""
    (configs, pressures, stiffness), (bodies, contacts, wrench, grazing, history) = (
        structure,
        constants,
    )
    tubes = structures_under(configs, list(map(tuple, pressures.tolist())), stiffness.tolist())
    g = Grasps.of(tubes, ObjectSamples(bodies), contacts, wrench, grazing, history)
    tangent = None
    if about is not None:
        unknowns, state, loads, received = about
        bent = BentTubes.of(tubes, contacts.members, g.lines, state, loads, received)
        tangent = linearize_grasps(g, unknowns, bent, Pushes.of(g, unknowns))
    return Equilibria(g, iterate, tangent, verdict)


def scaled_wrench(wrench: Array | None, arm: float) -> Array:
    """Return a wrench with its moment divided by the characteristic radius [N]."""
    return np.zeros(3) if wrench is None else np.asarray(wrench) / (1.0, 1.0, arm)
