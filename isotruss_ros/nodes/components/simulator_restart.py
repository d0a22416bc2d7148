# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The node `simulator` configured anew, by its lifecycle services."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from isotruss_ros.nodes.conversions.messages import request_parameters
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.task import Future

SIMULATOR = 'simulator'


class SimulatorRestart:
    """
    Clients of the simulator.

    :param node: has the clients.
    :param report: called with what becomes of a restart, in words.
    """

    def __init__(self, node: Node, report: Callable[[str], None]) -> None:
        self._report = report
        self._restarts = 0
        self._change = node.create_client(ChangeState, f'{SIMULATOR}/change_state')
        self._set = node.create_client(SetParameters, f'{SIMULATOR}/set_parameters')

    def restart(self, plant: str = '') -> None:
        """
        Configure the simulator anew: the robot begins at home.

        A restart that is under way takes no further step.

        :param plant: value of its parameter `plant`; as it is if empty.
        """
        name = f'plant {plant}' if plant else 'reset'
        if not (self._change.service_is_ready() and self._set.service_is_ready()):
            self._report(f'{name}: there is no simulator')
            return
        self._restarts += 1
        # The first two fail where it is inactive or unconfigured already.
        steps: list[tuple[str, Any]] = [
            ('', self._transition(Transition.TRANSITION_DEACTIVATE)),
            ('', self._transition(Transition.TRANSITION_CLEANUP)),
        ]
        if plant:
            request = request_parameters({'plant': plant})
            steps.append(('cannot be set', lambda: self._set.call_async(request)))
        steps += [
            ('cannot be configured', self._transition(Transition.TRANSITION_CONFIGURE)),
            ('cannot be activated', self._transition(Transition.TRANSITION_ACTIVATE)),
        ]
        self._take(name, self._restarts, steps)

    def _transition(self, which: int) -> Callable[[], Future]:
        request = ChangeState.Request(transition=Transition(id=which))
        return lambda: self._change.call_async(request)

    def _take(self, name: str, number: int, steps: list[tuple[str, Any]]) -> None:
        """Take the first step, and the others once it is done."""
        if not steps:
            self._report(f'{name}: active')
            return
        (fault, call), *others = steps

        def go_on(future: Future) -> None:
            if number != self._restarts:
                return
            response = future.result()
            results = getattr(response, 'results', None)
            good = response.success if results is None else results[0].successful
            if good or not fault:
                self._take(name, number, others)
                return
            reason = 'see the log of the simulator' if results is None else results[0].reason
            self._report(f'{name} {fault}: {reason}')

        call().add_done_callback(go_on)
