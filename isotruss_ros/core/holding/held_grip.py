# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Equilibrium of a convex object held by members in one configuration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
import enum
import functools
import math
from typing import Any, ClassVar, NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.build_statics import statics_of
from isotruss_ros.core.holding.contact_patches import ContactPatches, find_patches
from isotruss_ros.core.holding.contact_statics import ContactStatics, object_angles
from isotruss_ros.core.holding.grip_response import (
    find_response,
    GripResponse,
    respond,
    slip_planes,
)
from isotruss_ros.core.holding.pressed_contacts import ContactForces, PressedContacts
from isotruss_ros.core.holding.rolling_invariants import find_anchors
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import BentParts
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.samples import plain, take
from isotruss_ros.core.statics.bent_tubes import BentState, BentTubes
from isotruss_ros.core.statics.load_points import Cuts, Lines
from isotruss_ros.core.statics.structure import ConfigurationSamples, structure_under
from isotruss_ros.core.statics.wrinkling import find_utilisation, Utilisation
import numpy as np
from scipy.linalg import lapack

#: Largest distance between an equilibrium and the measured pose, and largest gap of a member that
#: a motion may close, in tube diameters [-].
MAX_DISPLACEMENT = 0.25
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


#: Values of an equilibrium that are kept with it, if they were found.
FOUND = 'displacements', 'end_forces', 'friction_forces', 'normal_forces', 'response', 'sections'


