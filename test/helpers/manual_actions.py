# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Actions and parameters that nodes of a manual world request of each other, without DDS."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Thread
from types import ModuleType, SimpleNamespace
from typing import Any

from action_msgs.msg import GoalStatus
from isotruss_ros import workers
from isotruss_ros.nodes.pick_and_place import action_steps
from manual_world import Goal, World
import pytest
from rclpy.client import Client
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectoryPoint


class Outcome:
    """Stand-in for the future of a goal's result; without a goal it is unknown to the server."""

    def __init__(self, goal: Goal | None) -> None:
        self._goal = goal

    def done(self) -> bool:
        return self._goal is None or self._goal.ended

    def result(self) -> SimpleNamespace:
        if self._goal is None:
            return SimpleNamespace(status=GoalStatus.STATUS_UNKNOWN)
        status, result = self._goal.result()
        return SimpleNamespace(status=status, result=result)


class ManualActionClient:
    """Stand-in for a client of an action whose server is in a manual world."""

    def __init__(self, w: World, kind: Any) -> None:
        self._world, self._kind = w, kind
        self._goals: dict[bytes, Goal] = {}

    def server_is_ready(self) -> bool:
        return bool(self._world.find_servers(self._kind.Goal))

    def send_goal_async(self, request: Any, note: Callable[[Any], None], goal_id: Any) -> Future:
        """Send a goal; its feedback goes to a function."""
        goal = self._world.begin_goal(
            request, list(goal_id.uuid), lambda part: note(SimpleNamespace(feedback=part))
        )
        if goal.accepted:
            self._goals[bytes(goal_id.uuid)] = goal
        return _finished(SimpleNamespace(accepted=goal.accepted, cancel_goal_async=goal.cancel))

    def _get_result_async(self, handle: Any) -> Outcome:
        return Outcome(self._goals.get(bytes(handle.goal_id.uuid)))


class MotionClient:
    """Client of a motion whose stand-in server ends it with a result or when cancelled."""

    def __init__(self, result: Any = None) -> None:
        self.goal: Any = None
        self._result, self._ended = result, Future()
        self._id, self._note = b'', lambda _: None
        self.desired = JointTrajectoryPoint()  #: desired state in the feedback

    def server_is_ready(self) -> bool:
        """Publish feedback; return whether the server is there."""
        part = SimpleNamespace(progress=0.0, desired=self.desired)
        self._note(SimpleNamespace(feedback=part))
        return True

    def send_goal_async(self, goal: Any, note: Callable[[Any], None], goal_id: Any) -> Future:
        """Send a goal; its feedback goes to a function."""
        self.goal, self._note, self._id = goal, note, bytes(goal_id.uuid)
        if self._result is not None:
            self._end()
        return _finished(SimpleNamespace(accepted=True, cancel_goal_async=self._end))

    def _end(self) -> None:
        succeeded = GoalStatus.STATUS_SUCCEEDED
        self._ended.set_result(SimpleNamespace(status=succeeded, result=self._result))

    def _get_result_async(self, handle: Any) -> Future:
        if bytes(handle.goal_id.uuid) == self._id:
            return self._ended
        return _finished(SimpleNamespace(status=GoalStatus.STATUS_UNKNOWN))


def replace_clients(patch: pytest.MonkeyPatch, module: ModuleType, make: Callable) -> None:
    """Replace the action clients of rclpy by those of a function of node, type and name."""
    # By the name in the module that creates them: nodes and commands have no parameter for it.
    patch.setattr(module, 'ActionClient', make)


def connect(w: World, patch: pytest.MonkeyPatch) -> None:
    """Connect the clients that nodes of a world create from now on to its servers."""

    def call(client: Client, request: Any) -> Future:
        return _finished(w.call(client.srv_name, request))

    def is_ready(client: Client) -> bool:
        names = (service.service_name for node in w.nodes for service in node.services)
        return f'/{client.srv_name}' in names

    replace_clients(patch, action_steps, lambda _, kind, __: ManualActionClient(w, kind))
    patch.setattr(Client, 'call_async', call)
    patch.setattr(Client, 'service_is_ready', is_ready)
    # A search computes at once: no thread and no process, whose time is not the test's.
    patch.setattr(Thread, 'start', Thread.run)
    patch.setattr(workers, 'WorkerExecutor', lambda *_, **__: ThreadPoolExecutor(1))


def _finished(value: Any) -> Future:
    future = Future()
    future.set_result(value)
    return future
