# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ROS domains of this machine, each locked by the run that uses it."""

from __future__ import annotations

from dataclasses import dataclass
import socket

from isotruss_ros.core.errors import IsotrussError

#: Not 0, which a robot may have on this very machine; up to 101 the ports are free on Linux.
DOMAINS = range(1, 102)
#: Abstract socket addresses of Linux: of the machine, as the ports are, not of a user or a folder,
#: and the kernel frees them with the process.
LOCK_NAME = '\0isotruss_ros_domain_{}'


class DomainError(IsotrussError, RuntimeError):
    """Every ROS domain is in use."""


@dataclass(frozen=True)
class DomainLock:
    """A lock of a ROS domain against other runs on this machine."""

    number: int  #: the domain id
    _socket: socket.socket

    def close(self) -> None:
        """Free the domain."""
        self._socket.close()


def lock_domain(first: int) -> DomainLock:
    """
    Lock the first free ROS domain of this machine.

    :param first: number with which the search begins, counted round `DOMAINS`.
    :raises DomainError: all of them are locked.
    """
    for turn in range(len(DOMAINS)):
        number = DOMAINS[(first - DOMAINS[0] + turn) % len(DOMAINS)]
        lock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            lock.bind(LOCK_NAME.format(number))
        except OSError:  # another run has it
            lock.close()
            continue
        return DomainLock(number, lock)
    raise DomainError(
        f'ROS domains {DOMAINS[0]} to {DOMAINS[-1]} are all locked by runs on this machine: '
        'end one of them'
    )