class _OfSamples(functools.cached_property[Any]):
    """Cached property of a grip, which is taken from several samples if they have it."""

    def __get__(self, grip: Any, owner: type[Any] | None = None) -> Any:
        """Return the value."""
        samples = None if grip is None else vars(grip).get('_samples')
        if samples is None or self.attrname not in vars(samples):
            return super().__get__(grip, owner)
        value = take(vars(samples)[self.attrname], grip.number)
        return vars(grip).setdefault(self.attrname, value)


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
class HeldGrip:
    """
    Equilibrium of a convex object between two or three members, with its rolling invariants.

    `attach_grip` finds the equilibrium near a measured pose; `roll_grip` finds it in another
    configuration, to which the contacts have rolled.

    Equilibria of n samples with the same contacts and one layout of the tubes are one grip, whose
    arrays have the samples as their first axis.
    """

    shared: ClassVar[tuple[str, ...]] = ('member_names', 'members')
    anchors: Array  #: (k,) rolling invariants, see `find_anchors` [m]
    angles: Array  #: (k,) angles of the normals in the object's frame, continued beyond pi [rad]
    statics: ContactStatics  #: equations of equilibrium in this configuration
    state: ContactForces  #: solution of the equations
    wrench: Array  #: wrench (fx, fy, m / arm) on the object, see `ConvexObject.arm` [N]
    #: changes of roller travel (r,) [m] and unknowns (3 + 4k,) since the previous configuration
    motion: tuple[Array, Array] | None = None

    @classmethod
    def of(cls, statics: ContactStatics, state: ContactForces, wrench: Array) -> HeldGrip:
        """Return a grip with a solution of the equations, whose contacts have not rolled yet."""
        grip = cls.__new__(cls)
        grip.__dict__.update(statics=statics, state=state, wrench=wrench, motion=None)
        return grip

    @classmethod
    def sample(cls, samples: HeldGrip, number: int) -> HeldGrip:
        """Return one of several samples, whose arrays are taken when they are read."""
        if samples.wrench.ndim == 1:  # the only one
            return samples
        grip = cls.__new__(cls)
        grip.__dict__.update(_samples=samples, _number=number)
        return grip

    def __getattr__(self, name: str) -> Any:
        """Return a field that has not been read, see `of` and `sample`."""
        if name == 'angles' or name == 'anchors':
            state = self.state
            angles = object_angles(state.unknowns, state.normals)
            anchors = find_anchors(self.statics, state.unknowns, state.normals, angles)
            self.__dict__.update(angles=angles, anchors=anchors)
            return self.__dict__[name]
        if name not in type(self).__dataclass_fields__ or '_samples' not in vars(self):
            raise AttributeError(f'{type(self).__name__} has no attribute {name!r}')
        self.__dict__[name] = take(getattr(self._samples, name), self._number)
        return self.__dict__[name]

    def __reduce__(
        self,
    ) -> tuple[Callable[[StoredEquilibrium], HeldGrip], tuple[StoredEquilibrium]]:
        """Return the numbers of the equilibrium for pickling."""
        return StoredEquilibrium.restore, (StoredEquilibrium.of(self),)

    def without_tangents(self) -> HeldGrip:
        """Return a copy without linearised tubes, with all values of the equilibria."""
        grip = type(self).__new__(type(self))
        statics = replace(self.statics, bent=replace(self.statics.bent))
        grip.__dict__.update(vars(self), statics=statics)
        return grip

    @property
    def config(self) -> Configuration:
        """Return the configuration of the robot."""
        return self.statics.bent.structure.config

    @property
    def structure(self) -> tuple[Configuration, tuple[float, ...], float]:
        """Return configuration, pressures of the tubes [Pa], and factor on their stiffness."""
        structure: Any = self.origin.statics.bent.structure
        if not isinstance(structure.config, ConfigurationSamples):
            return structure.config, structure.pressures, structure.stiffness
        i = self.number
        pressures, stiffness = structure.pressures[i].tolist(), float(structure.stiffness[i])
        return structure.config.configs[i], tuple(pressures), stiffness

    @property
    def inputs(self) -> GraspInputs:
        """Return the inputs of which this is the equilibrium, if the contacts have not rolled."""
        structure, wrench = self.statics.bent.structure, self.wrench * (1.0, 1.0, self.arm)
        return GraspInputs(
            structure.config,
            self.statics.body,
            self.members,
            wrench,
            structure.pressures,
            structure.stiffness,
        )

    @property
    def contacts(self) -> PressedContacts:
        """Return the k contacts of the object."""
        return self.origin.statics.contacts

    @property
    def shape(self) -> Shape:
        """Return the shape of the object."""
        if self.origin is self:
            return self.statics.body.shape
        return self.origin.statics.body.objects[self.number].shape

    @property
    def number(self) -> int:
        """Return the number of this sample in `origin`."""
        return vars(self).get('_number', 0)

    @property
    def origin(self) -> HeldGrip:
        """Return the samples of which this is one, see `sample`; otherwise this grip."""
        return vars(self).get('_samples', self)

    def value_among_samples(self, name: str, find: Callable[[HeldGrip], Any]) -> Any:
        """Return the value of this sample in what `find` returns for all, found at first use."""
        known = vars(self.origin)
        if name not in known:
            known[name] = find(self.origin)
        return known[name][self.number]

    @functools.cached_property
    def body(self) -> ConvexObject:
        """Return the object at its pose in equilibrium."""
        body: Any = self.statics.body
        poses = self.state.unknowns[..., :3]
        if isinstance(body, ObjectSamples):
            return body.moved_to(poses)  # type: ignore[return-value]
        x, y, angle = poses.tolist()
        return body.moved_to((x, y, math.remainder(angle, 2.0 * math.pi)))

    @property
    def pose(self) -> Pose:
        """Return the object's pose; the angle is in [-pi, pi]."""
        return self.body.pose

    @property
    def pressures(self) -> tuple[float, ...]:
        """Return the gauge pressure of each tube, (t,) [Pa]."""
        return self.statics.bent.structure.pressures

    @property
    def arm(self) -> float:
        """Return the characteristic radius, see `ConvexObject.arm` [m]."""
        return self.statics.body.arm

    @functools.cached_property
    def member_names(self) -> tuple[str, ...]:
        """Return the names of the grasping members."""
        return tuple(self.config.robot.member_names[i] for i in self.members)

    def touching(self, friction: float) -> Grip:
        """Return the contacts of this equilibrium as a `Grip`, with the bent robot."""
        grip = Grip(self.member_names, self.body, friction, bent=self.bent_parts)
        return grip.touching(self.contacts.owners, self.contacts.corners)

    @_OfSamples
    def normal_forces(self) -> Array:
        """Return the normal forces of the grasping members, (m,) [N]."""
        return self.contacts.sum_by_member(self.state.normal_forces, axis=-1)

    @_OfSamples
    def friction_forces(self) -> Array:
        """Return the friction force on each grasping member, (m,), counter-clockwise [N]."""
        return self.contacts.sum_by_member(self.state.friction_forces, axis=-1)

    @functools.cached_property
    def squeeze(self) -> float:
        """Return the mean normal force of the grasping members [N]."""
        return plain(self.normal_forces.mean(axis=-1))

    @functools.cached_property
    def required_friction(self) -> float:
        """Return the smallest coefficient of friction at which no member slips."""
        return plain((np.abs(self.friction_forces) / self.normal_forces).max(axis=-1))

    def hold(self, friction: float) -> HoldStatus:
        """Return the object's hold status for a given coefficient of friction."""
        if self.normal_forces.min() <= 0.0:
            return HoldStatus.NO_CONTACT
        if not self.statics.are_on_members(self.state.feet):
            return HoldStatus.OFF_MEMBER
        return HoldStatus.SLIPS if self.required_friction > friction else HoldStatus.HELD

    def slip_margin(self, friction: float) -> float:
        """Return the slip margin, see `SlipPlanes` [N]; zero in a neutral equilibrium."""
        return 0.0 if self.response is None else float(slip_planes(self.response, friction).margin)

    @functools.cached_property
    def members(self) -> Indices:
        """Return the indices (m,) of the grasping members."""
        return self.contacts.members[self.contacts.member_starts]

    @_OfSamples
    def displacements(self) -> Array:
        """Return ux, uy [m] and theta [rad] of the nodes of the bent frame, (n, 3)."""
        return self.statics.bent.displacements(self.state.loads, self.state.feet)

    def bent_lines(self, members: Indices, positions: Array) -> tuple[Points, Points]:
        """Return points (c,) of bent centre lines [m], and their rotations exp(i theta)."""
        bent, config = self.statics.bent, self.config
        pieces, within, _ = bent.structure.locate(members, positions)
        moved = bent.frame.interpolate(self.displacements, pieces, within)
        ux, uy, angles = (moved[..., i] for i in range(3))
        starts = config.points[..., config.robot.topology.b[members]]
        straight = starts + positions * config.member_axes[..., members]
        return straight + (ux + 1j * uy), np.exp(1j * angles)

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

    @_OfSamples
    def end_forces(self) -> tuple[Array, Array]:
        """Return end forces and axial forces of the tubes, see `BentTubes.end_forces`."""
        return self.statics.bent.end_forces(self.state.loads, self.state.feet)

    @_OfSamples
    def sections(self) -> Utilisation:
        """Return the utilisation of the tubes under the contact forces."""
        bent = self.statics.bent
        return find_utilisation(bent.structure, bent.frame, *self.end_forces)

    @functools.cached_property
    def patches(self) -> ContactPatches:
        """Return the contact patches on the grasping members."""
        skins = self.statics.dents.press(self.state.normal_forces, self.angles)
        return find_patches(self.contacts, self.state, self.statics.bent, self.end_forces, skins)

    @functools.cached_property
    def nonlinearity(self) -> float:
        """Return the relative increase of the contact forces by the bending of the tubes [-]."""
        bent, loads, feet = self.statics.bent, self.state.loads, self.state.feet
        straight = BentTubes.of(bent.structure, bent.members, feet)
        # Linear tubes would leave gaps, which changes of forces and pose close.
        gaps = bent.respond(loads, feet) - straight.respond(loads, feet)
        residual = np.zeros(self.state.places.size)
        residual[: gaps.size] = gaps.ravel()
        _, _, change, singular = lapack.dgesv(self.state.jacobian, residual)
        linear_surplus = float(change[self.state.places.normal].sum())
        return 0.0 if singular else -linear_surplus / float(self.state.normal_forces.sum())

    def respond(self, residuals: Array) -> Array | None:
        """Return the unknowns' changes that cancel residuals (3 + 4k, ...); None if neutral."""
        columns = residuals.reshape(len(residuals), -1)
        try:
            return respond(self.statics, self.state, columns).reshape(residuals.shape)
        except np.linalg.LinAlgError:
            return None

    @_OfSamples
    def response(self) -> GripResponse | None:
        """Return the object's linear response to a wrench; None if the equilibrium is neutral."""
        response = find_response(self.statics, self.state, self.body)
        return None if response.is_neutral.ndim == 0 and response.is_neutral else response

    def squeeze_stiffness(self) -> float:
        """
        Return the derivative of the squeeze by the members' opening, negative [N/m].

        For two members the opening is the distance between their contacts. For three members it is
        twice the displacement of each member away from the object.
        """
        if self.response is None:
            return -0.0
        changes = self.response.by_opening[self.state.places.normal]
        return float(changes.sum()) / len(self.members)

    def extrapolate(self, travel: Array) -> Array:
        """Return the unknowns (3 + 4k,) predicted after additional roller travel (r,) [m]."""
        if self.motion is None:
            return self.state.unknowns
        previous_travel, change = self.motion
        square = float(previous_travel @ previous_travel)
        if square == 0.0:
            return self.state.unknowns
        # Multiple of the previous motion, bounded: a much shorter motion predicts nothing.
        multiple = float(travel @ previous_travel) / square
        multiple = max(-MAX_EXTRAPOLATION, min(multiple, MAX_EXTRAPOLATION))
        return self.state.unknowns + multiple * change


