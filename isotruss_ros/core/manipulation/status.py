# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A roller command and its status: carried out, slowed, deflected or stopped, and by what."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import enum

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import Record


class Status(enum.IntEnum):
    """
    Codes of a command, the same as in isotruss_msgs/ManipulationStatus.

    Below 30 the rollers do what the command says; from 30 on they are stopped, but for the squeeze
    of an object that has slipped.
    """

    OK = 0  #: the twist is carried out
    IDLE = 1  #: the twist is zero, and so is the command
    FOLLOWING_TRAJECTORY = 2  #: a trajectory of the rollers is followed; twists do not count
    ARRIVED = 3  #: the rollers are at the end of a trajectory; no twist came since
    ACCELERATING = 4  #: the rollers change their speeds as quickly as they may
    SLOWED_ROLLER_SPEED = 10  #: along the twist, slower: a roller is at its largest speed
    SLOWED_MEMBER_LENGTH = 11  #: along the twist, slower: a member is near its length limit
    SLOWED_RIGIDITY = 12  #: along the twist, slower: the rigidity index is near its bound
    SLOWED_SELF_COLLISION = 13  #: along the twist, slower: parts of the robot are near each other
    SLOWED_OBJECT = 14  #: along the twist, slower: the robot is near the object, beside the grip
    SLOWED_UTILISATION = 15  #: along the twist, slower: a tube is near its wrinkling moment
    SLOWED_BARRIER = 16  #: along the twist, slower: a barrier or limit of the user's own binds
    SLOWED_SLIP_MARGIN = 17  #: along the twist, slower: the slip margin ends
    UNREACHABLE = 20  #: the closest reachable twist, perhaps slower
    SLIDING = 21  #: the closest twist that limits admit, with `slide_along_limits`
    HALT_NO_TWIST = 30  #: no twist yet, or the last one is too old
    HALT_INVALID_TWIST = 31
    HALT_NO_JOINT_STATES = 32
    HALT_STALE_JOINT_STATES = 33
    HALT_INVALID_JOINT_STATES = 34
    HALT_NO_OBJECT_POSE = 35
    HALT_STALE_OBJECT_POSE = 36
    HALT_INVALID_OBJECT_POSE = 37
    HALT_NO_GRASP = 38  #: the object is not between the two grasping members, or not near them
    HALT_KINEMATICS = 39  #: no configuration fits, or the quadratic program was not solved
    HALT_EMERGENCY_STOP = 40
    HALT_CLOCK = 41  #: simulated time is stopped
    HALT_INVALID_FAILED_ROLLERS = 42
    HALT_NOT_HELD = 43  #: no equilibrium holds the object that is squeezed
    HALT_TRAJECTORY = 44  #: a trajectory was rejected or aborted; no twist came since
    HALT_OTHER_COMMANDS = 45  #: another node commands the rollers, too
    HALT_SLIPPED = 46  #: the object slipped, or its pose is wrong; the squeeze is regulated on
    HALT_OSCILLATES = 48  #: the object swings more and more: the rollers rest
    HALT_STALE_TUBE_PRESSURES = 50
    HALT_INVALID_TUBE_PRESSURES = 51

    def __str__(self) -> str:
        """Return the name in words."""
        return self.name.lower().replace('_', ' ')


@dataclass(frozen=True, eq=False, repr=False)
class RollerCommand(
    Record, headline=('status', 'roller_velocities', 'achieved_twist', 'scale', 'limiting')
):
    """
    Roller velocities, and the motion of the object that follows from them.

    :ivar roller_velocities: (r,) speed of the tube through each roller [m/s].
    :ivar achieved_twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame,
        computed from `roller_velocities`.
    :ivar scale: 0 to 1, by which the limits shrank the (closest reachable) twist; when sliding,
        the component along it.
    :ivar status: how the twist was carried out.
    :ivar limiting: names of the rollers, members and so on whose limits bind, empty at scale 1.
    :ivar reachable_dof: number of independent motions of the object that the working rollers can
        produce, 0 to 3; 0 too where the rollers are stopped for want of inputs.
    :ivar motion: (3, r) rows of the twist on the speeds of the rollers; None where they are
        stopped.
    :ivar contact_rows: (g, r) rows on the speeds of the rollers that keep the contacts, zero for
        those that have failed; None where they are stopped.
    """

    roller_velocities: Array
    achieved_twist: Array
    scale: float
    status: Status
    limiting: tuple[str, ...] = ()
    reachable_dof: int = 0
    motion: Array | None = field(default=None, repr=False)
    contact_rows: Array | None = field(default=None, repr=False)

    def slowed(self, share: float, status: Status, names: tuple[str, ...]) -> RollerCommand:
        """
        Return a part of this command.

        :param share: of its velocities, 0 to 1.
        :param status: how it is carried out now.
        :param names: of what slows it, after what did before.
        """
        return replace(
            self,
            roller_velocities=share * self.roller_velocities,
            achieved_twist=share * self.achieved_twist,
            scale=share * self.scale,
            status=status,
            limiting=tuple(dict.fromkeys(self.limiting + names)),
        )
