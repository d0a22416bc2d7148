# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The grasp analysis node, with the rest of the world faked, and reports of its monitor."""

from dataclasses import replace
import math

from contracts import check_fields
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, Pose, WrenchStamped
from isotruss_msgs.msg import ConvexObject as ObjectMessage
from isotruss_msgs.srv import AnalyzeGrasp
from isotruss_ros import core
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grip_record import GripEstimate, GripRecord
from isotruss_ros.core.holding.held_shape import contact_points
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.inputs import LatestInputs, RejectedInput, RollerState, StampedInput
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.nodes.conversions.grasp_messages import (
    ContactForces,
    read_query,
    to_wrench_message,
)
from isotruss_ros.nodes.conversions.messages import (
    make_header,
    MessageError,
    read_stamp,
    to_pose_message,
)
from isotruss_ros.nodes.conversions.object_messages import to_object_message
from isotruss_ros.nodes.grasp.grasp_monitor import GraspMonitor
from isotruss_ros.nodes.grasp.grasp_report import GraspCode, GraspQuery
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from manual_world import world
import numpy as np
from probe import DIAMETER, maker, MODULE, N, ROBOT
import pytest
from sensor_msgs.msg import FluidPressure
from visualization_msgs.msg import Marker, MarkerArray
from wedge import pressed_into

SQUEEZED = core.tangent_center(ROBOT.home, MODULE, DIAMETER, shift=0.01)
node = maker(GraspAnalysisNode)


def feed(w, **pose):
    """Return a call that sends valid joint states and a pose, with changes."""
    return lambda: w.probe.send_measured(**({'center': SQUEEZED} | pose))


def until_ok(w):
    return w.until_code(GraspCode.OK, feed(w), 'state')


def check_contacts(messages, settled):
    """Check that messages have the contacts of a settled grasp."""
    grip = settled.equilibrium
    forces = grip.state.normal_forces, -grip.state.friction_forces
    rows = zip(messages, contact_points(grip), grip.state.normals, *forces, strict=True)
    for message, point, normal, pressing, rubbing in rows:
        expected = {'position': (point.real, point.imag, 0.0), 'normal_force': pressing}
        expected |= {'normal': (normal.real, normal.imag, 0.0), 'friction_force': rubbing}
        check_fields(message, expected)


def check_analysis(state, expected, settled, header, nonlinearity):
    """Check that a state has the results of a fixed object and of the held one."""
    of_members = ('contact_lengths', 'contact_widths', 'contact_areas', 'contact_pressures')
    of_members += ('peak_pressures', 'utilisation', 'utilisation_places', 'friction_used')
    equal = ('closed_by_friction', 'closure_residual', 'closure_tolerance', 'required_friction')
    values = {name: getattr(expected, name) for name in (*equal, 'closure_margin')}
    same = ('held', 'force_closure', 'slip_margin', 'slip_direction', 'displacement')
    values |= {name: getattr(settled, name) for name in same}
    values |= {name: list(getattr(settled, name).values()) for name in of_members}
    values |= {'code': GraspCode.OK, 'message': '', 'hold_message': settled.reason}
    values |= {'normal_wrench': to_wrench_message(expected.normal_wrench)}
    values |= {'grasping_members': list(settled.normal_forces)}
    values |= {'squeeze': list(settled.normal_forces.values()), 'stiffness': settled.stiffness}
    values |= {'contacts': state.contacts, 'contact_members': list(settled.contact_lengths)}
    values |= {'members': list(settled.utilisation), 'computing_time': state.computing_time}
    values |= {'squeeze_deviation': math.nan, 'squeeze_assumed': False, 'chance': math.nan}
    values |= {'header': header, 'nonlinearity': nonlinearity}
    check_fields(state, values, slip_margin=1e-3, slip_direction=1e-4)
    check_contacts(state.contacts, settled)
    assert state.computing_time > 0.0


def test_publishes_the_result_of_the_analysis():
    body = core.ConvexObject.disc(SQUEEZED, DIAMETER)
    expected = core.analyze_grasp(ROBOT.home, body, 0.5)
    settled = core.settle_grasp(ROBOT.home, body, 0.5)
    with world(node()) as w:
        state = until_ok(w)
        stamps = {'joints': w.probe.last('joints'), 'pose': w.probe.last('pose')}
        header = make_header(min(read_stamp(m.header) for m in stamps.values()), 'truss')
        check_analysis(state, expected, settled, header, math.nan)
        w.until(lambda: w.probe.last('wrench') is not None, feed(w))
        published = w.probe.last('wrench')
        assert published.header.frame_id == 'truss_object_aligned'
        assert published.wrench == state.normal_wrench


