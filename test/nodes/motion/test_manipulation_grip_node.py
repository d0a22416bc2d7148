# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Manipulation with a grip of any members, its inputs faked, and with a squeeze, simulated."""

from geometry_msgs.msg import PoseStamped, WrenchStamped
from held_grips import APART, box_between, BOX_FILE
from isotruss_msgs.action import FollowRollerTrajectory
from isotruss_msgs.msg import StateEstimate
from isotruss_ros.core import Status
from isotruss_ros.core.inputs import find_fresh
from isotruss_ros.core.servo.recorded_cycle import read_cycle
from isotruss_ros.core.servo.repeated_run import decide_again, read_robot
from isotruss_ros.nodes.conversions.messages import read_pose
from isotruss_ros.nodes.framework.topics import LATCHED
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from isotruss_ros.nodes.state_estimator import StateEstimatorNode
from manual_world import world
import numpy as np
from probe import maker, overrides, ROBOT
import pytest
from std_msgs.msg import String
from std_srvs.srv import Trigger
from trajectories import AWAY, trajectory

FORCE, RATE, FRICTION = 30.0, 20.0, 0.9
TWIST, FORWARD = (0.01, 0.01, 0.0), (0.02, 0.0, 0.0)
#: The robot holds the box between two sides.
BOX_HELD = {'object': BOX_FILE, 'grip': list(APART)}
plant = maker(Simulator, plant='elastic', friction=FRICTION, indentation=0.02, rate=RATE)()
holding = maker(Manipulation, failure_time=0.0, command_timeout=5.0, **BOX_HELD)
squeezing = maker(Manipulation, squeeze_force=FORCE, friction=FRICTION, rate=RATE)
observers = [
    maker(kind, command_timeout=1.0, friction=FRICTION)()
    for kind in (GraspAnalysisNode, StateEstimatorNode)
]


def send(w, moved=(0.0, 0.0, 0.0)):
    def publish():
        w.probe.send_joints()
        w.probe.send_object(np.array(box_between().body.pose) + moved)
        w.probe.send_twist(TWIST)

    return publish


def test_moves_the_box_and_halts_where_the_grip_is_another():
    with world(holding()) as w:
        status = w.until_code(Status.OK, send(w))
        assert status.achieved.linear.x == pytest.approx(TWIST[0], abs=1e-9)
        assert status.achieved.linear.y == pytest.approx(TWIST[1], abs=1e-9)
        assert status.reachable_dof == 3
        manipulation = w.nodes[1]
        assert manipulation.details()['grip'] == ', '.join(APART)
        w.until_code(Status.HALT_NO_GRASP, send(w, moved=(0.0, 0.5, 0.0)))
        w.until_code(Status.OK, send(w))
        # Which members hold it can be changed while the node runs.
        w.change(grip=['south/P-Q', 'east/R-Y'])
        status = w.until_code(Status.HALT_NO_GRASP, send(w))
        assert 'does not touch' in status.message
        (refused,) = manipulation.set_parameters(overrides(grip=['south/P-Q']))
        assert not refused.successful
        assert 'two or three different members' in refused.reason


def still(w):
    return lambda: w.probe.send_twist((0.0, 0.0, 0.0))


def test_the_squeeze_is_regulated_while_the_object_stays_and_moves():
    with world(plant, squeezing()) as w:
        w.probe.listen(WrenchStamped, 'forces', 'truth/contact_forces')
        w.until(lambda: w.probe.last('pose') is not None)
        start = w.place()

        def squeeze():
            return np.mean([m.wrench.force.x for _, m in w.probe.seen['forces'][-2:]])

        assert squeeze() != pytest.approx(FORCE, rel=0.05)
        w.until(lambda: squeeze() == pytest.approx(FORCE, rel=0.02), still(w))
        assert w.probe.last('status').code == Status.OK
        assert w.place()[:2] == pytest.approx(start[:2], abs=3e-3)
        w.until(lambda: w.place()[0] > start[0] + 0.01, lambda: w.probe.send_twist(FORWARD))
        assert squeeze() == pytest.approx(FORCE, rel=0.02)
        assert w.place()[1] == pytest.approx(start[1], abs=3e-3)


def test_subscribers_drop_a_grip_that_has_ended():
    analysing = maker(GraspAnalysisNode, command_timeout=10.0)
    with world(plant, squeezing(command_timeout=10.0), analysing()) as w:
        analysis = w.nodes[3]

        def record():
            return find_fresh(analysis.now(), 10.0, analysis.inputs.held_grip)

        w.until(lambda: record() is not None, still(w))
        here = w.travel()
        w.send_goal(FollowRollerTrajectory.Goal(trajectory=trajectory(here, here + 0.1 * AWAY)))
        begun = w.now
        w.until(lambda: record() is None)
        assert w.now - begun < 0.1
        assert w.nodes[2].details()['moves'] == 'the rollers along a trajectory'


