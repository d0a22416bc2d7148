# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The manipulation node, its inputs faked, or beside a simulated robot that squeezes."""

from dataclasses import replace
from functools import partial
import math
from pathlib import Path
import re
from types import SimpleNamespace

from contracts import check_fields
from geometry_msgs.msg import PoseStamped, WrenchStamped
from held_grips import APART, BOX, box_between, BOX_FILE, held
from isotruss_msgs.action import FollowRollerTrajectory
from isotruss_msgs.msg import HeldGrip, ManipulationStatus, StateEstimate
from isotruss_ros import core
from isotruss_ros.core import Status
from isotruss_ros.core.holding.grip_record import GripEstimate, GripRecord
from isotruss_ros.core.inputs import find_fresh
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.recording.recorded_cycle import read_cycle
from isotruss_ros.core.recording.repeated_run import decide_again, read_robot
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.decision import Decision
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from isotruss_ros.nodes.conversions.messages import (
    make_header,
    read_pose,
    to_pose_message,
    to_twist_message,
)
from isotruss_ros.nodes.conversions.state_messages import read_grip, to_grip_message
from isotruss_ros.nodes.framework.topics import RECORDS
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.manipulation.servo_settings import (
    make_settings,
    SPECS,
    StatusReport,
    UNKNOWN_POSE,
)
from isotruss_ros.nodes.simulator.node import Simulator
from isotruss_ros.nodes.state_estimator import StateEstimatorNode
from manual_world import Manager, moving_world, world
import numpy as np
from probe import DIAMETER, maker, MODULE, N, overrides, ROBOT
from probe import manipulation as node
import pytest
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from trajectories import AWAY, trajectory
from walls import Wall

UNIT = np.eye(N)


def test_a_slow_loop_is_stated_first_in_the_status():
    with moving_world() as w:
        w.busy = lambda: 0.03
        w.spin(1.5, w.probe.send_all)
        slow = r'the loop reaches [23]\d(\.\d)? of 100 Hz'
        assert re.fullmatch(slow, w.probe.last('status').message)
        send = lambda: (w.probe.send_pose(), w.probe.send_twist())  # noqa: E731
        status = w.until_code(core.Status.HALT_STALE_JOINT_STATES, send)
        assert re.match(f'{slow}; ', status.message)


@pytest.mark.parametrize('module', ['south/X', 'east/Y', 'north/R', 'north/P'])
def test_halts_where_another_module_than_the_grip_holds_the_object(module):
    """The object is between the members of each of these modules, but only one of them is near."""
    center = core.tangent_center(ROBOT.home, module, DIAMETER)
    with world(node()) as w:
        send = partial(w.probe.send_all, center=center)
        status = w.until_code(core.Status.HALT_NO_GRASP, send)
        assert re.match('member north/(P-Z|Z-R) does not touch the object', status.message)
        assert 'Name the members' in status.message
        assert not w.command().any()
        w.change(grip_module=module)
        w.until(lambda: w.command().any(), send)


def test_every_parameter_of_the_servo_reaches_it():
    values = {'friction': 0.7, 'pressure_timeout': 9.0, 'squeeze_force': 30.0, 'object_mass': 1.5}
    values |= {'frequency': 8.0, 'expected_load': 4.0, 'zero_deviation': 0.002, 'rate': 50.0}
    values |= {'ambient_pressure': 0.0, 'object_diameter': 0.21, 'grip_module': 'south/P'}
    values |= {'grip': ['north/P-Z', 'north/Z-R'], 'command_timeout': 0.3, 'min_rigidity': 0.21}
    values |= {'min_clearance': 0.011, 'min_object_clearance': 0.013, 'failure_time': 3.0}
    values |= {'min_obstacle_clearance': 0.014, 'obstacle_timeout': 0.7}
    values |= {'slide_along_limits': True, 'max_object_acceleration': 0.4}
    assert values.keys() | {'failed_rollers'} == {spec.name for spec in SPECS}, (
        'a parameter of SPECS has a value here, and below what `make_settings` makes of it'
    )

    def settings(**others):
        return make_settings(ROBOT, SimpleNamespace(**values | others), None, 'Z')

    body = core.ConvexObject(core.Disc(0.21), mass=1.5, friction=0.7)
    assert settings() == ServoSettings(
        core.Grip(('north/P-Z', 'north/Z-R'), body),
        period=0.02,
        timeout=0.3,
        joint='Z',
        squeeze=SqueezeSettings(30.0, frequency=8.0, load=4.0, zero_deviation=0.002),
        bounds=ShapeBounds(0.21, 0.011, 0.013, min_obstacle_clearance=0.014),
        failure_time=3.0,
        pressure_timeout=9.0,
        obstacle_timeout=0.7,
        max_object_acceleration=0.4,
    )
    assert settings(slide_along_limits=False).slide_along_limits is False
    assert settings(squeeze_force=0.0).squeeze is None
    assert settings(failure_time=0.0).failure_time == math.inf
    assert settings(grip=['']).grip.members == members_at(ROBOT, 'south/P')


