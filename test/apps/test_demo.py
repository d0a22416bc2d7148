# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The demonstration without middleware: its path, its grasp and its pictures."""

import math
import signal

from geometry_msgs.msg import Point
from isotruss_msgs.msg import PlannedGrasp, StateEstimate
from isotruss_ros.core import (
    analyze_grasp,
    ConvexObject,
    ElasticObject,
    GraspRequirements,
    load_robot,
    plan_grasps,
    Pose,
    RollerFaults,
    settle_grasp,
    SimulatedRobot,
    Status,
    TwistServo,
)
from isotruss_ros.core.control.inputs import RollerState, StampedInput
from isotruss_ros.core.control.load_estimate import LoadSettings
from isotruss_ros.core.control.roller_trajectory import RollerTrajectory, RollerTrajectoryServo
from isotruss_ros.core.control.squeeze_control import SqueezeControl, SqueezeSettings
from isotruss_ros.demo import processes
from isotruss_ros.demo import run as demo
from isotruss_ros.demo.figures import animate, draw_panels
from isotruss_ros.demo.gripping import is_sure, slow_down, SURE
from isotruss_ros.demo.path import figure_9
from isotruss_ros.demo.record import PhaseRecord, Snapshot
from isotruss_ros.demo.run import (
    FRICTION,
    GRIP_MODULE,
    LOAD,
    OBJECT_CENTER,
    OBJECT_DIAMETER,
    OBJECT_MASS,
    PULL,
    SQUEEZE,
)
from isotruss_ros.demo.sensors import sensor_faults, truth_table
from isotruss_ros.nodes import simulator
from isotruss_ros.nodes.conversions.path_messages import (
    read_duration,
    to_trajectory_message,
)
import numpy as np
from PIL import Image
import pytest
from scipy.integrate import quad_vec

ROBOT = load_robot('nine_member')
PHASES = figure_9(PULL)


def integral(phase):
    """Return (dx, dy, dangle) of a phase by quadrature."""
    return quad_vec(lambda t: np.array(phase.twist(t)), 0.0, phase.duration)[0]


def test_path_is_that_of_figure_9():
    up, turn, arc = PHASES
    assert integral(up) == pytest.approx([0.0, 0.25, 0.0], abs=1e-9)
    assert integral(turn) == pytest.approx([0.0, 0.0, 0.5 * math.pi], abs=1e-9)
    assert integral(arc) == pytest.approx([0.35, -0.35, -0.5 * math.pi], abs=1e-6)


def test_orientation_stays_normal_to_the_arc():
    _, turn, arc = PHASES
    angle = integral(turn)[2]
    times = np.linspace(0.0, arc.duration, 400)
    for t, step in zip(times, np.diff(times), strict=False):
        vx, vy, omega = arc.twist(t)
        across = vx * math.cos(angle) + vy * math.sin(angle)
        assert abs(across) < 2e-3 * math.hypot(vx, vy) + 1e-9
        angle += step * arc.twist(t + 0.5 * step)[2]
        assert omega <= 0.0


@pytest.mark.parametrize('phase', PHASES, ids=lambda phase: phase.name)
def test_phases_begin_and_end_at_rest(phase):
    for time in (0.0, phase.duration, phase.duration + 1.0):
        assert phase.twist(time) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


def grip(simulated, period):
    """Plan a grasp of the free object and move there; return the time of arrival."""
    cylinder = ConvexObject.disc(OBJECT_CENTER, OBJECT_DIAMETER)
    needs = GraspRequirements(friction=FRICTION, module=GRIP_MODULE, squeeze=SQUEEZE, count=3)
    grasp = plan_grasps(ROBOT.home, cylinder, needs).grasps[0]
    ways = np.abs(np.diff(grasp.path, axis=0)).max(axis=1)
    times = np.append(0.0, np.cumsum(np.maximum(ways / ROBOT.description.max_speed, 1e-3)))
    servo = RollerTrajectoryServo(ROBOT, timeout=0.2)
    now = 0.0

    def measure():
        state = RollerState(simulated.roller_positions, simulated.roller_velocities)
        servo.rollers = StampedInput(state, now)

    measure()
    servo.begin(RollerTrajectory(ROBOT, grasp.path, times), now)
    while servo.busy:
        step = servo.decide(now)
        assert not step.failure
        simulated.command(step.speeds)
        simulated.advance(period)
        now += period
        measure()
    return now


def check_grasp(simulated):
    """Check that the object is held, and that no tube is near to wrinkling."""
    cylinder = ConvexObject.disc(simulated.object_pose[:2], OBJECT_DIAMETER)
    assert settle_grasp(simulated.config, cylinder, FRICTION).held
    analysis = analyze_grasp(simulated.config, cylinder)
    assert max(analysis.utilisation.values()) < 0.8