@pytest.mark.parametrize(
    ('shift', 'expected'),
    [(0.01, (True, True)), (0.06, (False, True)), (-0.01, (False, False))],
    ids=['held', 'wrinkled', 'apart'],
)
def test_held_and_force_closure_are_those_of_the_settled_grasp(shift, expected):
    center = core.tangent_center(ROBOT.home, MODULE, DIAMETER, shift=shift)
    settled = core.settle_grasp(ROBOT.home, core.ConvexObject.disc(center, DIAMETER), 0.8)
    assert (settled.held, settled.force_closure) == expected
    with world(node(friction=0.8)) as w:
        w.until(lambda: w.probe.last('held') is not None, feed(w, center=center))
        w.spin(0.2, feed(w, center=center))
        assert (w.probe.last('held').data, w.probe.last('closure').data) == expected


def forces_by_frame(messages):
    """Return the last force (along the normal, along the tube) of each contact frame [N]."""
    return {m.header.frame_id: (m.wrench.force.x, m.wrench.force.y) for m in messages}


def are_alike(forces, expected):
    """Return whether forces by frame agree to 1e-6 of the expected ones."""
    return forces.keys() == expected.keys() and all(
        forces[frame] == pytest.approx(expected[frame], rel=1e-6) for frame in expected
    )


def test_contact_forces_are_those_of_the_settled_grasp_and_zero_after_the_loss_of_contact():
    wrench = (0.4, -0.3, 0.02)
    body = core.ConvexObject.disc(SQUEEZED, DIAMETER)
    settled = core.settle_grasp(ROBOT.home, body, 0.5, wrench)
    frames = {name: f'truss_{name.replace("/", "_")}_contact' for name in settled.normal_forces}
    with world(node()) as w:
        w.probe.listen(WrenchStamped, 'forces', 'grasp/contact_forces')

        def feed_loaded():
            feed(w)()
            w.probe.send_wrench(wrench)

        def received():
            return forces_by_frame([message for _, message in w.probe.seen['forces'][-2:]])

        expected = {
            frames[name]: (force, -settled.friction_forces[name])
            for name, force in settled.normal_forces.items()
        }
        w.until(lambda: are_alike(received(), expected), feed_loaded)
        assert min(force for force, _ in expected.values()) > 1.0
        assert max(abs(along) for _, along in expected.values()) > 0.1
        away = (SQUEEZED[0] + 0.5, SQUEEZED[1] + 0.5)
        w.until(lambda: set(received().values()) == {(0.0, 0.0)}, feed(w, center=away))
        assert received().keys() <= set(frames.values())


def test_contact_forces_are_zero_for_the_nearest_members_without_contact_from_the_start():
    apart = core.tangent_center(ROBOT.home, MODULE, DIAMETER, shift=-0.05)
    with world(node()) as w:
        w.probe.listen(WrenchStamped, 'forces', 'grasp/contact_forces')
        w.until(lambda: len(w.probe.seen['forces']) > 3, feed(w, center=apart))
        received = forces_by_frame([message for _, message in w.probe.seen['forces']])
    frames = [f'truss_{name.replace("/", "_")}_contact' for name in members_at(ROBOT, MODULE)]
    assert received == dict.fromkeys(frames, (0.0, 0.0))


def test_contact_forces_of_members_that_have_released_the_object_are_zero_in_the_next_state():
    forces = ContactForces(ROBOT.frame)
    first, second, third = ROBOT.member_names[:3]
    for normal, released in (
        ({first: 3.0, second: 4.0}, []),
        ({second: 5.0, third: 6.0}, [first]),
        ({}, [second, third]),
    ):
        friction = {name: 0.1 * force for name, force in normal.items()}
        messages = forces.make_messages(NOW, normal, friction)
        expected = {name: (normal[name], -friction[name]) for name in normal}
        expected |= dict.fromkeys(released, (0.0, 0.0))
        frames = {f'truss_{name.replace("/", "_")}_contact': v for name, v in expected.items()}
        assert forces_by_frame(messages) == frames


def check_region(marker, state):
    """Check that triangles cover the object's surface as long and as wide as the contact."""
    assert marker.type == Marker.TRIANGLE_LIST
    corners = np.array([(p.x, p.y, p.z) for p in marker.points]).reshape(-1, 3, 3)
    away = np.hypot(*(corners[..., :2] - SQUEEZED).T)
    assert away == pytest.approx(np.full_like(away, 0.5 * DIAMETER))
    width, length = state.contact_widths[0], state.contact_lengths[0]
    assert np.ptp(corners[..., 2]) == pytest.approx(width)
    sides = corners[:, 1:] - corners[:, :1]
    area = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum()
    assert area == pytest.approx(width * length, rel=0.05)


