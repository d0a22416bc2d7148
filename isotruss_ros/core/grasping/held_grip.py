"""A convex object held between two members or three: it is where the configuration puts it."""

from __future__ import annotations

from dataclasses import dataclass, replace
import itertools
import math

from isotruss_ros.core.grasping.contact_closures import find_anchors, rest, stick, unwrapped
from isotruss_ros.core.grasping.contact_statics import ContactForces, ContactStatics
from isotruss_ros.core.grasping.grip_response import grip_response, GripResponse
from isotruss_ros.core.grasping.held_members import Hold
from isotruss_ros.core.grasping.member_compliance import MemberCompliance
from isotruss_ros.core.grasping.pressed_contacts import (
    body_depths,
    contact_statics,
    find_pressed,
    LEAST_FACE,
    moved_statics,
    PressedContacts,
    start_at,
)
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.objects import Pose
from isotruss_ros.core.model.polygon import Polygon
from isotruss_ros.core.model.segment_gaps import segment_gaps
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.pressures import Pressure
from isotruss_ros.core.statics.structure import structure_of
import numpy as np

#: Most members that hold an object.
MOST = 3
#: Members farther off than this share of a tube's diameter do not touch, however tubes bend.
NEAR = 0.25
#: Corners may change so often in one motion.
MAX_CHANGES = 4