def play(rate):
    """Grip the object and move it along the whole path; return records and the exact end."""
    home, period = ROBOT.home, 1.0 / rate
    lying = ElasticObject(ConvexObject.disc(OBJECT_CENTER, OBJECT_DIAMETER), FRICTION)
    simulated = SimulatedRobot(home, lying, RollerFaults())
    # At the nodes' rate: the squeeze depends by some per cent on the steps of the first touch.
    now = grip(simulated, 0.01)
    check_grasp(simulated)
    assert lying.grasp.squeeze == pytest.approx(SQUEEZE, rel=0.02)
    assert simulated.object_pose[:2] == pytest.approx(OBJECT_CENTER, abs=1e-3)
    servo = TwistServo(ROBOT, GRIP_MODULE, OBJECT_DIAMETER, period, timeout=0.2)
    servo.object_mass = OBJECT_MASS
    servo.squeeze = SqueezeControl(SqueezeSettings(SQUEEZE, FRICTION, load=LoadSettings(LOAD)))
    # The servo's inputs are one cycle old, as over a real transport.
    config = simulated.config
    seen = (config.roller_positions, simulated.roller_velocities, simulated.object_pose)
    exact = np.array(simulated.object_pose)
    records, margins = [], []
    for phase in PHASES:
        record = PhaseRecord(phase.name, pull=phase.pull)
        for k in range(round(phase.duration * rate)):
            twist, wrench = phase.twist(k * period), phase.wrench(k * period)
            if any(wrench):
                record.pulled = (min(record.pulled[0], now), now)
            lying.external_wrench = wrench
            servo.twist = StampedInput(twist, now)
            servo.rollers = StampedInput(RollerState(seen[0], seen[1]), now - period)
            servo.pose = StampedInput(seen[2], now - period)
            config = simulated.config
            seen = (config.roller_positions, simulated.roller_velocities, simulated.object_pose)
            command = servo.decide(now).command
            record.statuses.add(command.status)
            # A load that comes or goes at once moves the tubes quicker than the servo may.
            assert command.scale == 1.0 or (phase.pull is not None and command.scale > 0.5)
            simulated.command(command.roller_velocities)
            simulated.advance(period)
            assert lying.grasp is not None
            margins.append(lying.slip_margin)
            exact += period * command.scale * np.array(twist)
            now += period
            record.snapshots.append(
                Snapshot(now, simulated.config.roller_positions, simulated.object_pose)
            )
        records.append(record)
        check_grasp(simulated)
        assert lying.grasp.squeeze == pytest.approx(SQUEEZE, rel=2e-3)
    # What it bears beside the pull is less by the pull, or less still.
    assert 0.5 < min(margins) < max(margins) - 2.0
    return simulated, records, exact


@pytest.fixture(scope='module')
def played():
    """Play the path once; half of the nodes' rate is cheaper, and exact enough."""
    return play(25.0)


@pytest.mark.nightly
def test_object_ends_where_the_commands_put_it(played):
    simulated, records, exact = played
    pose = simulated.object_pose
    assert math.hypot(pose.x - exact[0], pose.y - exact[1]) < 1e-4
    assert abs(math.remainder(pose.angle - exact[2], 2.0 * math.pi)) < math.radians(0.1)
    odd = set().union(*(record.statuses for record in records)) - {Status.OK, Status.IDLE}
    assert odd <= {Status.SLOWED_UTILISATION}


@pytest.mark.nightly
def test_constraints_hold_after_the_whole_path(played):
    simulated, _, _ = played
    config, home, topology = simulated.config, ROBOT.home, ROBOT.topology
    assert np.abs(config.residual()).max() < 1e-9
    for tube in range(len(topology.tube_names)):
        on_tube = topology.tube == tube
        assert config.member_lengths[on_tube].sum() == pytest.approx(
            home.member_lengths[on_tube].sum(), abs=1e-9
        )


