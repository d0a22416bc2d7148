# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Commands that operate a running robot: what each sends, and its exit code."""

import math
from types import SimpleNamespace

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import MoveObject, PickObject
from isotruss_ros.cli import operate
from isotruss_ros.core import Pose
from isotruss_ros.nodes.conversions.messages import to_pose_message
from manual_actions import replace_clients
from nav_msgs.msg import Path
import pytest
import rclpy
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.task import Future
from std_srvs.srv import Trigger

POSE = PoseStamped(pose=to_pose_message(Pose(0.6, 0.35, 0.5 * math.pi)))
TARGET = MoveObject.Goal(path=Path(poses=[POSE]))


def done(value):
    future = Future()
    future.set_result(value)
    return future


@pytest.mark.parametrize(
    ('words', 'result', 'goal'),
    [
        ('move 0.6 0.35', MoveObject.Result(), TARGET),
        ('move 0.6 0.35 --angle 90', MoveObject.Result(), TARGET),
        ('pick --squeeze 12', PickObject.Result(code=1), PickObject.Goal(squeeze=12.0)),
    ],
)
def test_numbers_are_sent_and_the_code_is_the_exit_code(words, result, goal, monkeypatch, capsys):
    rclpy.try_shutdown()  # a command begins a context of its own
    goals, result.message = [], 'the end'

    def send(request):
        goals.append(request)
        ended = done(SimpleNamespace(result=result))
        return done(SimpleNamespace(accepted=True, get_result_async=lambda: ended))

    client = SimpleNamespace(
        wait_for_server=lambda _: True,
        send_goal_async=send,
        _get_result_async=lambda _handle: done(None),
    )
    replace_clients(monkeypatch, operate, lambda *_: client)
    # The object has the angle of the target already.
    monkeypatch.setattr(Node, 'create_subscription', lambda _, __, topic, call, ___: call(POSE))
    assert operate.main(words.split()) == (result.code != 0)
    assert capsys.readouterr().out.endswith('_object: the end\n')
    assert goals == [goal]


def test_the_errors_at_the_end_of_a_motion_are_printed(monkeypatch, capsys):
    rclpy.try_shutdown()
    result = MoveObject.Result(message='the end', position_error=0.0019, angle_error=0.028)
    ended = done(SimpleNamespace(result=result))
    handle = SimpleNamespace(accepted=True, get_result_async=lambda: ended)
    client = SimpleNamespace(
        wait_for_server=lambda _: True,
        send_goal_async=lambda _: done(handle),
        _get_result_async=lambda _handle: done(None),
    )
    replace_clients(monkeypatch, operate, lambda *_: client)
    assert operate.main(['move', '0.6', '0.35', '--angle', '90']) == 0
    assert capsys.readouterr().out.endswith('the end; 1.9 mm and 1.6° from the target\n')


def test_a_move_without_angle_and_measured_pose_asks_for_the_angle(monkeypatch, capsys):
    rclpy.try_shutdown()
    monkeypatch.setattr(operate, 'DISCOVERY_TIMEOUT', 0.1)
    assert operate.main(['move', '0.6', '0.35', '--namespace', '/nowhere']) == 1
    assert '/nowhere/object_pose: no pose in 0.1 s; give --angle' in capsys.readouterr().err


@pytest.mark.parametrize('last_message', [True, False])
def test_release_publishes_false_only_after_a_refusal(last_message, monkeypatch):
    rclpy.try_shutdown()
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


def test_a_lost_response_is_asked_for_again(monkeypatch):
    monkeypatch.setattr('isotruss_ros.nodes.pick_and_place.action_steps.RETRY_TICKS', 2)
    rclpy.try_shutdown()
    sent = [Future(), done(Trigger.Response(success=True))]  # the first is lost
    client = SimpleNamespace(wait_for_service=lambda _: True, call_async=lambda _: sent.pop(0))
    monkeypatch.setattr(Node, 'create_client', lambda *_: client)
    assert operate.main(['resume']) == 0


def test_clear_obstacles_calls_the_service_and_prints_its_answer(monkeypatch, capsys):
    rclpy.try_shutdown()
    asked, answer = [], Trigger.Response(success=True, message='cleared moving obstacles: hand')

    def create_client(_node, _kind, name):
        asked.append(name)
        return SimpleNamespace(wait_for_service=lambda _: True, call_async=lambda _: done(answer))

    monkeypatch.setattr(Node, 'create_client', create_client)
    assert operate.main(['clear-obstacles']) == 0
    assert asked == ['clear_obstacles']
    assert 'cleared moving obstacles: hand' in capsys.readouterr().out