@dataclass(frozen=True, eq=False)
class HeldGrip:
    """
    A convex object held by two members or three in one configuration, and what stays as it rolls.

    :ivar config: the configuration.
    :ivar body: the object, where it is in equilibrium.
    :ivar contacts: the k contacts.
    :ivar anchors: (k,) see `find_anchors` [m].
    :ivar angles: (k,) of the normals in the object's frame, not wrapped [rad].
    :ivar statics: the equations in this configuration.
    :ivar state: their solution.
    :ivar wrench: (fx, fy, m / arm) on the object, see `ConvexObject.arm` [N].
    :ivar stiffness_scale: stiffness of the robot against that of the model.
    :ivar flattening: whether the tubes' sections flatten where they are touched.
    :ivar pressure: gauge [Pa], see `tube_pressures`; that of the robot file if None.
    """

    config: Configuration
    body: ConvexObject
    contacts: PressedContacts
    anchors: Array
    angles: Array
    statics: ContactStatics
    state: ContactForces
    wrench: Array
    stiffness_scale: float = 1.0
    flattening: bool = True
    pressure: Pressure | None = None

    @classmethod
    def attach(
        cls,
        config: Configuration,
        body: ConvexObject,
        members: Indices | None = None,
        external_wrench: Array | None = None,
        stiffness_scale: float = 1.0,
        flattening: bool = True,
        pressure: Pressure | None = None,
    ) -> HeldGrip | Hold:
        """
        Find the equilibrium near a pose, of which the past is not known, see `rest`.

        :param config: where the robot is.
        :param body: the object, where it was measured.
        :param members: (m,) numbers of the two members or three that hold it; if None those that
            it presses into, or the two closest ones.
        :param external_wrench: (fx, fy, m) on the object about the origin of its frame [N, N m];
            none if None.
        :param stiffness_scale: stiffness of the robot against that of the model.
        :param flattening: whether the tubes' sections flatten where they are touched.
        :param pressure: gauge [Pa], see `tube_pressures`; that of the robot file if None.
        :return: which condition has no solution, if one has none.
        :raises StructureError: see `structure_of`.
        """
        depths = body_depths(config, body)
        if members is None:
            count = int(np.clip(np.count_nonzero(depths > 0.0), 2, MOST + 1))
            if count > MOST:
                return Hold.OTHER_CONTACT
            members = np.argsort(depths, kind='stable')[-count:]
        members = np.sort(np.asarray(members, dtype=np.intp))
        if depths[members].min() <= -config.robot.description.tube_diameter:
            return Hold.NO_CONTACT
        scaled = _scaled(external_wrench, body)
        options = (stiffness_scale, flattening, pressure)
        for contacts in _choices(find_pressed(config, body, members)):
            found = cls._at_rest(config, body, contacts, scaled, *options)
            if found is not None and found._presses():
                return found
        return Hold.NO_BALANCE

    @classmethod
    def _at_rest(
        cls,
        config: Configuration,
        body: ConvexObject,
        contacts: PressedContacts,
        wrench: Array,
        stiffness_scale: float,
        flattening: bool,
        pressure: Pressure | None,
    ) -> HeldGrip | None:
        """Return the equilibrium at given contacts, if there is one."""
        statics = contact_statics(config, body, contacts, stiffness_scale, flattening, pressure)
        closure = rest(statics, body.center, body.pose.angle)
        state = statics.solve(start_at(statics, body), wrench, closure)
        if state is not None and flattening and len(contacts.owners) > contacts.owners[-1] + 1:
            # How deep a face's ends dent the skin rests on how the tube is bent over them.
            normals = state.normals
            options = (stiffness_scale, flattening, pressure, normals)
            statics = contact_statics(config, body, contacts, *options)
            closure = rest(statics, body.center, body.pose.angle)
            state = statics.solve(state.unknowns, wrench, closure)
        if state is None:
            return None
        own = np.angle(state.normals * np.exp(-1j * state.unknowns[2]))
        travel = _travel(config, contacts.members)
        anchors = find_anchors(statics, state.unknowns, state.normals, travel, own)
        placed = body.moved_to(state.unknowns[:3])
        return cls(
            config,
            placed,
            contacts,
            anchors,
            own,
            statics,
            state,
            wrench,
            stiffness_scale,
            flattening,
            pressure,
        )

    @property
    def pose(self) -> Pose:
        """Return the object's pose; the angle is in (-pi, pi]."""
        x, y, angle = map(float, self.state.unknowns[:3])
        return Pose(x, y, math.remainder(angle, 2.0 * math.pi))

    @property
    def members(self) -> Indices:
        """Return the numbers of the grasping members, (m,)."""
        first = np.searchsorted(self.contacts.owners, np.arange(self.contacts.owners[-1] + 1))
        return self.contacts.members[first]

    @property
    def member_names(self) -> tuple[str, ...]:
        """Return the names of the grasping members."""
        return tuple(self.config.robot.member_names[i] for i in self.members)

    @property
    def contact_members(self) -> Indices:
        """Return the numbers of the members of all contacts, (k,)."""
        return self.contacts.members

    @property
    def normal_forces(self) -> Array:
        """Return how hard the members press, (m,) [N]."""
        return self._by_member(self.state.normal_forces)

    @property
    def friction_forces(self) -> Array:
        """Return (m,) on the tubes, counter-clockwise around the object [N]."""
        return self._by_member(self.state.friction_forces)

    @property
    def squeeze(self) -> float:
        """Return the mean normal force of the members [N]."""
        return float(self.normal_forces.mean())

    @property
    def required_friction(self) -> float:
        """Return the smallest coefficient of friction with which all contacts stick."""
        return float(np.max(np.abs(self.friction_forces) / self.normal_forces))

    def moved_to(
        self, config: Configuration, external_wrench: Array | None = None
    ) -> HeldGrip | None:
        """
        Return the grip in another configuration, contacts rolling without slip.

        A face lifts at an end that does not press any more, and comes to lie on a member that it
        would otherwise cut into. A third member that touches the object holds it too, as long as
        it presses.

        :param config: near to the present one: the search for the equilibrium starts there.
        :param external_wrench: (fx, fy, m) on the object about the origin of its frame [N, N m];
            none if None.
        :return: None where there is no equilibrium.
        """
        wrench = _scaled(external_wrench, self.body)
        nothing = np.zeros(0, dtype=np.intp)
        found = self._roll(config, self.contacts, self.anchors, self.angles, wrench, nothing)
        for _ in range(MAX_CHANGES):
            if found is None:
                return None
            lifted = found._lifted()
            if lifted is None:
                break
            kept = np.delete(np.arange(len(found.anchors)), lifted)
            contacts = found.contacts.without(lifted)
            found = self._roll(
                config, contacts, found.anchors[kept], found.angles[kept], wrench, nothing, found
            )
        return found if found is None else found._laid_down()._joined()

    def hold(self, friction: float) -> Hold:
        """
        Return whether the contacts stick; if not, what happens.

        :param friction: coefficient between tube and object.
        """
        if self.normal_forces.min() <= 0.0:
            return Hold.NO_CONTACT
        feet = self.state.feet
        if feet.min() < 0.0 or (feet > self.statics.compliance.length).any():
            return Hold.OFF_MEMBER
        return Hold.SLIPS if self.required_friction > friction else Hold.HELD

    def response(self) -> GripResponse | None:
        """Return how pose and forces answer to a wrench; None where it is indifferent."""
        travel = _travel(self.config, self.contacts.members)
        nothing = np.zeros(0, dtype=np.intp)
        closure = stick(self.statics, self.anchors, travel, self.angles, nothing)
        return grip_response(self.statics, self.state, self.wrench, closure)

    def slip_margin(self, friction: float) -> float:
        """
        Return the smallest extra wrench at which a contact slips or lets go.

        :param friction: coefficient between tube and object.
        :return: [N], moments over the arm; zero where the equilibrium is indifferent.
        """
        response = self.response()
        return 0.0 if response is None else response.slip_margin(friction)

    def squeeze_by_opening(self) -> float:
        """
        Return by how much the squeeze changes as the members move apart, negative [N/m].

        Of two members by the distance between their contacts, of three by twice what each moves
        away from the object.
        """
        response = self.response()
        return -0.0 if response is None else response.squeeze_by_opening

    def _by_member(self, values: Array) -> Array:
        return np.bincount(self.contacts.owners, weights=values)

    def _presses(self) -> bool:
        """Tell whether both ends of all faces press."""
        owners = self.contacts.owners
        alone = np.bincount(owners)[owners] == 1
        return bool((alone | (self.state.normal_forces > 0.0)).all())

    def _lifted(self) -> int | None:
        """Return which end of a face, or third member, pulls most; None if none does."""
        owners, normal = self.contacts.owners, self.state.normal_forces
        more = (np.bincount(owners)[owners] > 1) | (owners[-1] > 1)
        pulling = np.where(more, normal, np.inf)
        least = int(pulling.argmin())
        return least if pulling[least] < 0.0 else None

    def _roll(
        self,
        config: Configuration,
        contacts: PressedContacts,
        anchors: Array,
        angles: Array,
        wrench: Array,
        fresh: Indices,
        near: HeldGrip | None = None,
    ) -> HeldGrip | None:
        """Return the equilibrium with contacts that stick, those that are `fresh` without rub."""
        before = near or self
        if contacts is self.contacts:
            statics = moved_statics(
                self.statics, config, contacts, self.stiffness_scale, self.pressure
            )
            start = before.state.unknowns
        else:
            statics = contact_statics(
                config,
                before.body,
                contacts,
                self.stiffness_scale,
                self.flattening,
                self.pressure,
                before.body.turn * np.exp(1j * angles),
            )
            start = start_at(statics, before.body)
        travel = _travel(config, contacts.members)
        closure = stick(statics, anchors, travel, angles, fresh)
        state = statics.solve(start, wrench, closure)
        if state is None:
            return None
        turned = unwrapped(state.unknowns, state.normals, angles)
        found = find_anchors(statics, state.unknowns, state.normals, travel, angles)
        kept = anchors.copy()
        kept[fresh] = found[fresh]
        return HeldGrip(
            config,
            self.body.moved_to(state.unknowns[:3]),
            contacts,
            kept,
            turned,
            statics,
            state,
            wrench,
            self.stiffness_scale,
            self.flattening,
            self.pressure,
        )

    def _laid_down(self, changes: int = MAX_CHANGES) -> HeldGrip:
        """
        Return the grip with the other end of a face where a corner has rolled beyond it.

        Of a short face the other end takes the place of this one.
        """
        shape = self.body.shape
        if not isinstance(shape, Polygon):
            return self
        owners, corners = self.contacts.owners, self.contacts.corners
        alone = np.flatnonzero(np.bincount(owners)[owners] == 1)
        own = self.state.normals * np.exp(-1j * self.state.unknowns[2])
        for k in alone.tolist():
            corner = int(corners[k])
            beyond = (own[k] * shape.normals[corner].conjugate()).imag > 0.0
            before = (own[k] * shape.normals[corner - 1].conjugate()).imag < 0.0
            if not (beyond or before):
                continue
            step = 1 if beyond else -1
            other = (corner + step) % len(shape.vertices)
            face = abs(shape.arc_centers[other] - shape.arc_centers[corner])
            short = face < LEAST_FACE * self.statics.tube_radius
            laid = self._with_corner(k, other) if short else self._with_face(k, step)
            if laid is not None and laid._presses():
                return laid._laid_down(changes - 1) if short and changes > 0 else laid
        return self

    def _with_corner(self, k: int, corner: int) -> HeldGrip | None:
        """Return the equilibrium with another corner at a contact, to which the object rolled."""
        corners = self.contacts.corners.copy()
        corners[k] = corner
        contacts = replace(self.contacts, corners=corners)
        nothing = np.zeros(0, dtype=np.intp)
        return self._roll(self.config, contacts, self.anchors, self.angles, self.wrench, nothing)

    def _joined(self) -> HeldGrip:
        """Return the grip with a third member where that has come to touch the object."""
        if len(self.members) >= MOST:
            return self
        depths = body_depths(self.config, self.body)
        depths[self.members] = -np.inf
        number = int(depths.argmax())
        near = NEAR * self.config.robot.description.tube_diameter
        if depths[number] <= -near or self._depth_in(number, float(depths[number])) <= 0.0:
            return self
        others = find_pressed(self.config, self.body, np.array([number]))
        contacts, order = self.contacts.with_others(others)
        fresh = np.flatnonzero(order >= len(self.anchors))
        count = len(others.members)
        statics = contact_statics(self.config, self.body, others, flattening=False)
        facing = statics.normals(start_at(statics, self.body)) * self.body.turn.conjugate()
        anchors = np.append(self.anchors, np.zeros(count))[order]
        angles = np.append(self.angles, np.angle(facing))[order]
        found = self._roll(self.config, contacts, anchors, angles, self.wrench, fresh)
        if found is None or found.state.normal_forces[fresh].min() <= 0.0:
            return self
        return found

    def _depth_in(self, number: int, depth: float) -> float:
        """
        Return how deep the object is in a member that does not hold it [m].

        The tubes that hold it bend, and with them the structure.

        :param depth: in the undeformed member [m].
        """
        topology, points = self.config.robot.topology, self.config.points
        start, end = points[topology.b[number]], points[topology.c[topology.following[number]]]
        share = segment_gaps(self.body, np.array([start]), np.array([end])).shares[0]
        compliance = MemberCompliance(
            structure_of(self.config, self.pressure),
            [*self.contacts.members.tolist(), number],
            self.stiffness_scale,
        )
        loads = np.vstack([self.statics.loads(self.state.unknowns), np.zeros(3)])
        feet = np.append(self.state.feet, share * abs(end - start))
        give = compliance.at(feet).respond(loads)[-1, 1]
        aside = ((self.body.middle - start) / (end - start)).imag
        # A member with the object on its left is deeper in it where it moves left.
        return depth + float(give if aside > 0.0 else -give)

    def _with_face(self, k: int, step: int) -> HeldGrip | None:
        """Return the equilibrium with the next corner (step 1) or the one before (-1) as well."""
        shape = self.body.shape
        assert isinstance(shape, Polygon)
        corner = int(self.contacts.corners[k])
        other = (corner + step) % len(shape.vertices)
        half = 0.5 * abs(shape.arc_centers[other] - shape.arc_centers[corner])
        place = k + (step > 0)
        cuts = self.contacts.cuts.copy()
        cuts[k] = (np.inf, half) if step > 0 else (half, np.inf)
        cuts = np.insert(cuts, place, (half, np.inf) if step > 0 else (np.inf, half), axis=0)
        contacts = PressedContacts(
            np.insert(self.contacts.members, place, self.contacts.members[k]),
            np.insert(self.contacts.owners, place, self.contacts.owners[k]),
            np.insert(self.contacts.corners, place, other),
            cuts,
        )
        anchors = np.insert(self.anchors, place, 0.0)
        angles = np.insert(self.angles, place, self.angles[k])
        return self._roll(self.config, contacts, anchors, angles, self.wrench, np.array([place]))


def _choices(contacts: PressedContacts) -> list[PressedContacts]:
    """Return the contacts with faces on both ends first, then on one end of each."""
    ends = [np.flatnonzero(contacts.owners == i).tolist() for i in range(contacts.owners[-1] + 1)]
    faces = [own for own in ends if len(own) > 1]
    found = []
    for dropped in itertools.product(*([None, *own] for own in faces)):
        chosen = contacts
        for k in sorted((k for k in dropped if k is not None), reverse=True):
            chosen = chosen.without(k)
        found.append((sum(k is not None for k in dropped), chosen))
    return [chosen for _, chosen in sorted(found, key=lambda item: item[0])]


def _scaled(wrench: Array | None, body: ConvexObject) -> Array:
    """Return (fx, fy, m / arm) of (fx, fy, m), zero for None [N]."""
    return np.zeros(3) if wrench is None else np.asarray(wrench) / (1.0, 1.0, body.arm)


def _travel(config: Configuration, members: Indices) -> Array:
    """Return the travel of the tube through the modules at which members start (k,) [m]."""
    topology = config.robot.topology
    travel = np.zeros(topology.n_modules)
    travel[topology.driven] = config.roller_positions
    return travel[members]
