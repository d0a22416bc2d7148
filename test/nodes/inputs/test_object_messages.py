# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Readers of messages: what they read and reject; objects, grips and obstacles in messages.

What nodes do then is in `test_bad_messages`.
"""

import array
import math
from pathlib import Path
import re
from types import SimpleNamespace

from builtin_interfaces.msg import Time
from contracts import check_fields
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Twist,
    Vector3,
    WrenchStamped,
)
from geometry_msgs.msg import Pose as PoseMessage
from held_grips import BOX, held, HOME, NINE
from hypothesis import given
from hypothesis import strategies as st
from isotruss_msgs.msg import ConvexObject as ObjectMessage
from isotruss_msgs.msg import HeldGrip, Obstacles
from isotruss_ros.core import ConvexObject, Disc, Ellipse, Obstacle, Polygon, tangent_center
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.grip_record import GripEstimate, GripRecord
from isotruss_ros.core.model.obstacle import HalfPlane
from isotruss_ros.core.numerics.arrays import MAX_LOAD
from isotruss_ros.nodes.conversions import messages, sensor_messages
from isotruss_ros.nodes.conversions.grasp_messages import read_external_wrench, to_wrench_message
from isotruss_ros.nodes.conversions.messages import make_header, MessageError, to_pose_message
from isotruss_ros.nodes.conversions.object_messages import read_described, to_object_message
from isotruss_ros.nodes.conversions.obstacle_messages import read_obstacles, to_obstacles_message
from isotruss_ros.nodes.conversions.state_messages import read_grip, to_grip_message
from isotruss_ros.nodes.framework.robot_frame import RobotFrame
import numpy as np
from probe import DIAMETER, MODULE, N, ROBOT
import pytest
from rclpy.serialization import deserialize_message, serialize_message
import robots
from sensor_msgs.msg import FluidPressure, JointState
from shapes import random_shape
from std_msgs.msg import Header

CORNERS = [(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)]
HAND = Obstacle('hand', ConvexObject(Disc(0.1), (1.0, 0.5, 0.2)), (0.1, -0.2, 0.3), 5.0)
places, rates, angles = st.floats(-9.0, 9.0), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0)
GRIP = held(BOX, 0.2)
DISPLACED = 1e-4 * np.arange(12.0), 1e-3 * np.arange(72.0).reshape(12, 6)
ESTIMATE = GripEstimate(np.array([0.5, 0.4, 0.1]), 1e-6 * np.eye(3), 20.0, 3.0, 0.02, *DISPLACED)


def points(corners):
    return [Point(x=float(x), y=float(y), z=7.0) for x, y in corners]


def box(**fields):
    usual = {'shape': ObjectMessage.POLYGON, 'vertices': points(CORNERS)}
    return ObjectMessage(**(usual | fields))


def read(message, pose=None):
    return read_described(message, Pose() if pose is None else pose, 'diameter', 0.0)


@robots.examples(100)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-3.0, 3.0)),
    st.none() | st.floats(1e-3, 100.0),
    st.booleans(),
    st.none() | st.floats(0.0, 10.0),
)
def test_objects_survive_a_round_trip(seed, place, mass, weighted, friction):
    shape = random_shape(np.random.default_rng(seed))
    inside = (shape.centroid.real, shape.centroid.imag) if weighted else None
    body = ConvexObject(shape, place, mass, inside, friction)
    sent = deserialize_message(serialize_message(to_object_message(body)), ObjectMessage)
    result = read(sent, to_pose_message(body.pose))
    assert result.moved_to(place) == body  # to the last digit
    assert result.pose == pytest.approx(body.pose, abs=1e-12)


#: Shapes, and the fields that have values in their messages.
DESCRIBED = {
    'disc': (Disc(0.3), {'shape': ObjectMessage.DISC, 'diameter': 0.3}),
    'polygon': (
        Polygon(CORNERS, corner_radius=[0.01, 0.02, 0.03, 0.04]),
        {
            'shape': ObjectMessage.POLYGON,
            'vertices': [(x, y, 0.0) for x, y in CORNERS],
            'corner_radii': [0.01, 0.02, 0.03, 0.04],
        },
    ),
    'ellipse': (
        Ellipse((0.2, 0.1)),
        {'shape': ObjectMessage.ELLIPSE, 'semi_axes': (0.2, 0.1)},
    ),
}


@pytest.mark.parametrize('name', DESCRIBED)
def test_message_of_an_object_has_its_outline_mass_and_friction(name):
    shape, fields = DESCRIBED[name]
    body = ConvexObject(shape, (1.0, 2.0, 0.3), 0.5, (0.01, 0.02), 0.7)
    expected = {'diameter': 0.0, 'vertices': [], 'corner_radii': [], 'semi_axes': (0.0, 0.0)}
    expected |= {'mass': [0.5], 'center_of_mass': [(0.01, 0.02, 0.0)], 'friction': [0.7]}
    check_fields(to_object_message(body), expected | fields)


DISC = {'shape': ObjectMessage.DISC, 'diameter': 0.3}
REFUSED = {
    'no shape': (ObjectMessage(diameter=0.3), r'object: shape 0: must be one of 1 \(a disc\), 2'),
    'a disc with vertices': (
        ObjectMessage(**DISC, vertices=points(CORNERS)),
        "object: unknown key 'vertices'; those of shape disc are shape, diameter, mass",
    ),
    'a polygon with a diameter': (box(diameter=math.nan), "key 'diameter'; .*of shape polygon"),
    'friction in percent': (
        ObjectMessage(**DISC, friction=[80.0]),
        "object: the object's friction 80.0: must be from 0 to 10; if it is in percent, it is 0.8",
    ),
    'mass elsewhere': (box(center_of_mass=points([(1.0, 0.0)])), r'\(1, 0\) m: must be within'),
}


@pytest.mark.parametrize('case', REFUSED)
def test_invalid_objects_are_refused_with_the_faulty_field(case):
    message, words = REFUSED[case]
    with pytest.raises(MessageError, match=words) as error:
        read(message)
    assert len(str(error.value)) < 300


def grip_message():
    record = GripRecord.of(GRIP, ESTIMATE, is_assumed=True)
    packed = serialize_message(to_grip_message(record, NINE, 2.5))
    return deserialize_message(packed, HeldGrip)


def test_message_of_a_grip_has_its_equilibrium_and_estimate():
    record = GripRecord.of(GRIP, ESTIMATE, is_assumed=True)
    expected = {
        'header': make_header(2.5, 'truss'),
        'travel': HOME.roller_positions,
        'pressures': record.pressures or (),
        'members': [NINE.member_names[i] for i in GRIP.contacts.members],
        'corners': GRIP.contacts.corners,
        'unknowns': record.unknowns,
        'bent': record.bent,
        'responses': record.responses,
        'pose': ESTIMATE.pose,
        'pose_covariance': ESTIMATE.pose_covariance,
        'squeeze': 20.0,
        'squeeze_deviation': 3.0,
        'squeeze_assumed': True,
        'pose_delay': 0.02,
        'joint_displacements': DISPLACED[0],
        'joint_displacement_rates': DISPLACED[1],
    }
    check_fields(grip_message(), expected)


def test_grips_survive_a_round_trip():
    record = read_grip(grip_message(), NINE)
    result = record.restore(HOME, GRIP.body)
    assert result.pose == pytest.approx(GRIP.pose, abs=1e-12)
    assert result.normal_forces == pytest.approx(GRIP.normal_forces, rel=1e-9)
    assert record.estimate.pose.tolist() == ESTIMATE.pose.tolist()
    assert record.estimate.pose_covariance.tolist() == ESTIMATE.pose_covariance.tolist()
    assert record.estimate[2:5] == ESTIMATE[2:5]
    assert [values.tolist() for values in record.estimate[5:]] == [v.tolist() for v in DISPLACED]
    assert record.is_assumed


@pytest.mark.parametrize(
    'changes',
    [
        {'travel': [0.0]},
        {'travel': [float('nan')] * 6},
        {'pressures': [1e4]},
        {'pressures': [1e4, 1e4, 34.5]},
        {'members': ['north/R-P', 'south/P-Q']},
        {'members': ['south/P-Q', 'south/P-Q']},
        {'members': ['south/P-Q', 'west/A-B']},
        {'corners': [0]},
        {'unknowns': [0.0] * 10},
        {'unknowns': [float('inf')] * 11},
        {'responses': [0.1]},
        {'bent': [float('nan')]},
        {'joint_displacements': [0.0]},
        {'joint_displacement_rates': [float('nan')] * 72},
        {'pose_covariance': [-1.0] * 9},
    ],
)
def test_grips_that_are_not_usable_are_refused(changes):
    changed = grip_message()
    for name, value in changes.items():
        kind = 'I' if name == 'corners' else 'd'
        setattr(changed, name, value if name == 'members' else array.array(kind, value))
    with pytest.raises(MessageError):
        read_grip(changed, NINE)


@robots.examples(100)
@given(
    st.integers(0, 2**32 - 1), st.tuples(places, places, angles), st.tuples(rates, rates, rates)
)
def test_obstacles_survive_a_round_trip(seed, pose, velocity):
    shape = random_shape(np.random.default_rng(seed))
    obstacle = Obstacle('a', ConvexObject(shape, pose), velocity, 5.25)
    sent = to_obstacles_message([obstacle, HAND], 5.25, 'truss')
    first, second = read_obstacles(deserialize_message(serialize_message(sent), Obstacles))
    assert (first.name, first.body.shape, first.stamp) == ('a', shape, 5.25)
    assert first.body.pose == pytest.approx(pose, abs=1e-12)
    assert first.velocity == velocity
    assert second.name == 'hand'


def test_message_of_obstacles_has_their_names_shapes_poses_and_velocities():
    message = to_obstacles_message([HAND], 5.25, 'truss')
    (hand,) = message.obstacles
    expected = {'name': 'hand', 'shape': ObjectMessage(shape=ObjectMessage.DISC, diameter=0.1)}
    expected |= {'pose': to_pose_message(HAND.body.pose)}
    check_fields(hand, expected | {'velocity': messages.to_twist_message(HAND.velocity)})
    check_fields(message, {'header': make_header(5.25, 'truss'), 'obstacles': [hand]})


def test_pose_and_velocity_are_transformed_to_the_robot_frame():
    angle, shift = 0.5 * math.pi, Vector3(x=2.0, y=3.0)
    transform = Transform(translation=shift)
    transform.rotation.z, transform.rotation.w = math.sin(0.5 * angle), math.cos(0.5 * angle)
    stamped = TransformStamped(transform=transform)
    frame = RobotFrame(ROBOT, SimpleNamespace(lookup_transform=lambda *_: stamped))
    (hand,) = frame.read_obstacles(to_obstacles_message([HAND], 5.0, 'camera'))
    assert hand.body.pose == pytest.approx((1.5, 4.0, 0.2 + angle))
    assert hand.velocity == pytest.approx((0.2, 0.1, 0.3))
    (same,) = frame.read_obstacles(to_obstacles_message([HAND], 5.0, 'truss'))
    assert same.body.pose == pytest.approx(HAND.body.pose)


def changed(**fields):
    """Return a message with a hand whose fields are changed."""
    message = to_obstacles_message([HAND], 5.0, 'truss')
    for path, value in fields.items():
        *parents, last = path.split('__')
        target = message.obstacles[0]
        for name in parents:
            target = getattr(target, name)
        setattr(target, last, value)
    return message


@pytest.mark.parametrize(
    ('message', 'words'),
    [
        (changed(name=''), "name of an obstacle ''"),
        (changed(shape__shape=7), "obstacle 'hand': shape 7: must be one of"),
        (changed(shape__diameter=1000.0), "obstacle 'hand': .* if it is in mm, it is 1 m"),
        (changed(shape__mass=[2.0]), "obstacle 'hand': mass, center_of_mass and friction must"),
        (changed(pose__position__x=math.nan), "obstacle 'hand' at .*finite"),
        (changed(pose__orientation__w=3.0), "obstacle 'hand': the quaternion has norm"),
        (changed(velocity__linear__x=90.0), "obstacle 'hand': velocity .* at most 5 m/s"),
        (changed(velocity__linear__z=1.0), "obstacle 'hand': twist with linear.z 1.0"),
        (to_obstacles_message([HAND, HAND], 5.0, ''), "'hand': named twice"),
    ],
)
def test_invalid_obstacles_in_messages_are_refused_with_their_names(message, words):
    with pytest.raises(MessageError, match=words):
        read_obstacles(message)


@pytest.mark.parametrize('degrees', [0.0, 23.0])
def test_obstacle_at_any_height_is_in_the_plane_unless_it_is_tilted(degrees):
    message = to_obstacles_message([HAND], 5.0, 'truss')
    pose = message.obstacles[0].pose
    pose.position.z = 0.8
    half = 0.5 * math.radians(degrees)
    pose.orientation = Quaternion(x=math.sin(half), w=math.cos(half))
    if degrees:
        with pytest.raises(MessageError, match="'hand': tilted by 23 degrees"):
            read_obstacles(message)
        return
    (hand,) = read_obstacles(message)
    assert hand.body.pose[:2] == pytest.approx(HAND.body.pose[:2])


def test_wall_is_no_moving_obstacle():
    with pytest.raises(GraspError, match="'floor': a wall does not move"):
        to_obstacles_message([Obstacle('floor', ConvexObject(HalfPlane()))], 0.0, '')


PAGE = Path(__file__).parents[3] / 'docs' / 'obstacles.md'


@pytest.fixture(scope='module')
def convert():
    """Return the function of the page from a collision object to obstacles."""
    names = {}
    (code,) = re.findall(r'```py\n(.*?)```', PAGE.read_text('utf-8'), re.DOTALL)
    exec(compile(code, PAGE.name, 'exec'), names)
    return lambda **fields: read_obstacles(names['to_obstacles'](collision(**fields)))


def at(x=0.0, y=0.0, angle=0.0):
    """Return a pose in the plane."""
    turn = Quaternion(z=math.sin(0.5 * angle), w=math.cos(0.5 * angle))
    return Pose(position=Point(x=x, y=y), orientation=turn)


def solid(kind, *dimensions):
    """Return a stand-in for shape_msgs/SolidPrimitive."""
    kinds = {'BOX': 1, 'SPHERE': 2, 'CYLINDER': 3, 'CONE': 4}
    return SimpleNamespace(type=kinds[kind], dimensions=dimensions, **kinds)


def collision(solids=(), meshes=(), pose=None, poses=()):
    """Return a stand-in for moveit_msgs/CollisionObject, whose shapes have poses."""
    count = len(solids)
    return SimpleNamespace(
        header=make_header(5.0, 'world'),
        id='table',
        pose=pose or at(),
        primitives=solids,
        primitive_poses=poses[:count],
        meshes=meshes,
        mesh_poses=poses[count:],
    )


def corners(obstacle):
    """Return the vertices of a polygon in the robot frame from the leftmost one, x + iy."""
    points = obstacle.body.outline()
    return np.roll(points, -int(points.real.argmin()))


def test_box_becomes_a_polygon_at_the_pose_of_the_collision_object(convert):
    box, pose, inner = solid('BOX', 0.4, 0.2, 1.0), at(1.0, 2.0, 0.5 * math.pi), at(0.3, 0.0, 0.1)
    (table,) = convert(solids=[box], pose=pose, poses=[inner])
    own = np.array([-0.2 - 0.1j, 0.2 - 0.1j, 0.2 + 0.1j, -0.2 + 0.1j])
    expected = 1.0 + 2.0j + 1j * (0.3 + own * np.exp(0.1j))
    assert corners(table) == pytest.approx(np.roll(expected, -int(expected.real.argmin())))
    assert table.name == 'table 0'


def test_tilted_box_becomes_its_footprint(convert):
    tilted = Pose(orientation=Quaternion(y=math.sin(0.15), w=math.cos(0.15)))
    (table,) = convert(solids=[solid('BOX', 0.4, 0.2, 1.0)], poses=[tilted])
    half = 0.2 * math.cos(0.3) + 0.5 * math.sin(0.3)
    assert np.abs(corners(table).real) == pytest.approx(half)


def test_upright_cylinder_and_sphere_become_discs(convert):
    solids = [solid('CYLINDER', 2.0, 0.1), solid('SPHERE', 0.2)]
    post, ball = convert(solids=solids, pose=at(1.0, 0.0), poses=[at(0.5), at(0.0, 0.7)])
    assert (post.body.shape.diameter, ball.body.shape.diameter) == (0.2, 0.4)
    assert (post.body.center, ball.body.center) == (1.5, 1.0 + 0.7j)


def test_mesh_becomes_the_convex_polygon_around_it(convert):
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 3.0), (0.1, 0.9, 1.0)]
    mesh = SimpleNamespace(
        vertices=[Point(x=float(x), y=float(y), z=float(z)) for x, y, z in vertices]
    )
    (table,) = convert(meshes=[mesh], poses=[at(2.0)])
    assert sorted(corners(table), key=lambda p: (p.real, p.imag)) == pytest.approx(
        [2.0, 2.0 + 1.0j, 3.0, 3.0 + 1.0j]
    )


def test_cone_is_refused_with_the_name_of_the_object(convert):
    with pytest.raises(ValueError, match='table: solid of type 4'):
        convert(solids=[solid('CONE', 1.0, 0.2)], poses=[at()])


NAMES = list(ROBOT.roller_names)
FRAME = ROBOT.frame
CENTER = tangent_center(ROBOT.home, MODULE, DIAMETER)
BAD = (math.nan, math.inf, -math.inf)
HUGE = (1e308, -1e308, 1e100)
EXTREME, SMALL = (*BAD, *HUGE), (0.0, 0.5, 5e-324)
MANY = 10**5
numbers = st.floats(-1e3, 1e3)


def joint_states(**changes):
    return JointState(**({'name': NAMES, 'position': [0.0] * N} | changes))


def object_pose(frame=FRAME, **changes):
    pose = PoseMessage(position=Point(x=CENTER[0], y=CENTER[1]), orientation=Quaternion(w=1.0))
    for name, value in changes.items():
        setattr(pose, name, value)
    return PoseStamped(header=Header(frame_id=frame), pose=pose)


def wrench(frame=f'{FRAME}_object_aligned', **components):
    values = [components.get(name, 0.0) for name in ('fx', 'fy', 'm')]
    return WrenchStamped(header=Header(frame_id=frame), wrench=to_wrench_message(values))


def pressure(tube, value):
    return FluidPressure(header=Header(frame_id=tube), fluid_pressure=value)


def velocity(part, **components):
    """Return a twist with components of its linear or angular part."""
    return Twist(**{part: Vector3(**components)})


PRESSURE_RANGE = 'must be from 1000 to 300000'
REJECTED = {
    'joint states': (
        lambda message: sensor_messages.read_roller_part(message, NAMES),
        [
            *((joint_states(position=[v] + [0.0] * (N - 1)), 'finite, at most') for v in EXTREME),
            *((joint_states(velocity=[v] * N), 'must be at most') for v in (math.inf, *HUGE)),
            (joint_states(position=[]), '0 positions for 6 names'),
            (joint_states(velocity=[0.0] * (N - 1)), '5 velocities for 6 names'),
            (joint_states(position=[0.0] * MANY), f'{MANY} positions for 6 names'),
        ],
    ),
    'object pose': (
        RobotFrame(ROBOT).read_pose,
        [
            *((object_pose(position=Point(x=v)), 'must be finite, at most') for v in EXTREME),
            *((object_pose(position=Point(y=v)), 'must be finite, at most') for v in EXTREME),
            (object_pose(position=Point(x=750.0)), r'x must be .* if it is in mm, it is 0\.75 m'),
            *((object_pose(orientation=Quaternion(w=v)), 'norm') for v in (*EXTREME, *SMALL)),
            (object_pose(orientation=Quaternion(z=math.nan, w=1.0)), 'norm'),
            (object_pose(orientation=Quaternion(x=1.0, y=1.0, z=1.0, w=1.0)), 'norm 2'),
            (object_pose(frame='map'), "in frame 'map': must be 'truss'"),
        ],
    ),
    'joint markers': (
        lambda joints: sensor_messages.read_joint_markers(
            sensor_messages.to_joint_markers(joints), ROBOT
        ),
        [
            ({'W': (0.0, 0.0)}, "joint marker 'W': must be one of P, Q"),
            ({'P': (math.nan, 0.0)}, 'joint marker P at .nan, 0.0.: x must be finite'),
            ({'P': (0.0, -1e7)}, r'joint marker P at .*: y must be finite, at most 100 m'),
        ],
    ),
    'twist': (
        messages.read_twist,
        [
            *((velocity('linear', **{axis: v}), 'finite') for axis in 'xy' for v in BAD),
            *((velocity('angular', z=v), 'finite') for v in BAD),
            *((velocity('linear', z=v), 'planar') for v in (*EXTREME, 5e-324)),
            *((velocity('angular', **{axis: v}), 'planar') for axis in 'xy' for v in EXTREME),
        ],
    ),
    'external wrench': (
        lambda message: read_external_wrench(message, FRAME),
        [
            *(
                (wrench(**{name: v}), 'must be 3 finite numbers, at most 1e')
                for name in ('fx', 'fy', 'm')
                for v in (*EXTREME, 1.01 * MAX_LOAD, -1.01 * MAX_LOAD)
            ),
            (wrench(FRAME), "in frame 'truss': must be in 'truss_object_aligned'"),
            (wrench(f'{FRAME}_object'), "must be in 'truss_object_aligned'"),
        ],
    ),
    'tube pressure': (
        lambda message: sensor_messages.read_tube_pressure(message, ROBOT, 0.0),
        [
            (pressure('east', -1.0), rf'tube east \[Pa\]: -1.0: {PRESSURE_RANGE}'),
            (pressure('east', 34.5), rf'tube east \[Pa\]: 34.5: {PRESSURE_RANGE}'),
            (pressure('east', 1e7), rf'tube east \[Pa\]: 10000000.0: {PRESSURE_RANGE}'),
            (pressure('south', math.nan), 'tube south '),
            (pressure('north', math.inf), 'tube north '),
            (pressure('west', 3e4), "frame_id 'west': must be one of"),
        ],
    ),
}


@pytest.mark.parametrize('name', REJECTED)
def test_invalid_messages_are_rejected_with_the_faulty_field(name):
    read, cases = REJECTED[name]
    for message, words in cases:
        with pytest.raises(messages.MessageError, match=words) as error:
            read(message)
        assert len(str(error.value)) < 1000


@robots.examples(100)
@given(
    st.permutations(range(N)),
    st.lists(numbers, min_size=N, max_size=N),
    st.lists(st.floats(-10.0, 10.0), min_size=N, max_size=N),
)
def test_selects_the_rollers_in_any_order_among_other_joints(order, travel, speeds):
    message = JointState(
        name=['gripper', *(NAMES[i] for i in order)],
        position=[math.nan, *(travel[i] for i in order)],
        velocity=[math.inf, *(speeds[i] for i in order)],
    )
    result = sensor_messages.read_roller_part(message, NAMES)
    assert [result[i] for i in range(N)] == list(zip(travel, speeds, strict=True))


@pytest.mark.parametrize('velocity', [[], [math.nan] * N])
def test_velocities_that_are_not_measured_are_zero(velocity):
    result = sensor_messages.read_roller_part(joint_states(velocity=velocity), NAMES)
    assert result == dict.fromkeys(range(N), (0.0, 0.0))


@robots.examples(100)
@given(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3))
def test_twists_survive_a_round_trip(twist):
    assert messages.read_twist(messages.to_twist_message(twist)) == twist
    assert messages.read_twist(messages.to_twist_message(np.array(twist))) == twist


@robots.examples(100)
@given(st.integers(0, 2**31 - 1), st.integers(0, 10**9 - 1))
def test_stamps_survive_a_round_trip(sec, nanosec):
    when = messages.read_stamp(Header(stamp=Time(sec=sec, nanosec=nanosec)))
    assert messages.read_stamp(messages.make_header(when)) == pytest.approx(when, abs=3e-7)
    assert messages.read_stamp(messages.make_header(-when)) == 0.0


@pytest.mark.parametrize(
    ('frame', 'force'),
    [('', (1.0, -2.0)), (f'{FRAME}_object_aligned', (1.0, -2.0)), (f'{FRAME}_object', (2.0, 1.0))],
)
def test_a_wrench_is_planar_and_turns_with_the_object_in_its_frame(frame, force):
    message = wrench(frame, fx=1.0, fy=-2.0, m=MAX_LOAD)
    message.wrench.force.z = message.wrench.torque.x = math.nan
    result = read_external_wrench(message, FRAME, 0.5 * math.pi)
    assert result == pytest.approx((*force, MAX_LOAD), rel=1e-15)


def test_ambient_pressure_is_subtracted_from_absolute_pressures():
    result = sensor_messages.read_tube_pressure(pressure('east', 121_325.0), ROBOT, 101_325.0)
    assert result == ('east', pytest.approx(2e4))
