# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Locks of the ROS domains of this machine, each held by the process that uses the domain."""

from __future__ import annotations

from dataclasses import dataclass
import socket

from isotruss_ros.core.errors import IsotrussError

#: Domains that may be used. Domain 0 is excluded, because a robot may use it on this machine; for
#: domains up to 101, Linux does not assign the ports to other programs.
DOMAINS = range(1, 102)
#: Abstract socket address of a domain's lock. All users of the machine share the address, and the
#: kernel frees it when the process ends.
LOCK_NAME = '\0isotruss_ros_domain_{}'


class DomainError(IsotrussError, RuntimeError):
    """Error: every ROS domain is in use."""


@dataclass(frozen=True)
class DomainLock:
    """Lock of a ROS domain, so that no other process on this machine uses it."""

    number: int  #: domain id
    _socket: socket.socket

    def close(self) -> None:
        """Unlock the ROS domain."""
        self._socket.close()


def lock_domain(first: int) -> DomainLock:
    """Lock the first ROS domain of this machine that is free."""
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
        f'ROS domains {DOMAINS[0]} to {DOMAINS[-1]} are all locked by processes on this machine: '
        'end one of them'
    )