def test_published_status_and_grip_have_all_fields_of_decision_and_belief():
    achieved = np.array([0.1, 0.2, 0.3])
    command = RollerCommand(np.zeros(N), achieved, 0.4, core.Status.SLIDING, (), 2)
    twist, failed = np.array([0.5, 0.6, 0.7]), ROBOT.roller_names[1:3]
    desired = core.Pose(0.7, 0.4, 0.1)
    decision = Decision(command, twist, 'why', failed, 8.0, 1.5, (30.0, 2.0), 0.03, desired)
    displaced = np.zeros(12), np.zeros((12, N))
    estimate = GripEstimate(np.array(desired), np.eye(3), 30.0, 2.0, 0.03, *displaced)
    belief = SimpleNamespace(held=held(BOX, 0.2), estimate=estimate, is_assumed=True)
    control = SimpleNamespace(fault=None, tracker=SimpleNamespace(belief=belief))
    expected = {
        'header': make_header(2.5, 'truss'),
        'code': core.Status.SLIDING,
        'message': 'why',
        'commanded': to_twist_message(twist),
        'achieved': to_twist_message(achieved),
        'desired_pose': to_pose_message(desired),
        'scale': 0.4,
        'reachable_dof': 2,
        'failed_rollers': failed,
        'cycle_time': 0.004,
        'frequency': 8.0,
        'pose_gain': 1.5,
        'squeeze': 30.0,
        'squeeze_deviation': 2.0,
        'squeeze_assumed': True,
        'pose_delay': 0.03,
        'held': ManipulationStatus.HELD_YES,
    }
    record = GripRecord.of(belief.held, estimate, is_assumed=True)
    unknown = {'squeeze': math.nan, 'squeeze_deviation': math.nan, 'squeeze_assumed': False}
    unknown |= {
        'held': ManipulationStatus.HELD_UNKNOWN,
        'desired_pose': to_pose_message(UNKNOWN_POSE),
    }
    with world(node(autostart=False)) as w:
        w.probe.listen(HeldGrip, 'grip', 'manipulation/grip')
        report = StatusReport(w.nodes[1], ROBOT)
        assert all(map(Manager(w, 'manipulation').ask, Manager.UP))
        w.nodes[1].cycle.duration = 0.004
        report.publish(decision, control, 2.5)
        w.deliver()
        check_fields(w.probe.last('status'), expected)
        assert w.probe.last('grip') == to_grip_message(record, ROBOT, 2.5)
        report.publish(replace(decision, squeeze=None, desired_pose=None), None, 4.0)
        w.deliver()
        expected |= unknown | {'header': make_header(4.0, 'truss')}
        check_fields(w.probe.last('status'), expected)
        assert w.probe.last('grip') == to_grip_message(None, ROBOT, 4.0)


def test_published_grip_presses_as_the_plant_does():
    with world(plant, squeezing()) as w:
        w.probe.listen(HeldGrip, 'grip', 'manipulation/grip')
        w.probe.listen(WrenchStamped, 'forces', 'truth/contact_forces')
        w.spin(3.0, still(w))
        record = read_grip(w.probe.last('grip'), ROBOT)
        body = core.ConvexObject.disc(w.place()[:2], DIAMETER)
        grip = record.restore(ROBOT.configuration(record.travel), body)
        true = [message.wrench.force.x for _, message in w.probe.seen['forces'][-2:]]
        assert grip.normal_forces == pytest.approx(true, rel=0.02)
        assert grip.pose[:2] == pytest.approx(w.place()[:2], abs=1e-3)


def test_whole_numbers_are_taken_for_real_parameters():
    """As `-p rate:=100` and `ros2 param set` give them."""
    with world(node(rate=100)) as w:
        assert w.nodes[1].get_parameter('rate').value == 100.0
        w.change(rate=50)
        assert w.nodes[1].get_parameter('rate').value == 50.0
        (result,) = w.nodes[1].set_parameters(overrides(rate=0))
        assert not result.successful
        assert 'range' in result.reason


def test_an_unknown_parameter_causes_a_warning_with_the_most_similar_name(capfd):
    with world(node(gripmodule=MODULE, zzz=1.0)):
        pass
    said = capfd.readouterr().err
    assert 'parameter gripmodule: unknown, and not used; did you mean grip_module?\n' in said
    assert 'parameter zzz: unknown, and not used\n' in said