class StoredEquilibrium(NamedTuple):
    """Numbers of an equilibrium, from which it is restored as it is."""

    config: Configuration
    pressures: tuple[float, ...]  #: gauge pressure of each tube [Pa]
    stiffness: float  #: factor on EA, EI and GA of the tubes [-]
    body: ConvexObject  #: the object at its measured pose
    contacts: PressedContacts
    #: state of the bent tubes: `places`, `state` and `received` of `BentTubes`
    bent: tuple[Array, BentState, Array | None]
    active: Indices  #: blocks of the frame that deform
    forces: ContactForces  #: solution of the equations
    wrench: Array
    anchors: Array
    angles: Array
    motion: tuple[Array, Array] | None
    found: dict[str, Any]  #: values that were found at this equilibrium, by their names

    @classmethod
    def of(cls, grip: HeldGrip) -> StoredEquilibrium:
        """Return the numbers of an equilibrium."""
        samples, number = grip.origin, grip.number
        bent, structure, body = samples.statics.bent, grip.structure, samples.statics.body
        numbers = (bent.places, bent.state, bent.received), samples.state, samples.wrench
        if samples is not grip:
            numbers, body = take(numbers, number), body.objects[number]
        state, forces, wrench = numbers
        return cls(
            *structure,
            body=body,
            contacts=grip.contacts,
            bent=state,
            active=bent.frame.layout.active,
            forces=replace(forces),  # without cached values
            wrench=wrench,
            anchors=grip.anchors,
            angles=grip.angles,
            motion=grip.motion,
            found={
                name: getattr(grip, name)
                for name in FOUND
                if name in vars(samples) or name in vars(grip)
            },
        )

    def restore(self) -> HeldGrip:
        """Return the equilibrium; its tubes are linearised when they are read."""
        structure = structure_under(self.config, self.pressures, self.stiffness)
        (places, state, received), members = self.bent, self.contacts.members
        cuts = Cuts.of(structure, members, places)
        frame = structure.frame.cut(cuts.pieces, cuts.within, self.active)
        lines = Lines.of(structure, members)
        bent = BentTubes(structure, members, places, cuts, lines, frame, state, received)
        statics = statics_of(bent, self.body, self.contacts)
        fields = self.anchors, self.angles, statics, self.forces, self.wrench, self.motion
        grip = HeldGrip(*fields)
        vars(grip).update(self.found)
        return grip


def scaled_wrench(wrench: Array | None, arm: float) -> Array:
    """Return a wrench with its moment divided by the characteristic radius [N]."""
    return np.zeros(3) if wrench is None else np.asarray(wrench) / (1.0, 1.0, arm)
