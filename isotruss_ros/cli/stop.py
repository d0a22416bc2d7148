# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Command `isotruss stop`, an emergency stop from a terminal.

Calls the service `emergency_stop` of the node `manipulation` until it responds. Near people, use a
button that publishes on the topic `emergency_stop`, and that cuts the power of the drives.
"""

# Only rclpy is imported, because the import of NumPy and of the core takes a second.
from __future__ import annotations

import argparse
from collections.abc import Sequence
import os
import sys
import tempfile
import time

import rclpy
from rclpy.context import Context
from rclpy.exceptions import InvalidNamespaceException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from rclpy.utilities import remove_ros_args
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


class Caller:
    """Participant of DDS that calls the service."""

    def __init__(self, arguments: Sequence[str], namespace: str) -> None:
        self._context = Context()
        rclpy.init(args=list(arguments), context=self._context)
        self._node = Node(
            'isotruss_stop',
            namespace=namespace,
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._client = self._node.create_client(Trigger, SERVICE)
        self.service = self._node.resolve_service_name(SERVICE)
        self._sent: list[Future] = []
        self._due = 0.0

    def try_once(self) -> Trigger.Response | None:
        """Call the service if it is there and the last call is old; return a response, if any."""
        if time.monotonic() >= self._due and self._client.service_is_ready():
            self._sent.append(self._client.call_async(Trigger.Request()))
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
        rclpy.shutdown(context=self._context)


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Stop the robot, and print the response of the node `manipulation`.

    :return: 0 if it has stopped and all drives have acknowledged zero; 1 if not; 130 after Ctrl-C.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    parser = argparse.ArgumentParser(prog='isotruss', description=__doc__)
    kinds = parser.add_subparsers(required=True)
    stop = kinds.add_parser('stop', help='emergency stop')
    stop.add_argument('--namespace', default='', help='namespace of the robot, such as /left')
    callers: list[Caller] = []
    if not any(map(os.environ.get, ('ROS_LOG_DIR', 'ROS_HOME', 'HOME'))):
        os.environ['ROS_LOG_DIR'] = tempfile.gettempdir()  # without a folder for logs, ROS fails
    try:
        options = parser.parse_args(remove_ros_args(['isotruss', *words])[1:])
        return _stop(callers, words, options.namespace)
    except (RuntimeError, ValueError, InvalidNamespaceException) as error:
        why = ' '.join(str(error).partition(', at /')[0].split())
        print(f'isotruss stop: {why}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('isotruss stop: NOT CONFIRMED: interrupted; press the stop button', file=sys.stderr)
        return 130
    finally:
        for caller in callers:
            caller.close()


def _stop(callers: list[Caller], arguments: Sequence[str], namespace: str) -> int:
    """Call the service until there is a response; more callers are added to the list."""
    begun = time.monotonic()
    while (waited := time.monotonic() - begun) < TIMEOUT:
        if waited >= DISCOVERY_PERIOD * len(callers) and not any(c.was_sent() for c in callers):
            callers.append(Caller(arguments, namespace))
        for caller in callers:
            if (answer := caller.try_once()) is not None:
                print(f'{SERVICE}: {answer.message}')
                return 0 if answer.success else 1
    service = callers[0].service
    if any(caller.was_sent() for caller in callers):
        why = f'the service {service} was called, and has not responded in {TIMEOUT:g} s'
    else:
        # The words of `describe_absence`.
        why = (
            f'no node offers the service {service} in {TIMEOUT:g} s: check that manipulation '
            'runs, its namespace, and ROS_DOMAIN_ID'
        )
    print(f'isotruss stop: NOT CONFIRMED: {why}; press the stop button', file=sys.stderr)
    return 1


if __name__ == '__main__':
    sys.exit(main())