def test_a_wrinkling_tube_is_a_warning_with_its_moment_while_it_lasts():
    with world(node(friction=0.8)) as w:
        wrinkled = core.tangent_center(ROBOT.home, MODULE, DIAMETER, shift=0.06)
        for center, code, level in (
            (wrinkled, GraspCode.WRINKLED, DiagnosticStatus.WARN),
            (SQUEEZED, GraspCode.OK, DiagnosticStatus.OK),
        ):
            state = w.until_code(code, feed(w, center=center), 'state')
            words = f': bending moment of {max(state.utilisation):.2f}'
            assert (words in state.message) == (code is GraspCode.WRINKLED)
            w.spin(0.15, feed(w, center=center))
            assert w.report('grasp_analysis').level == level


def test_markers_show_the_grasp_and_leave_nothing_behind():
    with world(node()) as w:
        w.probe.listen(MarkerArray, 'markers', 'grasp/markers')
        shown = {}

        def update():
            for _, array in w.probe.seen['markers']:
                for marker in array.markers:
                    assert marker.header.frame_id == 'truss'
                    assert marker.action in (Marker.ADD, Marker.DELETEALL)
                    if marker.action == Marker.ADD:
                        shown[marker.ns, marker.id] = marker
                    else:
                        shown.clear()
            w.probe.seen['markers'].clear()
            return {name for name, _ in shown}

        everything = {'members', 'deformed', 'contact_forces', 'contact_regions', 'object'}
        w.until(lambda: update() == everything, feed(w))
        members = len(ROBOT.member_names)
        for name in ('members', 'deformed'):
            assert {(name, i) for i in range(members)} <= shown.keys()
        # None of the tubes is wrinkled: none is red.
        assert all(shown['deformed', i].color.g > 0.5 for i in range(members))
        contacts = w.probe.last('state').contacts
        assert sum(name == 'contact_forces' for name, _ in shown) == len(contacts)
        tail, tip = ((p.x, p.y) for p in shown['contact_forces', 0].points)
        squeeze = w.probe.last('state').squeeze[0]
        assert math.dist(tail, tip) == pytest.approx(0.01 * squeeze, rel=0.3)
        check_region(shown['contact_regions', 0], w.probe.last('state'))
        disc = shown['object', 0]
        assert (disc.pose.position.x, disc.pose.position.y) == pytest.approx(SQUEEZED)
        assert disc.scale.x == disc.scale.y == DIAMETER
        assert disc.color.r > disc.color.g  # open
        # Just out of touch: the arrows and regions go.
        away = core.tangent_center(ROBOT.home, MODULE, DIAMETER, shift=-0.01)
        w.until(lambda: update() == {'members', 'deformed', 'object'}, feed(w, center=away))
        # Nothing is known: nothing is shown.
        w.until(lambda: update() == set())


BOX = (
    '{shape: polygon, vertices: [[-0.15, -0.1], [0.15, -0.1], [0.15, 0.1], [-0.15, 0.1]], '
    'corner_radius: 0.02, friction: 0.9}'
)


@pytest.mark.parametrize('friction', [None, 0.9])
def test_the_service_analyses_any_object_in_its_pose(friction):
    shape, load = core.read_object(BOX).shape, (1.0, -2.0, 0.1)
    pose = pressed_into(ROBOT.home, MODULE, shape, 0.3, 0.015).pose
    box = core.ConvexObject(shape, pose, friction=friction)
    request = AnalyzeGrasp.Request(
        object=to_object_message(box),
        object_pose=to_pose_message(pose),
        roller_positions=[0.0] * N,
        friction=0.7,
        external_wrench=to_wrench_message(load),
    )
    expected = core.analyze_grasp(ROBOT.home, box, friction or 0.7, load)
    settled = core.settle_grasp(ROBOT.home, box, friction or 0.7, load)
    with world(node()) as w:
        answer = w.call('analyze_grasp', request)
        assert answer.success, answer.message
        header, nonlinearity = answer.state.header, settled.nonlinearity
        check_analysis(answer.state, expected, settled, header, nonlinearity)


def test_the_service_analyses_a_disc_at_its_centre():
    center = Point(x=SQUEEZED[0], y=SQUEEZED[1])
    fields = {'center': center, 'diameter': DIAMETER, 'friction': 0.5}
    query = read_query(AnalyzeGrasp.Request(**fields), SPACING)
    assert query.body == core.ConvexObject.disc(SQUEEZED, DIAMETER)
    assert (query.friction, query.spacing) == (0.5, SPACING)


