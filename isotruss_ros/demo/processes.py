# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes as processes, which run while a `with` block is executed."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
import contextlib
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
from types import FrameType

from isotruss_ros.core import IsotrussError
from isotruss_ros.demo.domains import DomainLock, lock_domain
from isotruss_ros.nodes.framework import STOP_SIGNALS

#: Time after Ctrl-C at which a node that still runs is killed [s].
STOP_TIMEOUT = 30.0
#: Domain locks of this process; they are kept until it ends.
_locks: list[DomainLock] = []


def handle_stops() -> None:
    """Let SIGTERM and SIGHUP interrupt this process as Ctrl-C does, so that its nodes end too."""
    for which in STOP_SIGNALS:
        signal.signal(which, signal.default_int_handler)


class NodeError(IsotrussError, RuntimeError):
    """Error: the process of a node ended unexpectedly, or did not stop."""


class NodeProcess:
    """
    Process of one running node.

    :param ros_arguments: further arguments of the node, which begin with `--ros-args`.
    """

    def __init__(
        self,
        name: str,
        parameters: Mapping[str, object],
        log: Path,
        ros_arguments: Sequence[str] = (),
    ) -> None:
        self.name = name
        self.log = log
        # Quoted, so that a text such as `{post: ...}` or a path with ` #` remains a text.
        arguments = [
            f'{key}:={json.dumps(value, ensure_ascii=False) if isinstance(value, str) else value}'
            for key, value in parameters.items()
        ]
        with log.open('wb') as output:
            self.process = subprocess.Popen(
                [
                    sys.executable,
                    '-m',
                    'isotruss_ros.executables',
                    name,
                    '--ros-args',
                    *(part for argument in arguments for part in ('-p', argument)),
                    *ros_arguments,
                ],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                # A Ctrl-C in the terminal is for the parent, which stops its children in order.
                start_new_session=True,
            )

    def require_running(self) -> None:
        """Raise NodeError if the node is not running."""
        if self.process.poll() is not None:
            printed = self.log.read_text(errors='replace').strip().splitlines()[-5:]
            raise NodeError(
                f'node {self.name} ended with code {self.process.returncode}: '
                + ' | '.join(printed)
            )

    def find_line(self, start: str) -> str | None:
        """Return the first complete printed line with a certain start; None before."""
        lines = self.log.read_text(errors='replace').splitlines(keepends=True)
        found = (line.rstrip() for line in lines if line.startswith(start) and line[-1] == '\n')
        return next(found, None)

    def interrupt(self) -> None:
        """Send Ctrl-C to the node."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)

    def stop(self) -> int:
        """Send Ctrl-C, wait for the end of the process, and return its exit code, see `wait`."""
        self.interrupt()
        return self.wait()

    def wait(self) -> int:
        """Wait for the end of the process, kill it after a timeout, and return its exit code."""
        try:
            return self.process.wait(STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()


@contextlib.contextmanager
def deferred_interrupts() -> Iterator[Callable[[], None]]:
    """
    Defer signals that end a program, which at any point would leave nodes or break rclpy.

    :return: function that raises KeyboardInterrupt after a signal; the `with` block ends with it.
    """
    received: list[int] = []

    def keep(which: int, _frame: FrameType | None) -> None:
        received.append(which)

    def check() -> None:
        if received:
            raise KeyboardInterrupt

    before = {which: signal.signal(which, keep) for which in STOP_SIGNALS}
    try:
        yield check
    finally:
        for which, handler in before.items():
            signal.signal(which, handler)
    check()


@contextlib.contextmanager
def running_nodes(
    nodes: Sequence[tuple[str, Mapping[str, object]]],
    logs: Path,
    ros_arguments: Sequence[str] = (),
) -> Iterator[list[NodeProcess]]:
    """
    Run nodes as processes while a `with` block is executed.

    :param ros_arguments: further arguments of all nodes, which begin with `--ros-args`.
    """
    processes = []
    try:
        with deferred_interrupts():
            for name, parameters in nodes:
                log = logs / f'{name}.log'
                processes.append(NodeProcess(name, parameters, log, ros_arguments))
        yield processes
    finally:
        with deferred_interrupts():
            for process in reversed(processes):
                process.interrupt()
            for process in reversed(processes):
                process.wait()


def parse_arguments(
    parser: argparse.ArgumentParser, arguments: Sequence[str] | None
) -> tuple[argparse.Namespace, list[str]]:
    """Return the options of a program, and the ROS arguments after them for its nodes."""
    options, ros_arguments = parser.parse_known_args(arguments)
    if ros_arguments and ros_arguments[0] != '--ros-args':
        parser.error(f'unrecognized arguments: {" ".join(ros_arguments)}')
    return options, ros_arguments


def keep_to_this_machine() -> int:
    """
    Restrict ROS communication of this process and its children to this machine.

    :return: ROS domain id, taken from the environment if set there, otherwise one that is locked
        until this process ends.
    """
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    if not os.environ.get('ROS_DOMAIN_ID'):
        _locks.append(lock_domain(os.getpid()))
        os.environ['ROS_DOMAIN_ID'] = str(_locks[-1].number)
    return int(os.environ['ROS_DOMAIN_ID'])
