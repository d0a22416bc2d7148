# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A convex object held between two members or three: it is where the configuration puts it."""

from __future__ import annotations

from dataclasses import dataclass, replace
import itertools
from typing import NamedTuple

from isotruss_ros.core.contact.depths import member_depths
from isotruss_ros.core.holding.balance import CENTER, Closure, ContactForces
from isotruss_ros.core.holding.contact_changes import join, lay_down, lift_ends, MOST
from isotruss_ros.core.holding.contact_closures import find_anchors, rest
from isotruss_ros.core.holding.contact_statics import ContactStatics
from isotruss_ros.core.holding.grip_equilibrium import (
    GripEquilibrium,
    scaled_wrench,
    travel_into,
)
from isotruss_ros.core.holding.hold_status import HoldStatus
from isotruss_ros.core.holding.pressed_contacts import (
    contact_statics,
    find_pressed,
    PressedContacts,
    start_at,
)
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.pressures import Pressure
import numpy as np

#: An equilibrium is looked for in so many states from where it was expected. It is the one if it
#: is as near as this [m] and its normal forces differ by no more than this share.
FEW_STEPS, NEAR, LIKE = 5, 2e-3, 0.3


class _Options(NamedTuple):
    """What `attach` takes of the tubes."""

    stiffness_scale: float
    flattening: bool
    pressure: Pressure | None


@dataclass(frozen=True, eq=False)
class HeldGrip(GripEquilibrium):
    """A convex object in a grip: found where it was measured, it rolls with the configuration."""

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
        before: HeldGrip | None = None,
    ) -> HeldGrip | HoldStatus:
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
        :param before: the same a moment ago: the search begins there where the contacts are alike,
            and goes on from the given pose unless it ends close by.
        :return: which condition has no solution, if one has none.
        :raises StructureError: see `structure_of`.
        """
        depths = member_depths(config, body)
        if members is None:
            count = max(int(np.count_nonzero(depths > 0.0)), 2)
            if count > MOST:
                return HoldStatus.OTHER_CONTACT
            members = np.argsort(depths, kind='stable')[-count:]
        members = np.sort(np.asarray(members, dtype=np.intp))
        if depths[members].min() <= -config.robot.description.tube_diameter:
            return HoldStatus.NO_CONTACT
        scaled = scaled_wrench(external_wrench, body.arm)
        options = _Options(stiffness_scale, flattening, pressure)
        for contacts in _choices(find_pressed(config, body, members)):
            found = cls._at_rest(config, body, contacts, scaled, options, before)
            if found is not None and found.presses:
                return found
        return HoldStatus.NO_BALANCE

    @classmethod
    def _at_rest(
        cls,
        config: Configuration,
        body: ConvexObject,
        contacts: PressedContacts,
        wrench: Array,
        options: _Options,
        before: HeldGrip | None,
    ) -> HeldGrip | None:
        """Return the equilibrium at given contacts, if there is one."""
        statics = contact_statics(config, body, contacts, *options)
        closure = rest(statics, body.center, body.pose.angle)
        state, motion = None, None
        if before is not None and before._is_like(statics, contacts):
            travel = config.roller_positions - before.config.roller_positions
            state = before._nearby(travel, statics, wrench, closure)
            if state is not None:
                motion = travel, state.unknowns - before.state.unknowns
        if state is None:
            state = statics.solve(start_at(statics, body), wrench, closure)
        if (
            state is not None
            and options.flattening
            and len(contacts.owners) > contacts.owners[-1] + 1
        ):
            # How deep a face's ends dent the skin rests on how the tube is bent over them, and on
            # how the object has turned.
            turned = body.moved_to(state.unknowns[:3])
            statics = contact_statics(config, turned, contacts, *options, state.normals)
            closure = rest(statics, body.center, body.pose.angle)
            state = statics.solve(state.unknowns, wrench, closure)
        if state is None:
            return None
        own = np.angle(state.normals * np.exp(-1j * state.unknowns[2]))
        travel = travel_into(config, contacts.members)
        anchors = find_anchors(statics, state.unknowns, state.normals, travel, own)
        placed = body.moved_to(state.unknowns[:3])
        found = cls(config, placed, contacts, anchors, own, statics, state, wrench, *options)
        return replace(found, motion=motion)

    def _is_like(self, statics: ContactStatics, contacts: PressedContacts) -> bool:
        """Tell whether an object of the same shape is touched alike, from the same sides."""
        own = self.contacts
        return self.body.shape == statics.body.shape and all(
            np.array_equal(one, other)
            for one, other in (
                (own.members, contacts.members),
                (own.corners, contacts.corners),
                (self.statics.sides, statics.sides),
            )
        )

    def _nearby(
        self, travel: Array, statics: ContactStatics, wrench: Array, closure: Closure
    ) -> ContactForces | None:
        """Return the equilibrium that is where it is expected and presses alike, if any is."""
        start, places = self.ahead(travel), self.state.places
        found = statics.solve(start, wrench, closure, FEW_STEPS)
        if found is None:
            return None
        moved = np.abs(found.unknowns - start)
        far = max(float(moved[CENTER].max()), float(moved[places.feet].max()))
        alike = (moved[places.normal] <= LIKE * np.abs(start[places.normal])).all()
        return found if far <= NEAR and bool(alike) else None

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
        wrench = scaled_wrench(external_wrench, self.body.arm)
        rolled = self.rolled(config, self.contacts, self.anchors, self.angles, wrench)
        found = None if rolled is None else lift_ends(rolled)
        return None if found is None else join(lay_down(found))


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
