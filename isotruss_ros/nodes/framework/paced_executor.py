# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""An executor for nodes with a control cycle: rclpy's wait set does not run in every cycle."""

from __future__ import annotations

import time

from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.ready_check import ReadyCheck
from rclpy.executors import SingleThreadedExecutor, TimeoutException

#: Services, actions, parameters, events and slow timers get their turn this often [s].
TURN_PERIOD = 0.05


class PacedExecutor(SingleThreadedExecutor):
    """
    Run the cycle of a node by the clock, and all other callbacks in turns between the cycles.

    For every wait, rclpy collects all entities of the node anew, in Python: that takes a multiple
    of the arithmetic of a cycle, which reads its inputs itself. So a turn begins with a check
    whether there is anything to call back, with entities collected once.

    :param node: the only one that is executed.
    """

    def __init__(self, node: ManagedNode) -> None:
        super().__init__()
        self._check: ReadyCheck | None = None
        self.add_node(node)
        self._node = node
        self._next_turn = 0.0

    def wake(self) -> None:
        """Collect entities anew: rclpy calls this when any are made or destroyed."""
        self._check = None
        super().wake()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """
        Run the next cycle, or a turn of the other callbacks; without a cycle as rclpy does.

        :param timeout_sec: without a cycle, longest wait [s].
        :raises Exception: what a callback has raised.
        """
        cycle = self._node.cycle
        if cycle is None or not cycle.is_faster_than(TURN_PERIOD):
            super().spin_once(timeout_sec)
            return
        now = time.monotonic()
        if now < self._next_turn:
            cycle.run_next()
        else:
            self._next_turn = now + TURN_PERIOD
            self._execute_waiting()

    def _execute_waiting(self) -> None:
        """Execute the callbacks that are ready, each once."""
        if not self._finds_any():
            return
        while True:
            try:
                handler, _entity, _node = self.wait_for_ready_callbacks(timeout_sec=0.0)
            except TimeoutException:
                return
            handler()
            handler.result()  # raises what the callback has raised

    def _finds_any(self) -> bool:
        """Return whether a callback may be ready."""
        if self._check is None:
            self._check = ReadyCheck(self._node, self._node.cycle.timer)
            return True
        return not all(task.done() for task, _, _ in self._tasks) or self._check.finds_any()
