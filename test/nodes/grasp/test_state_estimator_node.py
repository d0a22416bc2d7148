# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node `state_estimator`, and the nodes that use what it publishes."""

import contextlib
import itertools

from contracts import check_fields
from diagnostic_msgs.msg import DiagnosticStatus
from isotruss_msgs.msg import StateEstimate
from isotruss_ros.core import Pose
from isotruss_ros.core.estimation import state_estimate
from isotruss_ros.core.inputs import CLOCK_SKEW
from isotruss_ros.nodes.conversions import messages
from isotruss_ros.nodes.conversions.sensor_messages import to_joint_markers
from isotruss_ros.nodes.conversions.state_messages import read_estimate, to_estimate_message
from isotruss_ros.nodes.simulator.node import Simulator
from isotruss_ros.nodes.state_estimator import StateEstimatorNode
from manual_world import world
import numpy as np
from probe import hang_joints, maker, N, overrides, ROBOT
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import MultiDOFJointState

NAMES = ROBOT.topology.joint_names
#: Its encoders read zero where the tubes have run by this deviation, without an object nearby.
PLANT = {'object_is_free': True, 'object_pose': [0.6, 5.0, 0.0], 'zero_deviation': 0.01, 'seed': 4}
PLANT |= {'tracker_rate': 20.0, 'tracker_noise': 0.001, 'tracker_dropouts': 0.3}
PLANT |= {'marker_joints': ['all']}
estimator = maker(StateEstimatorNode)
#: Joints at home.
PLACES = dict(zip(NAMES, ROBOT.home.nodes[: len(NAMES)].tolist(), strict=True))


@contextlib.contextmanager
def listening(*makers):
    """Yield a world whose probe keeps estimates."""
    with world(*makers) as w:
        w.probe.listen(StateEstimate, 'estimate', 'state_estimate')
        yield w


def last_estimate(w):
    return w.probe.last('estimate')


def test_joints_of_a_robot_with_wrong_offsets_are_estimated():
    with listening(lambda: Simulator(overrides(**PLANT)), estimator()) as w:
        w.spin(2.0)
        result, truth = last_estimate(w), w.nodes[1].robot.home.nodes[: len(NAMES)]
    joints = np.array([(place.x, place.y) for place in result.joints])
    assert np.abs(truth - ROBOT.home.nodes[: len(NAMES)]).max() > 0.01
    assert joints == pytest.approx(truth, abs=2e-3)
    assert result.used_joints
    assert not result.left_out_joints
    assert result.held == result.HELD_UNKNOWN


def test_prior_deviation_of_the_offsets_is_the_parameter_and_grows_by_slip():
    deviations = []
    for slip in (0.0, 0.5):
        with listening(estimator(zero_deviation=0.002, slip=slip)) as w:
            w.spin(0.1, w.probe.send_joints)
            w.spin(0.1, lambda: w.probe.send_joints(position=[0.1] * 6))
            variances = np.diag(np.reshape(last_estimate(w).offset_covariance, (6, 6)))
        deviations.append(np.sqrt(variances))
    assert deviations[0] == pytest.approx(0.002, rel=0.02)
    # Slip of half of the travel of 0.1 m, which is its correlation length.
    assert deviations[1] == pytest.approx(np.hypot(0.002, 0.05), rel=0.02)


def test_estimate_is_robust_to_late_swapped_and_missing_markers():
    with listening(estimator()) as w:
        noise = itertools.cycle((1e-9, -1e-9))

        def feed(joints):
            w.probe.send_joints()
            off = next(noise)
            noisy = {name: (x + off, y) for name, (x, y) in joints.items()}
            w.probe.send_markers(noisy, age=0.3)

        w.spin(1.0, lambda: feed(PLACES))
        w.spin(0.2, lambda: feed(PLACES | {'P': PLACES['Q'], 'Q': PLACES['P']}))
        assert last_estimate(w).left_out_joints == ['P', 'Q']
        doubts = w.report('state_estimator').message.split('; ')
        assert 'inconsistent markers: P, Q' in doubts
        w.spin(0.2, lambda: feed({}))
        w.spin(0.2, lambda: feed(PLACES))
        result = last_estimate(w)
    assert np.abs(result.offsets).max() < 2e-4
    assert result.used_joints == sorted(NAMES)


