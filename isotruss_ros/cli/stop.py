# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Command `isotruss stop`, an emergency stop from a terminal.

Calls the service `emergency_stop` of the node `manipulation` until it responds. Near people, use a
button that publishes on the topic `emergency_stop`, and that cuts the power of the drives.
"""

# Only rclpy is imported, because the import of NumPy and of the core takes a second, and it is
# imported when the stop is requested, so that its absence is reported like every other failure.
from __future__ import annotations

import argparse
from collections.abc import Sequence
import os
import select
import signal
import sys
import time
from typing import Any, NoReturn, TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.task import Future
    from std_srvs.srv import Trigger

SERVICE = 'emergency_stop'
#: Longest time in which the stop is tried [s].
TIMEOUT = 10.0
#: Time after which the request is repeated [s]. A server sends no response to a client that it has
#: not discovered within 0.1 s.
RETRY_PERIOD = 0.2
#: Time after which a further participant searches for the server [s]. If a message of its
#: discovery was lost, DDS sends the next one only after 3 s.
DISCOVERY_PERIOD = 0.7
#: Longest time of the end of a participant [s], and of the start of a request on a busy machine,
#: which loads rclpy [s].
MARGIN, STARTING_TIME = 2, 10


class NotConfirmedError(Exception):
    """Error: the node did not confirm that the robot has stopped."""


class Caller:
    """Participant of DDS that calls the service; it writes no log."""

    def __init__(self, arguments: Sequence[str], namespace: str) -> None:
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node
        from std_srvs.srv import Trigger

        self._context = Context()
        # The log of ROS needs a folder that can be written; a stop does not.
        self._context.init(list(arguments), initialize_logging=False)
        self._node = Node(
            'isotruss_stop',
            namespace=namespace,
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._request = Trigger.Request()
        self._client = self._node.create_client(Trigger, SERVICE)
        self.service = self._node.resolve_service_name(SERVICE)
        self._sent: list[Future] = []
        self._due = 0.0

    def try_once(self) -> Trigger.Response | None:
        """Call the service if it is there and the last call is old; return a response, if any."""
        if time.monotonic() >= self._due and self._client.service_is_ready():
            self._sent.append(self._client.call_async(self._request))
            self._due = time.monotonic() + RETRY_PERIOD
        self._executor.spin_once(timeout_sec=0.01)
        return next((each.result() for each in self._sent if each.done()), None)

    def was_sent(self) -> bool:
        """Return whether the service was called."""
        return bool(self._sent)

    def close(self) -> None:
        """Leave DDS."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.shutdown()


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Stop the robot, and print STOPPED or NOT CONFIRMED with the reason, whatever happens.

    A child process makes the request, because the middleware may end its process or hang.

    :return: 0 if it has stopped and all drives have acknowledged zero; 1 if not; 2 for bad
        arguments; 130 after Ctrl-C.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    if {'-h', '--help'} & set(given):
        _parser().parse_args(given)  # prints the help, and ends the process
    code, words = 1, 'the process of the request ended without a response'
    child = 0
    try:
        for which in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(which, _interrupt)
        reader, writer = os.pipe()
        if not (child := os.fork()):
            _run_request(writer, given)
        os.close(writer)
        if not select.select([reader], [], [], STARTING_TIME + TIMEOUT)[0]:
            words = f'the process of the request hangs after {STARTING_TIME + TIMEOUT:g} s'
        elif report := os.read(reader, select.PIPE_BUF).decode(errors='replace'):
            number, _, words = report.partition(' ')
            code = int(number)
        if code == 0 and words:
            print(f'isotruss stop: STOPPED: {words}', flush=True)
    except KeyboardInterrupt:
        code, words = 130, 'interrupted'
    except OSError as error:
        code, words = 1, str(error)
    if code:
        print(f'isotruss stop: NOT CONFIRMED: {words}; press the stop button', file=sys.stderr)
    if child:
        if code:
            os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    return code


def _interrupt(*_: Any) -> NoReturn:
    """End the request on a signal, as Ctrl-C does."""
    raise KeyboardInterrupt


def _run_request(writer: int, arguments: Sequence[str]) -> NoReturn:
    """Write the exit code and the words of a request to a pipe, and end this process."""
    for which in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(which, signal.SIG_DFL)
    callers: list[Caller] = []
    try:
        report = f'0 {_stop(callers, arguments)}'
    except SystemExit as end:  # of the parser, which has printed the help or the bad argument
        report = f'{end.code} these arguments are not known' if end.code else '0 '
    except BaseException as error:  # noqa: BLE001 - the reader must know that nothing is confirmed
        # The reason is followed by source lines of rcl.
        why = ' '.join(str(error).partition(', at /')[0].split())
        is_known = isinstance(error, NotConfirmedError)
        report = f'1 {why if is_known else f"{type(error).__name__}: {why}"}'
    os.write(writer, report.encode(errors='replace')[: select.PIPE_BUF])
    signal.alarm(MARGIN)
    try:
        for caller in callers:
            caller.close()
    finally:
        os._exit(0)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='isotruss', description=__doc__)
    stop = parser.add_subparsers(required=True).add_parser('stop', help='emergency stop')
    stop.add_argument('--namespace', default='', help='namespace of the robot, such as /left')
    return parser


def _stop(callers: list[Caller], words: Sequence[str]) -> str:
    """Call the service until it responds, and return its message; callers are added to a list."""
    from rclpy.utilities import remove_ros_args

    namespace = _parser().parse_args(remove_ros_args(['isotruss', *words])[1:]).namespace
    begun = time.monotonic()
    while (waited := time.monotonic() - begun) < TIMEOUT:
        is_late = waited >= DISCOVERY_PERIOD * len(callers)
        if is_late and (len(callers) < 2 or not any(c.was_sent() for c in callers)):
            callers.append(Caller(words, namespace))
            # Shared memory of another user may be readable only.
            os.environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
        for caller in callers:
            if (answer := caller.try_once()) is not None:
                if answer.success:
                    return answer.message
                raise NotConfirmedError(answer.message)
    service = callers[0].service
    if any(caller.was_sent() for caller in callers):
        raise NotConfirmedError(
            f'the service {service} was called, and has not responded in {TIMEOUT:g} s: if '
            'another user runs the node, call it as that user'
        )
    # The words of `describe_absence`.
    raise NotConfirmedError(
        f'no node offers the service {service} in {TIMEOUT:g} s: check that manipulation runs, '
        'its namespace, and ROS_DOMAIN_ID'
    )


if __name__ == '__main__':
    sys.exit(main())