@pytest.mark.parametrize(
    ('fields', 'words'),
    [
        ({'diameter': 0.3}, 'diameter 0.3 m, together with an `object`: must be 0'),
        ({'center': Point(x=0.7)}, r'center \(0.7, 0.0\), together with an `object`: must be om'),
        ({'object': ObjectMessage(shape=7)}, 'object: shape 7: must be one of'),
        ({'object': ObjectMessage()}, 'diameter 0.0 m: must be positive'),
        ({'object_pose': Pose(position=Point(x=math.nan))}, r'object_pose at \(nan, 0.0\): x'),
    ],
)
def test_two_objects_or_none_are_refused(fields, words):
    disc = ObjectMessage(shape=ObjectMessage.DISC, diameter=0.3)
    usual = {'object': disc, 'object_pose': Pose(position=Point(x=0.7, y=0.4)), 'friction': 0.5}
    with pytest.raises(MessageError, match=words):
        read_query(AnalyzeGrasp.Request(**usual | fields), 0.005)


def test_measured_pressures_are_used_while_they_are_fresh():
    softer = (20e3, 20e3, 20e3)
    body = core.ConvexObject.disc(SQUEEZED, DIAMETER)
    expected = core.analyze_grasp(ROBOT.home, body, 0.5, pressure=softer)
    with world(node(pressure_timeout=0.5)) as w:

        def send(count=3):
            feed(w)()
            for tube in list(ROBOT.description.pressures)[:count]:
                header = make_header(w.probe.past(0.0), tube)
                w.probe.gauges.publish(FluidPressure(header=header, fluid_pressure=softer[0]))

        def is_softer():
            state = w.probe.last('state')
            return state.closure_residual == pytest.approx(expected.closure_residual)

        until_ok(w)
        assert not is_softer()
        w.until(is_softer, send)
        state = w.until_code(GraspCode.STALE_TUBE_PRESSURES, feed(w), 'state')
        assert 'pressure_timeout' in state.message
        assert state.held == state.HELD_UNKNOWN
        assert (state.closure_residual, state.required_friction) == (math.inf, math.inf)
        assert not state.contacts
        w.until_code(GraspCode.OK, send, 'state')
        w.until_code(GraspCode.STALE_TUBE_PRESSURES, lambda: send(1), 'state')


FRICTION, SPACING = 0.5, 0.005
CENTER = core.tangent_center(ROBOT.home, 'north/Z', DIAMETER, shift=0.01)
POSE = core.Pose(*CENTER, 0.0)
HOME = np.zeros(len(ROBOT.roller_names))
NOW, TIMEOUT = 1000.0, 0.2
WRENCH = (0.5, -2.0, 0.1)


def at(positions, velocities=0.0 * HOME):
    return RollerState(np.asarray(positions, dtype=float), np.asarray(velocities))


def question(**changes):
    body = core.ConvexObject.disc(CENTER, DIAMETER)
    return GraspQuery((), body, FRICTION, (0.0, 0.0, 0.0), SPACING)._replace(**changes)


def monitor(query=None, **changes):
    result = GraspMonitor(ROBOT, query or question(), TIMEOUT, LatestInputs())
    inputs = {'rollers': at(HOME), 'pose': POSE, 'wrench': WRENCH}
    inputs = {name: StampedInput(value, NOW) for name, value in inputs.items()}
    for name, value in (inputs | changes).items():
        setattr(result.inputs, name, value)
    return result


def test_forces_are_those_of_the_grip_that_the_loop_has():
    grip = attach_grip(ROBOT.home, core.ConvexObject.disc(CENTER, DIAMETER))
    grip = roll_grip(grip.with_anchors(grip.anchors - np.array([0.002, -0.002])), ROBOT.home)
    displaced = np.zeros(12), np.zeros((12, 6))
    estimate = GripEstimate(np.array(POSE), np.eye(3), 20.0, 3.0, 0.0, *displaced)
    record = StampedInput(GripRecord.of(grip, estimate, is_assumed=True), NOW)
    report = monitor(held_grip=record, wrench=None).report(NOW)
    assert (report.squeeze_deviation, report.is_squeeze_assumed) == (3.0, True)
    assert math.isnan(monitor().report(NOW).squeeze_deviation)
    result = report.grasp.settled
    assert result.slip_margin == pytest.approx(grip.slip_margin(FRICTION), rel=1e-3)
    assert list(result.normal_forces.values()) == pytest.approx(grip.normal_forces, rel=1e-3)
    loaded = roll_grip(grip, ROBOT.home, np.array(WRENCH)).slip_margin(FRICTION)
    under_load = monitor(held_grip=record).report(NOW).grasp.settled
    assert under_load.slip_margin == pytest.approx(loaded, rel=1e-3)
    without = monitor(wrench=None).report(NOW).grasp.settled
    assert without.slip_margin != pytest.approx(result.slip_margin, rel=0.05)


