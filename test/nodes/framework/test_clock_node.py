# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulated time, clocks that jump, and nodes as processes run them, cycle by cycle."""

import contextlib
import time

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, Twist
from isotruss_msgs.msg import GraspState
from isotruss_ros.core import Status
from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.framework.cycle import PacedExecutor
from isotruss_ros.nodes.framework.managed import log_refusals
from isotruss_ros.nodes.framework.topics import subscribe_newest
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import EPOCH, moving_world, world
import numpy as np
from probe import begin_context, DEADLINE, maker, manipulation, N, Probe
import pytest
import rclpy
from rclpy.executors import Executor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

simulator = maker(Simulator)
START = 1000.0
STEP = 0.004
#: Turns the second roller.
COMMAND = [0.0, 0.02, *[0.0] * (N - 2)]


def moving(w):
    last = w.probe.last('joints')
    return last is not None and last.velocity[1] > 0.0


class SimulatedTime:
    """A clock that advances as the test spins, once all nodes have received its time."""

    def __init__(self, w, now=START):
        self.w, self.now = w, now

    def is_known(self):
        clocks = [node.get_clock() for node in self.w.nodes]
        return all(abs(1e-9 * c.now().nanoseconds - self.now) < 1e-6 for c in clocks)

    def run(self, send=lambda: None):
        def advance():
            if self.is_known():
                send()
                self.now += STEP
            self.w.probe.tick(self.now)

        return advance

    def jump(self, to):
        """Set the clock, and wait until all nodes have received its time."""
        self.now = to
        self.w.until(self.is_known, lambda: self.w.probe.tick(to))


def simulated(make, *others):
    makers = [kind(use_sim_time=True) for kind in (make, *others)]
    return world(*makers, sim_time=True)


@contextlib.contextmanager
def moving_in_simulated_time():
    """Yield a world in which manipulation moves the object, and its clock."""
    with simulated(manipulation) as w:
        time = SimulatedTime(w)
        w.until_code(Status.OK, time.run(w.probe.send_all))
        yield w, time


def since_jump(w, by):
    """Return the statuses since the clock was set by so much; those before may come late."""
    statuses = [m for _, m in w.probe.seen['status']]
    steps = np.diff([read_stamp(m.header) for m in statuses])
    jumps = 1 + np.flatnonzero(steps < 0.0 if by < 0.0 else steps > 0.5 * by)
    first = jumps[0] if len(jumps) else len(statuses)
    return statuses[first:]


def test_runs_by_simulated_time():
    with simulated(simulator, manipulation) as w:
        time = SimulatedTime(w)
        w.until_code(Status.OK, time.run(w.probe.send_twist))
        w.probe.seen['status'].clear()
        w.probe.seen['joints'].clear()
        begin = time.now
        w.until(lambda: len(w.probe.seen['status']) > 50, time.run(w.probe.send_twist))
        elapsed = time.now - begin
        # By its own clock the loop has its rate, and the motion its speed.
        assert len(w.probe.seen['status']) == pytest.approx(100.0 * elapsed, rel=0.05)
        moving = [m for _, m in w.probe.seen['joints'] if any(m.velocity)]
        first, last = moving[0], moving[-1]
        passed = read_stamp(last.header) - read_stamp(first.header)
        way = np.abs(np.subtract(last.position, first.position)).max()
        speed = np.abs([m.velocity for m in moving]).max(axis=0).max()
        assert passed > 0.3
        assert way == pytest.approx(speed * passed, rel=0.1)


def test_halts_without_any_time_and_while_the_clock_is_stopped():
    with simulated(manipulation) as w:
        status = w.until_code(Status.HALT_CLOCK, w.probe.send_all)
        assert 'simulated time' in status.message
        assert not any(any(m.data) for _, m in w.probe.seen['command'])
        time = SimulatedTime(w)
        w.until_code(Status.OK, time.run(w.probe.send_all))
        # Inputs go on, with the stamp of the last time there was.
        stopped = w.now
        w.until_code(Status.HALT_CLOCK, w.probe.send_all)
        assert w.now - stopped < 0.2 + 0.05
        assert not w.command().any()
        w.probe.seen['status'].clear()
        w.until(lambda: len(w.probe.seen['status']) > 3, w.probe.send_all)
        assert {m.code for _, m in w.probe.seen['status']} == {Status.HALT_CLOCK}
        w.until_code(Status.OK, time.run(w.probe.send_all))