def test_a_user_robot_file_and_its_frame_are_used(tmp_path):
    preset = Path(ROBOT.description.source).with_name('triangle.yaml')
    mine = tmp_path / 'mine.yaml'
    mine.write_text(preset.read_text().replace('frame: truss', 'frame: lab'))
    parameters = {'robot': str(mine), 'grip_module': 'main/T', 'command_timeout': 1.0}
    with world(lambda: Simulator(overrides(**parameters)), node(**parameters)) as w:
        status = w.until_code(core.Status.IDLE, lambda: w.probe.send_twist((0.0, 0.0, 0.0)))
        assert status.header.frame_id == w.probe.last('pose').header.frame_id == 'lab'


def test_cmd_vel_moves_the_joint_without_an_object_pose():
    velocity = (0.01, -0.02)
    with world(node(mode='joint', joint='Z')) as w:
        status = w.until_code(
            core.Status.OK, lambda: (w.probe.send_joints(), w.probe.send_twist((*velocity, 0.0)))
        )
        expected = core.solve_joint_velocity(ROBOT.home, {'Z': velocity}).roller_velocities
        assert w.command() == pytest.approx(expected, abs=1e-12)
        assert (status.achieved.linear.x, status.achieved.linear.y) == pytest.approx(velocity)
        assert status.reachable_dof == 2


def test_the_service_switches_and_halts_first():
    with moving_world(joint='Z') as w:
        assert w.command().any()
        for wanted, name, moved in ((True, 'joint', 'joint Z'), (False, 'object', 'object')):
            response = w.call('set_joint_mode', SetBool.Request(data=wanted))
            assert (response.success, response.message) == (True, f'cmd_vel moves the {moved}')
            assert w.nodes[1].get_parameter('mode').value == name
            assert not w.command().any()
            w.spin(0.05, w.probe.send_joints)
            assert w.code() == core.Status.HALT_NO_TWIST
            w.until_code(core.Status.OK, w.probe.send_all)


def test_the_service_refuses_the_joint_mode_without_a_joint():
    with world(node()) as w:
        response = w.call('set_joint_mode', SetBool.Request(data=True))
        assert not response.success
        assert 'no such joint' in response.message
        assert w.nodes[1].get_parameter('mode').value == 'object'


class Careful(Manipulation):
    """The node with a limit of its own."""

    def prepare(self, settings):
        return replace(settings, limits=(Wall(np.vstack((UNIT, -UNIT)), np.full(2 * N, 1e-4)),))


def test_a_user_defined_limit_persists_when_parameters_change():
    with world(lambda: Careful(overrides(failure_time=0.0, slide_along_limits=False))) as w:
        for change in (
            lambda: None,
            lambda: w.change(min_clearance=0.03),
            Manager(w, 'manipulation').restart,
        ):
            change()
            w.probe.seen['status'].clear()
            assert 'wall' in w.until_code(Wall.status, w.probe.send_all).message


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
        w.until(lambda: w.place()[0] > start[0] + 0.005, lambda: w.probe.send_twist(FORWARD))
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
        w.spin(0.2, still(w))
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
        w.spin(6.0, still(w))  # more than 100 cycles: a recorder may be discovered late
        w.probe.create_subscription(
            String, 'manipulation/cycle', lambda message: texts.append(message.data), RECORDS
        )
        texts, move = [], lambda: w.probe.send_twist(FORWARD)
        w.spin(0.2, move)
        w.nodes[2].set_parameters(overrides(squeeze_force=1.2 * FORCE))
        w.spin(0.2, move)
        here = w.travel()
        path = trajectory(here, here + 0.01 * AWAY)
        goal = w.send_goal(FollowRollerTrajectory.Goal(trajectory=path))
        w.until(lambda: goal.ended, still(w))
        w.spin(0.3)
    cycles = [read_cycle(text) for text in texts]
    again = list(decide_again(cycles, read_robot(cycles[0])))
    # A late subscriber receives the first cycles, too.
    assert [cycle.recorded.number for cycle in again] == list(range(len(texts)))
    statuses = {cycle.decision.command.status for cycle in again}
    assert {Status.OK, Status.FOLLOWING_TRAJECTORY, Status.HALT_NO_TWIST} <= statuses
    # Statuses are those of the topic; the servo does not know that the trajectory has ended.
    assert Status.ARRIVED in {cycle.decision['status'] for cycle in cycles}
    recorded = [cycle.decision['velocities'].tolist() for cycle in cycles]
    assert [cycle.decision.command.roller_velocities.tolist() for cycle in again] == recorded
