# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects of four shapes are picked, moved and placed, by simulated time."""

from collections.abc import Iterable
import math
import time

from action_msgs.msg import GoalStatus
from geometry_msgs.msg import TwistStamped
from isotruss_msgs.action import MoveObject
from isotruss_ros.nodes.conversions.messages import read_stamp
import numpy as np
from picking import APART, CENTER, Client, path_to, PICK
from probe import Probe
import pytest
from rclpy.clock import Clock, ClockType
from robot_processes import robot

pytestmark = [pytest.mark.system, pytest.mark.xdist_group('pick and place')]

#: Time waits for the nodes: what they do is the same on a busy machine.
PACED = {'use_sim_time': True, 'use_stamped_twist': True, 'command_timeout': 10.0}
#: Descriptions of the objects.
SHAPES = {
    'disc': '{shape: disc, diameter: 0.2, mass: 0.5, friction: 0.8}',
    'ellipse': '{shape: ellipse, semi_axes: [0.12, 0.1], mass: 0.5, friction: 0.8}',
    'box': '{shape: polygon, vertices: [[-0.12, -0.1], [0.12, -0.1], [0.12, 0.1], [-0.12, 0.1]],'
    ' corner_radius: 0.02, mass: 0.5, friction: 0.8}',
    'hexagon': '{shape: polygon, vertices: [[0.12, 0], [0.06, 0.104], [-0.06, 0.104], [-0.12, 0],'
    ' [-0.06, -0.104], [0.06, -0.104]], corner_radius: 0.02, mass: 0.5, friction: 0.8}',
}
#: Shape and seed of its poses; objects with faces turn to other members in the second one.
CASES = (
    ('disc', 0),
    ('ellipse', 1),
    ('box', 0),
    ('box', 3),
    ('hexagon', 2),
    ('hexagon', 5),
)
#: Step of the clock, at most in real time [s].
STEP = 0.01
#: Largest ages of the last message of each source, two periods of its node [s].
LARGEST_AGES = {'joints': 0.04, 'status': 0.04, 'twist': 0.04, 'state': 0.1}
#: Wall time after which a source without messages is not awaited until its next one [s].
PATIENCE = 2.0


class PacedClock:
    """
    Publishes `/clock`: a step after all nodes that publish have published for the last ones.

    :param probe: probe by simulated time, which hears the nodes.
    :param nodes: names of the nodes; the first step is when all of them hear the clock.
    """

    def __init__(self, probe: Probe, nodes: Iterable[str]) -> None:
        self._probe, self._time, self._stepped = probe, 0.0, time.monotonic()
        self._deaf = set(nodes)
        self._silent = dict.fromkeys(LARGEST_AGES, 0)
        probe.listen(TwistStamped, 'twist', 'cmd_vel')
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        probe.create_timer(0.2 * STEP, self._advance, clock=steady)

    def _advance(self) -> None:
        if self._deaf:
            infos = self._probe.get_subscriptions_info_by_topic('/clock')
            self._deaf -= {info.node_name for info in infos}
            return
        waited = time.monotonic() - self._stepped
        late = [key for key in LARGEST_AGES if self._is_late(key)]
        if waited < STEP or (late and waited < PATIENCE):
            return
        for key in late:
            self._silent[key] = len(self._probe.seen[key])
        self._time, self._stepped = self._time + STEP, time.monotonic()
        self._probe.tick(self._time)

    def _is_late(self, key: str) -> bool:
        """Return whether the last message of a source, if it publishes, is too old."""
        count = len(self._probe.seen[key])
        if count == self._silent[key]:
            return False
        stamp = read_stamp(self._probe.last(key).header)
        return math.isfinite(stamp) and self._time - stamp > LARGEST_AGES[key]


@pytest.mark.nightly
@pytest.mark.parametrize(('shape', 'seed'), CASES)
def test_an_object_is_picked_where_it_was_placed(tmp_path, shape, seed):
    rng = np.random.default_rng([seed, list(SHAPES).index(shape)])
    lies = np.array([*CENTER, 0.0]) + rng.uniform(-1.0, 1.0, 3) * (0.03, 0.03, 3.0)
    there = lies + rng.uniform(-1.0, 1.0, 3) * (0.04, 0.04, 0.1)
    file = tmp_path / 'object.yaml'
    file.write_text(SHAPES[shape], encoding='utf-8')
    with robot(tmp_path, sim_time=True, twist_type=TwistStamped) as r:
        client = Client(r, lies.tolist(), object=str(file), **PACED)
        client.start_missing()
        PacedClock(r.w.probe, r.alive)
        for goal in (PICK, MoveObject.Goal(path=path_to(*there)), APART, PICK):
            status, result = client.execute(goal)
            assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.message
            if isinstance(goal, MoveObject.Goal):
                assert np.hypot(*(client.place() - there[:2])) < 1e-2
