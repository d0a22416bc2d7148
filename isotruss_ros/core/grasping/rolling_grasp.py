"""An object that rolls with the tubes that hold it: where it is follows from the configuration."""

from __future__ import annotations

from dataclasses import dataclass
import math

from isotruss_ros.core.grasping.equilibrium import (
    FEET,
    find_anchors,
    HeldObjectStatics,
    HeldState,
    keep_place,
    roll,
)
from isotruss_ros.core.grasping.held_members import (
    held_object_statics,
    Hold,
    member_depths,
    static_start,
)
from isotruss_ros.core.grasping.slip_margin import slip_margin, wrench_response
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.objects import Cylinder, Pose
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.pressures import Pressure
import numpy as np


@dataclass(frozen=True, eq=False)
class RollingGrasp:
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
    """

    config: Configuration
    diameter: float
    members: Indices
    anchors: Array
    statics: HeldObjectStatics
    state: HeldState
    wrench: Array
    stiffness_scale: float = 1.0
    pressure: Pressure | None = None

    @classmethod
    def attach(
        cls,
        config: Configuration,
        cylinder: Cylinder,
        angle: float = 0.0,
        external_wrench: Array | None = None,
        stiffness_scale: float = 1.0,
        pressure: Pressure | None = None,
    ) -> RollingGrasp | Hold:
        """
        Find the equilibrium near a pose, of which the past is not known, see `settle_grasp`.

        :param config: where the robot is.
        :param cylinder: the object, where it was measured.
        :param angle: its measured orientation [rad].
        :param external_wrench: (fx, fy, m) on the object [N, N m]; none if None.
        :param stiffness_scale: stiffness of the robot against that of the model.
        :param pressure: gauge [Pa], see `tube_pressures`; that of the robot file if None.
        :return: which condition has no solution, if one has none.
        :raises StructureError: see `structure_of`.
        """
        depths = member_depths(config, cylinder)
        members = np.sort(np.argsort(depths, kind='stable')[-2:])
        if depths[members].min() <= -config.robot.description.tube_diameter:
            return Hold.NO_CONTACT
        statics = held_object_statics(
            config, cylinder, members, stiffness_scale, pressure=pressure
        )
        center = complex(*cylinder.center)
        start = static_start(statics, center, depths[members])
        wrench = scaled_wrench(external_wrench, statics.radius)
        state = statics.solve(start, wrench, keep_place(center, angle))
        if state is None:
            return Hold.NO_BALANCE
        anchors = find_anchors(state.unknowns, _travel(config, members), statics)
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
        )

    @property
    def pose(self) -> Pose:
        """Return the object's pose; the angle is in (-pi, pi]."""
        x, y, angle = map(float, self.state.unknowns[:3])
        return Pose(x, y, math.remainder(angle, 2.0 * math.pi))

    @property
    def squeeze(self) -> float:
        """Return the mean normal force of the two members [N]."""
        return 0.5 * float(self.state.normal_forces.sum())

    @property
    def member_names(self) -> tuple[str, str]:
        """Return the names of the grasping members."""
        first, second = self.members
        names = self.config.robot.member_names
        return names[first], names[second]

    @property
    def contact_members(self) -> Indices:
        """Return the numbers of the members of the contacts, (2,)."""
        return self.members

    @property
    def required_friction(self) -> float:
        """Return the smallest coefficient of friction with which both contacts stick."""
        return float(np.max(np.abs(self.state.friction_forces) / self.state.normal_forces))

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
        cylinder = Cylinder(self.pose[:2], self.diameter)
        statics = held_object_statics(
            config, cylinder, self.members, self.stiffness_scale, pressure=self.pressure
        )
        closure = roll(self.anchors, _travel(config, self.members), statics)
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
        )

    def hold(self, friction: float) -> Hold:
        """
        Return whether the contacts stick; if not, what happens.

        :param friction: coefficient between tube and object.
        """
        if self.state.normal_forces.min() <= 0.0:
            return Hold.NO_CONTACT
        feet = self.state.unknowns[FEET]
        if feet.min() < 0.0 or (feet > self.statics.compliance.length).any():
            return Hold.OFF_MEMBER
        return Hold.SLIPS if self.required_friction > friction else Hold.HELD

    def slip_margin(self, friction: float) -> float:
        """
        Return the smallest extra wrench at which a contact slips or lets go, see `slip_margin`.

        :param friction: coefficient between tube and object.
        :return: [N], moments over the radius; zero where the equilibrium is indifferent.
        """
        response = wrench_response(self.statics, self.state, self.wrench)
        return 0.0 if response is None else slip_margin(self.state, response, friction)


def scaled_wrench(wrench: Array | None, radius: float) -> Array:
    """
    Return (fx, fy, m / radius) of (fx, fy, m), zero for None [N].

    :param wrench: (fx, fy, m) about the object's centre [N, N m]; zero if None.
    :param radius: of the object [m].
    """
    return np.zeros(3) if wrench is None else np.asarray(wrench) / (1.0, 1.0, radius)


def _travel(config: Configuration, members: Indices) -> Array:
    """Return the travel of the tube through the modules at which members start (2,) [m]."""
    topology = config.robot.topology
    travel = np.zeros(topology.n_modules)
    travel[topology.driven] = config.roller_positions
    return travel[members]