@pytest.mark.parametrize('by', [-0.05, -900.0, 0.5, 1e6])
def test_halts_when_the_clock_jumps_until_inputs_are_new(by):
    with moving_in_simulated_time() as (w, time):
        del w.probe.seen['status'][:-1]
        begin = time.now + by
        time.jump(begin)

        def over():
            reported = since_jump(w, by)
            return reported and read_stamp(reported[-1].header) >= begin + 0.1

        w.until(over, time.run())
        assert all(m.code >= Status.HALT_NO_TWIST for m in since_jump(w, by))
        assert not w.command().any()
        w.until_code(Status.OK, time.run(w.probe.send_all))


@pytest.mark.parametrize('by', [0.5, 50.0])
def test_a_jump_of_the_clock_does_not_change_the_measured_rate(by):
    with moving_in_simulated_time() as (w, time):
        time.jump(time.now + by)
        w.probe.seen['status'].clear()
        begin = time.now
        w.until(lambda: time.now > begin + 1.5, time.run(w.probe.send_all))
        assert w.nodes[1].cycle.rate > 0.8 * w.nodes[1].values.rate
        assert not [m for _, m in w.probe.seen['status'] if 'the loop reaches' in m.message]


def test_the_analysis_discards_inputs_from_before_a_jump_back():
    with simulated(maker(GraspAnalysisNode)) as w:
        time = SimulatedTime(w)

        w.until_code(GraspState.OK, time.run(w.probe.send_all), 'state')
        time.jump(time.now - 0.05)
        w.until_code(GraspState.NO_JOINT_STATES, time.run(), 'state')
        w.until_code(GraspState.OK, time.run(w.probe.send_all), 'state')


def test_time_before_zero_is_not_taken():
    with moving_in_simulated_time() as (w, time):
        log_refusals(w.probe)
        for sec, nanosec in ((-1, 0), (-(2**31), 0), (-1, 2**32 - 1)):
            w.probe.clock.publish(Clock(clock=Time(sec=sec, nanosec=nanosec)))
            w.spin(0.05)  # the next one would take its place
        w.until_code(Status.OK, time.run(w.probe.send_all))
        assert read_stamp(w.probe.last('status').header) >= START


@pytest.mark.parametrize('by', [-0.1, -3600.0])
def test_stamps_of_the_system_clock_that_jumps_back_are_not_relied_on(by):
    """No simulated time here: the loop goes on, and stops in the cycle that sees the clock."""
    with moving_world() as w:
        del w.probe.seen['status'][:-1]
        w.shift = by
        w.until(lambda: len(since_jump(w, by)) > 3, w.probe.send_twist)
        assert all(m.code >= Status.HALT_NO_TWIST for m in since_jump(w, by))
        assert not np.any(w.command())
        w.until_code(Status.OK, w.probe.send_all)


@pytest.mark.parametrize('by', [-3600.0, 3600.0])
def test_the_simulated_robot_stops_when_the_system_clock_is_set(by):
    with world(simulator(command_timeout=0.5)) as w:
        w.until(lambda: moving(w), lambda: w.probe.send_command(COMMAND))
        travel = w.probe.last('joints').position[1]
        w.shift = by
        w.probe.seen['joints'].clear()
        w.until(lambda: len(w.probe.seen['joints']) > 20 and not moving(w))
        assert w.probe.last('joints').position[1] < travel + 0.02 * (0.5 + 0.02)
        stamp = read_stamp(w.probe.last('joints').header)
        assert stamp == pytest.approx(EPOCH + w.now + by, abs=0.02)
        # Commands move it again, and end again.
        w.until(lambda: moving(w), lambda: w.probe.send_command(COMMAND))
        w.until(lambda: not moving(w))