@pytest.mark.parametrize(('inclination', 'is_admitted'), [(1.57, True), (0.02, False)])
def test_an_upright_robot_that_three_markers_admit_is_reported(inclination, is_admitted):
    three = {name: PLACES[name] for name in ('Q', 'R', 'Z')}
    with listening(estimator(inclination=inclination)) as w:
        w.spin(0.1, w.probe.send_joints)
        w.spin(1.5, lambda: (w.probe.send_joints(), w.probe.send_markers(three)))
        detail, result = w.detail('roller offsets', 'state_estimator'), last_estimate(w)
    assert result.used_joints == sorted(three)
    assert result.may_be_upright is is_admitted
    assert ('set inclination' in detail) is is_admitted


@pytest.mark.parametrize('ahead', [0.0, 0.9 * CLOCK_SKEW])
def test_a_repeated_marker_message_is_used_once(ahead):
    """Also if its stamp is in the future, and its age counts from its reception."""
    result = []
    for repeats in (1, 5):
        with listening(estimator()) as w:
            w.spin(0.2, w.probe.send_joints)
            markers = w.probe.create_publisher(MultiDOFJointState, 'joint_markers', 10)
            message = to_joint_markers({'Q': tuple(ROBOT.home.nodes[1] + [0.0, 2e-3])})
            message.header = messages.make_header(w.probe.past(-ahead), 'truss')
            for number in range(5):
                if number < repeats:
                    markers.publish(message)
                w.spin(0.002)
            w.spin(0.2, w.probe.send_joints)
            result.append(last_estimate(w).offsets)
    assert np.abs(result[0]).max() > 1e-4
    assert result[0].tolist() == pytest.approx(result[1].tolist(), rel=1e-6)


def test_markers_wait_for_joint_states_of_their_time():
    with listening(estimator()) as w:
        w.spin(0.3, w.probe.send_joints)
        w.spin(0.1)
        w.probe.send_markers(PLACES)
        w.spin(0.1)
        assert last_estimate(w).used_joints == []
        w.spin(0.1, w.probe.send_joints)
        assert last_estimate(w).used_joints == sorted(NAMES)
        # At home, the offsets are about as uncertain as the markers.
        variances = np.diag(np.reshape(last_estimate(w).offset_covariance, (N, N)))
        assert np.sqrt(variances) == pytest.approx(1e-3, rel=0.1)


@pytest.mark.parametrize(
    ('weight', 'level', 'words'),
    [
        (0.0, DiagnosticStatus.OK, 'estimating'),
        (9.8, DiagnosticStatus.WARN, 'hang by up to 27 mm'),
    ],
)
def test_a_robot_that_sags_under_its_weight_is_a_warning(weight, level, words):
    joints = hang_joints(weight)
    with listening(estimator()) as w:
        w.spin(3.0, lambda: (w.probe.send_joints(), w.probe.send_markers(joints)))
        assert w.report('state_estimator').level == level
        assert words in w.report('state_estimator').message


def test_stale_pressures_give_a_warning_and_the_estimate_continues():
    with listening(estimator(pressure_timeout=0.3)) as w:
        w.spin(0.1, lambda: (w.probe.send_joints(), w.probe.send_pressures([3e4] * 3)))
        w.until(lambda: w.report('state_estimator').message == 'estimating', w.probe.send_joints)
        w.until(
            lambda: 'pressure_timeout' in w.report('state_estimator').message, w.probe.send_joints
        )
        count = len(w.probe.seen['estimate'])
        w.spin(0.2, w.probe.send_joints)
        assert len(w.probe.seen['estimate']) > count