def test_pictures_are_written(tmp_path):
    records, begin, place = [], 0.0, np.array([*OBJECT_CENTER, 0.0])
    for phase in PHASES:
        times = np.arange(0.0, phase.duration, 0.25)
        shares = times[:, None] / phase.duration
        snapshots = [
            Snapshot(begin + time, np.zeros(6), Pose(*(place + share * integral(phase))))
            for time, share in zip(times, shares, strict=True)
        ]
        pulled = (begin, begin + 1.0) if phase.pull else PhaseRecord('').pulled
        records.append(
            PhaseRecord(phase.name, snapshots=snapshots, pull=phase.pull, pulled=pulled)
        )
        begin, place = begin + phase.duration, place + integral(phase)
    start = PhaseRecord('start', snapshots=records[0].snapshots[:1])
    draw_panels(ROBOT, OBJECT_DIAMETER, [start, *records], tmp_path / 'demo.png')
    with Image.open(tmp_path / 'demo.png') as picture:
        # Four panels with something in each: no quarter is blank.
        pixels = np.asarray(picture.convert('L'))
        for half in np.array_split(pixels, 2):
            for quarter in np.array_split(half, 2, axis=1):
                assert quarter.std() > 10.0
    animate(ROBOT, OBJECT_DIAMETER, records[:1], tmp_path / 'demo.gif')
    with Image.open(tmp_path / 'demo.gif') as animation:
        assert animation.n_frames == 17


def test_the_picture_shows_the_robot_that_runs(monkeypatch, tmp_path):
    seen = []

    def play(_options, robot, _console):
        seen.append(load_robot(robot))
        return [], None

    def draw(robot, *_, flattening):
        seen.append(robot)
        assert not flattening

    for name in ('require_egl', 'film', 'plan_table', 'motion_table', 'grasp_table'):
        monkeypatch.setattr(demo, name, lambda *_: '')
    monkeypatch.setattr(demo, '_play', play)
    monkeypatch.setattr(demo, 'draw_panels', draw)
    demo.run(['--plant', 'mujoco', '--output', str(tmp_path)])
    ran, drawn = seen
    assert drawn.description == ran.description != ROBOT.description


def test_a_slower_path_to_a_grasp_touches_at_the_same_point():
    path = to_trajectory_message(ROBOT, [[0.0] * 6, [0.01] * 6, [0.02] * 6], [0.0, 0.7, 1.9])
    grasp = PlannedGrasp(path=path, touch=path.points[1].time_from_start)
    slow_down(grasp, 2.5)
    times = [read_duration(point.time_from_start) for point in path.points]
    assert times == pytest.approx([0.0, 1.75, 4.75], abs=1e-9)
    assert path.points[1].time_from_start == grasp.touch


def test_a_signal_while_nodes_are_started_leaves_none_behind(monkeypatch, tmp_path):
    made = []

    class Started:
        """A node process that gets a signal while it is started."""

        def __init__(self, name, _parameters, _log):
            made.append(name)
            if name == 'second':
                signal.raise_signal(signal.SIGINT)
            self.name = name

        def interrupt(self):
            made.remove(self.name)

        def wait(self):
            pass

    monkeypatch.setattr(processes, 'NodeProcess', Started)
    with (
        pytest.raises(KeyboardInterrupt),
        processes.running_nodes([('first', {}), ('second', {})], tmp_path),
    ):
        pytest.fail('they are not to be used')
    assert made == []


def test_the_faults_of_real_sensors_are_parameters_of_the_simulator():
    names = {spec.name for spec in simulator.SPECS}
    assert sensor_faults('perfect') == {}
    assert sensor_faults('real')
    assert set(sensor_faults('real')) <= names


@pytest.mark.parametrize(('share', 'sure'), [(0.9, True), (1.1, False)])
def test_zeros_are_known_when_the_least_sure_of_them_is(share, sure):
    covariance = np.diag([0.0, (share * SURE) ** 2]).ravel().tolist()
    assert is_sure([StateEstimate(offsets=[0.0, 0.0], offset_covariance=covariance)]) == sure
    assert not is_sure([])


def test_the_table_of_the_truth_has_the_errors_of_squeeze_joints_and_pose():
    rollers = np.full(len(ROBOT.roller_names), 0.01)
    joints = ROBOT.configuration(rollers).nodes[: len(ROBOT.topology.joint_names)].copy()
    joints[2] += (0.003, 0.004)
    places = [Point(x=x, y=y) for x, y in joints.tolist()]
    places[1].x += 0.001
    record = PhaseRecord(
        'up',
        accepted=np.array([0.1, 0.2, 0.3]),
        measured=np.array([0.1, 0.202, 0.3 + np.radians(1.5)]),
        snapshots=[Snapshot(1.0, rollers, None)],
        squeezes=[20.0, 14.0, 25.0, 22.0],
        joints=[joints],
        estimates=[
            StateEstimate(
                joints=places,
                held=True,
                squeeze=21.0,
                travel=(rollers + 0.002).tolist(),
                offsets=[0.002] * len(rollers),
            )
        ],
    )
    table = truth_table([record], ROBOT, 20.0)
    cells = [next(iter(column.cells)) for column in table.columns]
    assert cells == ['up', '+10', '-30', '-5', '1.0', '5.0', '2.0', '1.50']
