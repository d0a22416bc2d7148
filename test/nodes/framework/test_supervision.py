# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Heartbeats of the clients of goals."""

from action_msgs.msg import GoalInfo
from isotruss_ros.nodes.framework.supervision import ClientWatch, TOPIC
from manual_world import world

TIMEOUT = 0.2
OWN, OTHER = bytes(16), bytes(range(16))


def test_heartbeats_of_another_goal_do_not_replace_those_of_the_own_client():
    with world() as w:
        watch, beats = ClientWatch(w.probe), w.probe.create_publisher(GoalInfo, TOPIC, 1)

        def beat(*goals):
            for goal in goals:
                message = GoalInfo()
                message.goal_id.uuid = list(goal)
                beats.publish(message)

        w.spin(0.1, lambda: beat(OWN))
        watch.goal = OWN
        w.spin(1.0, lambda: beat(OWN, OTHER))
        assert watch.find_loss(TIMEOUT) is None
        w.spin(0.9 * TIMEOUT, lambda: beat(OTHER))
        assert watch.find_loss(TIMEOUT) is None
        w.spin(0.2 * TIMEOUT, lambda: beat(OTHER))
        assert 'has not published on supervised_goal for 0.2 s' in watch.find_loss(TIMEOUT)
