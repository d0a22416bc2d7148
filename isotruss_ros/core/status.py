"""How a twist was answered."""

from __future__ import annotations

import enum


class Status(enum.IntEnum):
    """The codes of `RollerCommand.status`, the same as in isotruss_msgs/ManipulationStatus."""

    OK = 0  #: the twist is carried out
    IDLE = 1  #: the twist is zero, and so is the command
    SLOWED_ROLLER_SPEED = 10  #: along the twist, slower: a roller is at its largest speed
    SLOWED_MEMBER_LENGTH = 11  #: along the twist, slower: a member comes to its length limit
    UNREACHABLE = 20  #: the nearest twist that the rollers can bring about, perhaps slower

    def __str__(self) -> str:
        """Return the name in words."""
        return self.name.lower().replace('_', ' ')
