# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Commands that operate a running robot: what each sends, and its exit code."""

import math
from types import SimpleNamespace

from isotruss_msgs.action import MoveObject, PickObject
from isotruss_ros.cli import operate
from isotruss_ros.nodes.conversions.messages import read_pose
import pytest
import rclpy
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.task import Future
from std_srvs.srv import Trigger


@pytest.fixture(autouse=True)
def no_context():
    """End the context that other tests may have left, since a command begins its own."""
    if rclpy.ok():
        rclpy.shutdown()


def done(value):
    future = Future()
    future.set_result(value)
    return future


def read_target(goal):
    return read_pose('target', goal.path.poses[0].pose)


@pytest.mark.parametrize(
    ('words', 'result', 'read', 'sent'),
    [
        ('move 0.6 0.35 --angle 90', MoveObject.Result(), read_target, (0.6, 0.35, 0.5 * math.pi)),
        ('pick --squeeze 12', PickObject.Result(code=1), lambda goal: goal.squeeze, 12.0),
    ],
)
def test_numbers_are_sent_and_the_code_of_the_result_is_that_of_the_exit(
    words, result, read, sent, monkeypatch, capsys
):
    goals, result.message = [], 'the end'

    def send(goal):
        goals.append(goal)
        ended = done(SimpleNamespace(result=result))
        return done(SimpleNamespace(accepted=True, get_result_async=lambda: ended))

    client = SimpleNamespace(wait_for_server=lambda _: True, send_goal_async=send)
    # The server of another node; the command has no parameter for its type.
    monkeypatch.setattr(operate, 'ActionClient', lambda *_: client)
    assert operate.main(words.split()) == (result.code != 0)
    assert capsys.readouterr().out.endswith('_object: the end\n')
    assert [read(goal) for goal in goals] == [pytest.approx(sent)]


@pytest.mark.parametrize('last_message', [True, False])
def test_release_publishes_false_only_after_a_refusal(last_message, monkeypatch):
    published = []

    def publish(publisher, message):
        if publisher.topic_name == '/emergency_stop':
            published.append(message.data)

    def call(_request):
        return done(Trigger.Response(success=not last_message or published == [False]))

    client = SimpleNamespace(wait_for_service=lambda _: True, call_async=call)
    monkeypatch.setattr(Node, 'create_client', lambda *_: client)
    monkeypatch.setattr(Publisher, 'publish', publish)
    assert operate.main(['release']) == 0
    assert published == [False] * last_message