@pytest.mark.parametrize('by', ['service', 'trajectory'])
def test_a_slipped_object_halts_until_a_client_resumes_the_grip_or_moves_the_rollers(by):
    remaps = {('simulator', '/object_pose'): '/true/object_pose'}
    with world(plant, squeezing(), remaps=remaps) as w:
        errors = [0.0]  # of the tracker, which look like a slip [m]

        def relay(message):
            message.pose.position.y += errors[-1]
            w.probe.object_poses.publish(message)

        w.probe.create_subscription(PoseStamped, 'true/object_pose', relay, 10)
        w.until_code(Status.OK, still(w))
        errors.append(0.01)
        status = w.until_code(Status.HALT_SLIPPED, still(w))
        errors.append(0.0)
        assert 'next step: ' in status.message
        assert 'resume_grip' in status.message
        w.spin(0.5, still(w))
        assert w.code() == Status.HALT_SLIPPED
        if by == 'service':
            assert 'resumed' in w.call('resume_grip', Trigger.Request()).message
        else:
            here = w.travel()
            path = trajectory(here, here + 0.01 * AWAY)
            goal = w.send_goal(FollowRollerTrajectory.Goal(trajectory=path))
            w.until(lambda: goal.ended, still(w))
        w.until_code(Status.OK, still(w))


def test_analysis_and_estimator_agree_with_the_loop_about_the_held_object():
    with world(plant, squeezing(), *observers) as w:
        w.probe.listen(StateEstimate, 'estimate', 'state_estimate')
        w.spin(0.6, lambda: w.probe.send_twist(FORWARD))
        state, estimate, status = map(w.probe.last, ('state', 'estimate', 'status'))
        desired = read_pose('desired pose', status.desired_pose)
        assert desired[:2] == pytest.approx(w.place()[:2], abs=2e-3)
    assert state.held == status.held == estimate.held == status.HELD_YES
    assert np.mean(state.squeeze) == pytest.approx(status.squeeze, rel=0.02)
    assert estimate.squeeze == pytest.approx(status.squeeze, rel=0.02)
    assert estimate.squeeze_deviation == pytest.approx(status.squeeze_deviation, rel=0.05)
    assert 0.0 < status.squeeze_deviation < status.squeeze
    assert not status.squeeze_assumed


def test_loop_without_squeeze_control_reports_neither_hold_nor_desired_pose():
    with world(plant, squeezing(squeeze_force=0.0)) as w:
        status = w.until_code(Status.IDLE, still(w))
    assert status.held == status.HELD_UNKNOWN
    assert np.isnan(status.desired_pose.position.x)


def test_pressures_that_are_old_or_invalid_halt_until_valid_ones_arrive():
    with world(plant, squeezing(pressure_timeout=0.3)) as w:

        def send(pressure=30e3):
            still(w)()
            w.probe.send_pressures([pressure] * len(ROBOT.description.pressures))

        w.until_code(Status.OK, send)
        w.until_code(Status.HALT_STALE_TUBE_PRESSURES, still(w))
        w.until_code(Status.OK, send)
        status = w.until_code(Status.HALT_INVALID_TUBE_PRESSURES, lambda: send(-1.0))
        assert 'must be from 1000 to 300000' in status.message
        w.until_code(Status.OK, send)


def test_published_records_decide_again_as_the_node_did():
    with world(plant, squeezing()) as w:
        w.until_code(Status.OK, still(w))
        w.probe.create_subscription(
            String, 'manipulation/cycle', lambda message: texts.append(message.data), LATCHED
        )
        texts, move = [], lambda: w.probe.send_twist(FORWARD)
        w.spin(0.3, move)
        w.nodes[2].set_parameters(overrides(squeeze_force=1.2 * FORCE))
        w.spin(0.3, move)
        here = w.travel()
        path = trajectory(here, here + 0.01 * AWAY)
        goal = w.send_goal(FollowRollerTrajectory.Goal(trajectory=path))
        w.until(lambda: goal.ended, still(w))
        w.spin(0.5)
    cycles = [read_cycle(text) for text in texts]
    again = list(decide_again(cycles, read_robot(cycles[0])))
    # A late subscriber receives the first cycles, too.
    assert [cycle.recorded.number for cycle in again] == list(range(len(texts)))
    statuses = {cycle.status for cycle in again}
    assert {Status.OK, Status.FOLLOWING_TRAJECTORY, Status.HALT_NO_TWIST} <= statuses
    recorded = [cycle.decision['velocities'].tolist() for cycle in cycles]
    assert [cycle.velocities.tolist() for cycle in again] == recorded