@pytest.mark.parametrize('is_loop', [False, True])
def test_chance_is_that_of_the_files_uncertainty(is_loop):
    block = {'friction': 0.05, 'roller_offset': 0.002}
    body = core.ConvexObject.disc(CENTER, DIAMETER)
    record = StampedInput(GripRecord.of(attach_grip(ROBOT.home, body)), NOW) if is_loop else None
    chances = []
    for about in (body, replace(body, uncertainty=block)):
        query = question(body=about, friction=0.63)
        report = monitor(query, wrench=None, held_grip=record).report(NOW)
        chances.append(report.grasp.chance)
    settled = core.settle_grasp(ROBOT.home, body, 0.63)
    expected = settled.chance(core.Uncertainty.of(ROBOT, about)).probability
    assert math.isnan(chances[0])
    assert 0.1 < chances[1] < 0.99
    assert chances[1] == pytest.approx(expected, abs=0.01)


def test_time_of_the_result_is_that_of_the_older_input():
    rollers, pose = StampedInput(at(HOME), NOW - 0.1), StampedInput(POSE, NOW - 0.05)
    assert monitor(rollers=rollers, pose=pose).report(NOW).time == NOW - 0.1
    assert monitor(pose=pose).report(NOW).time == NOW - 0.05
    assert monitor(pose=None).report(NOW).time == NOW


def figures_of(grasp):
    analysis = grasp.analysis
    return analysis.normal_forces.tolist(), analysis.closure_residual, grasp.settled.slip_margin


def test_computes_only_when_something_has_changed():
    live = monitor()
    first = live.report(NOW).grasp
    later = NOW + 0.1
    live.inputs.rollers = StampedInput(at(HOME, HOME + 0.01), later)
    live.inputs.pose = StampedInput(core.Pose(*POSE), later)
    report = live.report(later)
    assert report.grasp is first
    assert report.time == later
    for name, value in (
        ('rollers', StampedInput(at(HOME + 1e-9), later)),
        ('pose', StampedInput(POSE._replace(y=POSE.y + 1e-9), later)),
        ('wrench', StampedInput((0.5, -2.0, 0.1 + 1e-9), later)),
        ('query', question(body=core.ConvexObject.disc(CENTER, DIAMETER + 1e-9))),
        ('query', question(friction=FRICTION + 1e-9)),
        ('query', question(spacing=SPACING + 1e-9)),
    ):
        before = live.report(later).grasp
        setattr(live if name == 'query' else live.inputs, name, value)
        after = live.report(later).grasp
        assert after is not before, name
        assert figures_of(before) != figures_of(after)
        assert live.report(later).grasp is live.report(later).grasp, name


def test_an_object_without_equilibrium_is_reported_as_such():
    report = monitor(wrench=StampedInput((0.0, 60.0, 0.0), NOW)).report(NOW)
    assert report.code is GraspCode.OK
    assert report.message.startswith('no equilibrium: ')


def test_a_request_does_not_change_the_current_result():
    live = monitor()
    first = live.report(NOW).grasp
    other = live.analyze_request(question(body=core.ConvexObject.disc(CENTER, 0.31)), NOW + 0.05)
    assert other.code is GraspCode.OK
    assert other.time == NOW
    assert other.grasp.analysis.normal_forces.sum() > first.analysis.normal_forces.sum()
    elsewhere = live.analyze_request(question(roller_positions=(0.02, 0, 0, 0, 0, 0)), NOW)
    assert elsewhere.grasp.config.roller_positions[0] == 0.02
    assert live.report(NOW).grasp is first


def test_a_complete_request_needs_no_measured_inputs():
    live = monitor(rollers=None, pose=None, wrench=RejectedInput('broken'))
    reported = live.analyze_request(question(roller_positions=tuple(HOME)), NOW)
    assert reported.code is GraspCode.OK
    assert reported.time == NOW
    for report in (live.analyze_request(question(), NOW), live.report(NOW)):
        assert report.code is GraspCode.NO_JOINT_STATES
        assert not report.force_closure