def test_a_simulator_publishes_the_time_that_it_goes_by():
    speed = 8.0
    node = simulator(use_sim_time=True, clock_speed=speed, rate=100.0)
    with world(node, sim_time=True) as w:
        w.until(lambda: len(w.probe.seen['pose']) > 2)
        begin, before = w.now, len(w.probe.seen['pose'])
        w.until(lambda: len(w.probe.seen['pose']) >= before + 60)
        stamps = np.array([read_stamp(m.header) for _, m in w.probe.seen['pose']])
        # No time is left out, however fast; a cycle may come with the next step of the clock.
        steps = np.diff(stamps) / 0.01
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
        assert steps.max() < 2.5
        assert (stamps[-1] - stamps[before - 1]) / (w.now - begin) == pytest.approx(speed, rel=0.1)


#: Methods of rclpy's handles: class, and functions of rclpy that call the method.
CALLS = {
    'call_timer': (rclpy_implementation.Timer, [Executor._take_timer]),
    'take_message': (rclpy_implementation.Subscription, [Executor._take_subscription]),
    'get_parameters': (rclpy_implementation.Node, [Node.__init__]),
}


@pytest.fixture(params=CALLS)
def renamed(request, monkeypatch):
    """Replace rclpy by one in which a method of a handle has another name."""
    kind, callers = CALLS[request.param]
    monkeypatch.setattr(kind, 'renamed', getattr(kind, request.param), raising=False)
    monkeypatch.delattr(kind, request.param)
    for caller in callers:
        names = [n if n != request.param else 'renamed' for n in caller.__code__.co_names]
        monkeypatch.setattr(caller, '__code__', caller.__code__.replace(co_names=tuple(names)))


@pytest.fixture
def nodes():
    """Return a running node, a probe and the node's executor."""
    begin_context()
    node = manipulation(rate=200.0, command_timeout=10.0)()
    probe = Probe(Twist)
    yield node, probe, PacedExecutor(node)
    node.stop()
    node.destroy_node()
    probe.destroy_node()
    rclpy.shutdown()


def until(executor, probe, holds, send=lambda: None):
    """Spin node and probe until a condition holds."""
    end = time.monotonic() + DEADLINE
    while not holds():
        assert time.monotonic() < end
        send()
        executor.spin_once(timeout_sec=0.01)
        rclpy.spin_once(probe, timeout_sec=0.0)


def is_commanded(probe):
    command = probe.last('command')
    return command is not None and any(command.data)


def move(executor, probe):
    until(executor, probe, lambda: is_commanded(probe), probe.send_all)


def test_a_twist_from_before_the_activation_moves_nothing(nodes):
    node, probe, executor = nodes
    move(executor, probe)
    node.trigger_deactivate()
    until(executor, probe, lambda: not is_commanded(probe), probe.send_all)
    for _ in range(10):
        probe.send_all()
        rclpy.spin_once(probe, timeout_sec=0.01)
    node.trigger_activate()
    probe.seen['command'].clear()
    until(executor, probe, lambda: len(probe.seen['command']) > 5, probe.send_measured)
    assert not any(any(m.data) for _, m in probe.seen['command'])
    move(executor, probe)


def test_a_twist_moves_the_rollers_with_an_rclpy_that_lacks_a_method_of_handles(renamed, nodes):
    node, probe, executor = nodes
    assert node.values.rate == 200.0
    move(executor, probe)


def test_the_newest_message_of_a_burst_is_used():
    begin_context()
    node, used, arrived = rclpy.create_node('listener'), [], []
    subscribe_newest(node, PoseStamped, 'poses', lambda pose: used.append(pose.pose.position.x))
    other = rclpy.create_node('witness')
    other.create_subscription(PoseStamped, 'poses', arrived.append, 10)
    publisher, message = other.create_publisher(PoseStamped, 'poses', 10), PoseStamped()
    for number in range(5):
        message.pose.position.x = float(number)
        publisher.publish(message)
    while len(arrived) < 5:
        rclpy.spin_once(other)
    for _ in range(3):
        rclpy.spin_once(node, timeout_sec=0.1)
    assert used == [4.0]
    node.destroy_node()
    other.destroy_node()
    rclpy.shutdown()