def test_poses_wait_for_encoders_that_are_late_by_less_than_the_timeout():
    plant = {'plant': 'elastic', 'friction': 0.9, 'indentation': 0.01, 'encoder_delay': 1.5}
    values = {'rate': 20.0, 'command_timeout': 3.0}
    with listening(lambda: Simulator(overrides(**plant, **values)), estimator(**values)) as w:
        w.until(lambda: last_estimate(w) is not None and last_estimate(w).held == 1)
        # The first pose has the default deviation of an angle.
        assert np.sqrt(last_estimate(w).pose.covariance[-1]) == pytest.approx(0.0095, rel=0.1)


def test_an_estimate_survives_a_round_trip():
    random, count = np.random.default_rng(2), 2 * len(NAMES)
    estimate = state_estimate.StateEstimate(
        time=2.5,
        offsets=0.01 * random.normal(size=N),
        offset_covariance=np.cov(random.normal(size=(N, 2 * N))),
        travel=random.normal(size=N),
        joints=random.normal(size=(len(NAMES), 2)),
        joint_covariance=np.diag(np.arange(1.0, count + 1.0) ** 2),
        pose=np.array([0.6, 0.3, 0.2]),
        pose_covariance=random.normal(size=(3, 3)),
        squeeze=30.0,
        squeeze_deviation=2.0,
        used=('P',),
        left_out=('Q', 'R'),
        is_improbable=True,
        may_be_upright=True,
        swapped=('Q', 'R'),
        delay=0.02,
        slipping=('north/Z',),
    )
    packed = serialize_message(to_estimate_message(estimate, ROBOT))
    sent = deserialize_message(packed, StateEstimate)
    expected = {
        'header': messages.make_header(2.5, 'truss'),
        'roller_names': ROBOT.roller_names,
        'travel': estimate.travel,
        'offsets': estimate.offsets,
        'offset_covariance': estimate.offset_covariance,
        'improbable': True,
        'may_be_upright': True,
        'joint_names': NAMES,
        'joints': [(x, y, 0.0) for x, y in estimate.joints],
        'joint_deviations': np.arange(1.0, count + 1.0),
        'held': StateEstimate.HELD_YES,
        'pose': (messages.to_pose_message(Pose(0.6, 0.3, 0.2)), sent.pose.covariance),
        'squeeze': 30.0,
        'squeeze_deviation': 2.0,
        'used_joints': ['P'],
        'left_out_joints': ['Q', 'R'],
        'swapped_joints': ['Q', 'R'],
        'slipping_rollers': ['north/Z'],
        'pose_delay': 0.02,
    }
    check_fields(sent, expected)
    planar = sent.pose.covariance.reshape(6, 6)[np.ix_([0, 1, 5], [0, 1, 5])]
    assert planar == pytest.approx(estimate.pose_covariance)
    result = read_estimate(sent, ROBOT)
    assert result.offsets == pytest.approx(estimate.offsets)
    assert result.covariance == pytest.approx(estimate.offset_covariance)


@pytest.mark.parametrize(
    'changes',
    [
        {'roller_names': ['south/P']},
        {'offsets': [float('nan')] * N},
        {'offsets': [7.0] * N},
        {'offset_covariance': [0.0]},
        {'offset_covariance': [float('inf')] * N**2},
        {'offset_covariance': np.diag([-1.0] * N).ravel().tolist()},
    ],
)
def test_invalid_estimates_are_refused(changes):
    good = {'roller_names': list(ROBOT.roller_names), 'offsets': [0.0] * N}
    good['offset_covariance'] = [0.0] * N**2
    estimate = StateEstimate(**(good | changes))
    estimate.header.frame_id = 'truss'
    with pytest.raises(messages.MessageError, match='state estimate'):
        read_estimate(estimate, ROBOT)
