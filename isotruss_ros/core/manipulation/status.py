# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Roller commands and their status codes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import enum
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import Record


class Status(enum.IntEnum):
    """
    Status codes of a command, equal to those of isotruss_msgs/ManipulationStatus.

    With codes below 30 the rollers follow the command. With codes of 30 and above the rollers are
    stopped, except that the squeeze of a slipped object is still controlled.
    """

    OK = 0  #: the commanded twist is executed, in loops near singular tasks within 5 %
    IDLE = 1  #: the twist is zero, and so is the command
    FOLLOWING_TRAJECTORY = 2  #: a trajectory of the rollers is followed; twists are ignored
    ARRIVED = 3  #: a trajectory is finished, and no twist was received since
    ACCELERATING = 4  #: the acceleration limit binds
    SLOWED_ROLLER_SPEED = 10  #: scaled twist: a roller is at its largest speed
    SLOWED_MEMBER_LENGTH = 11  #: scaled twist: a member is near its length limit
    SLOWED_RIGIDITY = 12  #: scaled twist: the rigidity index is near its bound
    SLOWED_SELF_COLLISION = 13  #: scaled twist: parts of the robot are near each other
    SLOWED_OBJECT = 14  #: scaled twist: a part outside the grip is near the object
    SLOWED_UTILISATION = 15  #: scaled twist: a tube is near its wrinkling moment
    SLOWED_BARRIER = 16  #: scaled twist: a user-defined barrier or limit binds
    SLOWED_SLIP_MARGIN = 17  #: scaled twist: the slip margin is near its bound
    SLOWED_OBSTACLE = 18  #: scaled twist: robot or object is near an obstacle, or evades it
    UNREACHABLE = 20  #: the closest reachable twist is executed, possibly scaled
    #: the closest twist within limits is executed: `slide_along_limits`, or near a singular task
    SLIDING = 21
    HALT_NO_TWIST = 30  #: no twist was received yet, or the last twist is too old
    HALT_INVALID_TWIST = 31
    HALT_NO_JOINT_STATES = 32
    HALT_STALE_JOINT_STATES = 33
    HALT_INVALID_JOINT_STATES = 34
    HALT_NO_OBJECT_POSE = 35
    HALT_STALE_OBJECT_POSE = 36
    HALT_INVALID_OBJECT_POSE = 37
    HALT_NO_GRASP = 38  #: the object is not in contact with all grasping members
    HALT_KINEMATICS = 39  #: no configuration exists, or the solver failed
    HALT_EMERGENCY_STOP = 40
    HALT_CLOCK = 41  #: simulated time is stopped
    HALT_INVALID_FAILED_ROLLERS = 42
    HALT_NOT_HELD = 43  #: the squeezed object has no equilibrium
    HALT_TRAJECTORY = 44  #: a trajectory was rejected or aborted, and no twist was received since
    HALT_OTHER_COMMANDS = 45  #: another node also commands the rollers
    #: the object slipped, or its pose is inconsistent; only the squeeze is controlled
    HALT_SLIPPED = 46
    HALT_OSCILLATES = 48  #: the object oscillates with growing amplitude; the rollers are stopped
    HALT_STALE_TUBE_PRESSURES = 50
    HALT_INVALID_TUBE_PRESSURES = 51
    HALT_STALE_OBSTACLES = 52  #: a moving obstacle is not published any more
    HALT_INVALID_OBSTACLES = 53
    HALT_OBSTACLE = 54  #: an obstacle approaches faster than the robot can evade it

    def __str__(self) -> str:
        """Return the name of the code in lower case, with spaces."""
        return self.name.lower().replace('_', ' ')


class GripFault(NamedTuple):
    """Fault of a grip that ends its motion until a client acknowledges it."""

    word: str  #: what has happened to the object
    action: str  #: command `isotruss ACTION`, and button of the view, that acknowledges the fault
    remedy: str  #: what a client does
    #: time after which a client gives up [s]; the equilibrium of an object that was just gripped
    #: may be searched for a while
    patience: float


#: Faults of a grip by their status; a new one needs no other table.
GRIP_FAULTS = {
    Status.HALT_SLIPPED: GripFault(
        'slipped', 'resume', 'resume the grip (service resume_grip)', 0.0
    ),
    Status.HALT_NOT_HELD: GripFault(
        'not held', 'pick', 'pick up the object (action pick_object)', 10.0
    ),
}


@dataclass(frozen=True, eq=False, repr=False)
class RollerCommand(
    Record, headline=('status', 'roller_velocities', 'achieved_twist', 'scale', 'limiting')
):
    """Roller velocities with the resulting twist of the object."""

    roller_velocities: Array  #: (r,) speed of the tube through each roller [m/s]
    #: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame, computed from
    #: `roller_velocities`
    achieved_twist: Array
    #: factor by which limits reduced the closest reachable twist, 0 to 1; when sliding, the
    #: component of the executed twist along the closest reachable twist, divided by the norm of
    #: the latter
    scale: float
    status: Status  #: status code
    limiting: tuple[str, ...] = ()  #: names of the rollers, members and parts whose limits bind
    #: number of independent motions of the object that the working rollers can produce, 0 to 3; 0
    #: in a halt without valid inputs
    reachable_dof: int = 0
    #: (3, r) Jacobian of the object's twist with respect to roller speeds; None in a halt
    motion: Array | None = field(default=None, repr=False)
    #: (g, r) contact constraints on the roller speeds; None in a halt
    contact_rows: Array | None = field(default=None, repr=False)

    def slowed(self, share: float, status: Status, names: tuple[str, ...]) -> RollerCommand:
        """Return a copy of this command with velocities multiplied by a factor."""
        return replace(
            self,
            roller_velocities=share * self.roller_velocities,
            achieved_twist=share * self.achieved_twist,
            scale=share * self.scale,
            status=status,
            limiting=tuple(dict.fromkeys(self.limiting + names)),
        )
