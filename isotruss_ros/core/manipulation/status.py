"""How a twist was answered: a code for each way of being carried out, slowed or stopped."""

from __future__ import annotations

import enum


class Status(enum.IntEnum):
    """
    Codes of a command, the same as in isotruss_msgs/ManipulationStatus.

    Below 30 the rollers do what the command says; from 30 on they are stopped.
    """

    OK = 0  #: the twist is carried out
    IDLE = 1  #: the twist is zero, and so is the command
    SLOWED_ROLLER_SPEED = 10  #: along the twist, slower: a roller is at its largest speed
    SLOWED_MEMBER_LENGTH = 11  #: along the twist, slower: a member comes to its length limit
    SLOWED_RIGIDITY = 12  #: along the twist, slower: the shape comes to its least rigidity
    SLOWED_SELF_COLLISION = 13  #: along the twist, slower: parts of the robot come to each other
    SLOWED_OBJECT = 14  #: along the twist, slower: the robot comes to the object beside the grip
    SLOWED_UTILISATION = 15  #: along the twist, slower: a tube comes to its wrinkling moment
    UNREACHABLE = 20  #: the nearest twist that the rollers can bring about, perhaps slower
    SLIDING = 21  #: the nearest twist that limits allow, along them: sliding was asked for
    HALT_NO_TWIST = 30  #: no twist yet, or the last one is too old
    HALT_INVALID_TWIST = 31
    HALT_NO_JOINT_STATES = 32
    HALT_STALE_JOINT_STATES = 33
    HALT_INVALID_JOINT_STATES = 34
    HALT_NO_OBJECT_POSE = 35
    HALT_STALE_OBJECT_POSE = 36
    HALT_INVALID_OBJECT_POSE = 37
    HALT_NO_GRASP = 38  #: the object is not between the two sides at the grip module
    HALT_KINEMATICS = 39  #: no configuration fits, or the program was not solved
    HALT_EMERGENCY_STOP = 40
    HALT_CLOCK = 41  #: the clock stands still
    HALT_INVALID_FAILED_ROLLERS = 42
    HALT_NOT_HELD = 43  #: the squeeze is regulated, and no equilibrium holds the object

    def __str__(self) -> str:
        """Return the name in words."""
        return self.name.lower().replace('_', ' ')
