# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""An object that rolls with the tubes that hold it: where it is follows from the configuration."""

from __future__ import annotations

from dataclasses import dataclass
import functools
from math import cos, sin

from isotruss_ros.core.grasping.balance import ContactForces
from isotruss_ros.core.grasping.depths import member_depths
from isotruss_ros.core.grasping.equilibrium import (
    FEET,
    find_anchors,
    HeldObjectStatics,
    INCLINATIONS,
    keep_place,
    NORMAL,
    roll,
)
from isotruss_ros.core.grasping.held_members import (
    held_object_statics,
    Hold,
    static_start,
)
from isotruss_ros.core.grasping.slip_margin import wrench_response, WrenchResponse
from isotruss_ros.core.grasping.sticking_grasp import (
    scaled_wrench,
    StickingGrasp,
    travel_into,
)
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.objects import Cylinder
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.pressures import Pressure
import numpy as np

#: A motion is expected to go on by at most this many times what it was before.
MOST = 2.0
#: An equilibrium is looked for in so many states from where it was expected. It is the one if it
#: is as near as this [m] and its normal forces differ by no more than this share.
FEW_STEPS, NEAR, LIKE = 5, 2e-3, 0.3


@dataclass(frozen=True, eq=False)
class RollingGrasp(StickingGrasp):
    """
    An object held between two members in one configuration, and what stays as it rolls.

    :ivar config: the configuration.
    :ivar diameter: of the object [m].
    :ivar members: (2,) numbers of the grasping members.
    :ivar anchors: (2,) see `find_anchors` [m].
    :ivar statics: the equations in this configuration.
    :ivar state: their solution.
    :ivar wrench: (fx, fy, m / radius) on the object [N].
    :ivar stiffness_scale: stiffness of the robot against that of the model.
    :ivar pressure: gauge [Pa], see `tube_pressures`; that of the robot file if None.
    :ivar motion: roller travel (r,) [m] from the grasp before this one, and by how much that
        changed the unknowns (11,); None without one.
    """

    config: Configuration
    diameter: float
    members: Indices
    anchors: Array
    statics: HeldObjectStatics
    state: ContactForces
    wrench: Array
    stiffness_scale: float
    pressure: Pressure | None = None
    motion: tuple[Array, Array] | None = None

    @classmethod
    def attach(
        cls,
        config: Configuration,
        cylinder: Cylinder,
        angle: float = 0.0,
        external_wrench: Array | None = None,
        stiffness_scale: float = 1.0,
        pressure: Pressure | None = None,
        before: RollingGrasp | None = None,
        depths: Array | None = None,
    ) -> RollingGrasp | Hold:
        """
        Find the equilibrium near a pose, of which the past is not known, see `settle_grasp`.

        :param config: where the robot is.
        :param cylinder: the object, where it was measured.
        :param angle: its measured orientation [rad].
        :param external_wrench: (fx, fy, m) on the object [N, N m]; none if None.
        :param stiffness_scale: stiffness of the robot against that of the model.
        :param pressure: gauge [Pa], see `tube_pressures`; that of the robot file if None.
        :param before: the same a moment ago, of an object of the same diameter: the search begins
            there, and goes on from the given pose unless it ends close by.
        :param depths: (m,) of the object in the members, see `member_depths`; found out if None
            [m].
        :return: which condition has no solution, if one has none.
        :raises StructureError: see `structure_of`.
        """
        if depths is None:
            depths = member_depths(config, cylinder)
        members = np.sort(np.argsort(depths, kind='stable')[-2:])
        if depths[members].min() <= -config.robot.description.tube_diameter:
            return Hold.NO_CONTACT
        statics = held_object_statics(
            config, cylinder, members, stiffness_scale, pressure=pressure
        )
        center = complex(*cylinder.center)
        wrench, closure = scaled_wrench(external_wrench, statics.radius), keep_place(center, angle)
        state, motion = None, None
        if before is not None and before.is_like(statics, members):
            travel = config.roller_positions - before.config.roller_positions
            ahead = before.ahead(travel)
            state = statics.solve(ahead, wrench, closure, FEW_STEPS)
            if state is not None and not _is_close(state, ahead):
                state = None
            if state is not None:
                motion = travel, state.unknowns - before.state.unknowns
        if state is None:
            start = static_start(statics, center, depths[members])
            state = statics.solve(start, wrench, closure)
        if state is None:
            return Hold.NO_BALANCE
        anchors = find_anchors(state.unknowns, travel_into(config, members), statics)
        return cls(
            config,
            cylinder.diameter,
            members,
            anchors,
            statics,
            state,
            wrench,
            stiffness_scale,
            pressure,
            motion,
        )

    def is_like(self, statics: HeldObjectStatics, members: Indices) -> bool:
        """
        Return whether an object is held by the same members from the same sides.

        :param statics: the equations of the other one.
        :param members: (2,) numbers of the grasping members of the other one.
        """
        own = self.statics
        return (
            members.tolist() == self.members.tolist()
            and statics.sides.tolist() == own.sides.tolist()
        )

    @property
    def body(self) -> Cylinder:
        """Return the object, where it is in equilibrium."""
        return Cylinder(self.pose[:2], self.diameter)

    @property
    def contact_members(self) -> Indices:
        """Return the numbers of the members of the contacts, (2,)."""
        return self.members

    def moved_to(
        self, config: Configuration, external_wrench: Array | None = None
    ) -> RollingGrasp | None:
        """
        Return the grasp in another configuration, contacts rolling without slip.

        :param config: near to the present one: the search for the equilibrium starts there.
        :param external_wrench: (fx, fy, m) on the object [N, N m]; none if None.
        :return: None where there is no equilibrium.
        """
        wrench = scaled_wrench(external_wrench, self.statics.radius)
        statics = held_object_statics(
            config, self.body, self.members, self.stiffness_scale, pressure=self.pressure
        )
        closure = roll(self.anchors, travel_into(config, self.members), statics)
        travel = config.roller_positions - self.config.roller_positions
        state = statics.solve(self.ahead(travel), wrench, closure)
        if state is None:
            state = statics.solve(self.state.unknowns, wrench, closure)
        if state is None:
            return None
        return RollingGrasp(
            config,
            self.diameter,
            self.members,
            self.anchors,
            statics,
            state,
            wrench,
            self.stiffness_scale,
            self.pressure,
            (travel, state.unknowns - self.state.unknowns),
        )

    def ahead(self, travel: Array) -> Array:
        """
        Return about where the unknowns (11,) will be after some travel.

        :param travel: (r,) of the rollers [m].
        """
        if self.motion is None:
            return self.state.unknowns
        before, change = self.motion
        length = float(before @ before)
        # What the motion has in common with the one before; no guess from a much shorter one.
        share = float(travel @ before) / length if length > 0.0 else 0.0
        return self.state.unknowns + max(-MOST, min(share, MOST)) * change

    @functools.cached_property
    def response(self) -> WrenchResponse | None:
        """Return how pose and forces answer to a wrench; None where that is indifferent."""
        return wrench_response(self.statics, self.state)

    def squeeze_by_opening(self) -> float:
        """
        Return by how much the squeeze changes as the angle of the grip opens, negative [N/rad].

        At a module one member turns away from the object about its end, the object moves so that
        both press alike: the depth lost is shared by both, and by the dents in the skin.
        """
        statics, feet = self.statics, self.state.feet
        compliance, normals = statics.compliance, []
        for side, turned in zip(
            statics.sides.tolist(), self.state.unknowns[INCLINATIONS].tolist(), strict=True
        ):
            normals += [-side * sin(turned), side * cos(turned), 0.0]
        pressed = np.array(normals)
        give = float(pressed @ compliance.at(feet).matrix.reshape(6, 6) @ pressed)
        _, dents = statics.indentation(self.state.normal_forces)
        # The members meet at the module where one of them starts and the other one ends.
        one, other = self.members.tolist()
        following = self.config.robot.topology.following
        arms = [
            foot if starts else length - foot
            for foot, length, starts in zip(
                feet.tolist(),
                compliance.length.tolist(),
                (one == following[other], other == following[one]),
                strict=True,
            )
        ]
        return -0.5 * sum(arms) / (give + float(dents.sum()))


def _is_close(state: ContactForces, start: Array) -> bool:
    """Return whether an equilibrium is where it was expected, and presses alike."""
    before, after = start[NORMAL], state.normal_forces
    moved = np.abs(state.unknowns - start)
    lengths = max(float(moved[:2].max()), float(moved[FEET].max()))
    alike = (np.abs(after - before) <= LIKE * np.abs(before)).all()
    return lengths <= NEAR and bool(alike)
