"""The path of the demonstration, the whole of it without middleware, and what it draws."""

import math

from isotruss_ros.core import (
    analyze_grasp,
    Cylinder,
    GraspRequirements,
    load_robot,
    LooseObject,
    plan_grasps,
    RollerFaults,
    RollerPath,
    RollerState,
    Sample,
    SimulatedRobot,
    Status,
    TwistServo,
)
from isotruss_ros.core.roller_path_servo import RollerPathServo
from isotruss_ros.demo.__main__ import GRIP_MODULE, MIN_MARGIN, OBJECT_CENTER, OBJECT_DIAMETER
from isotruss_ros.demo.figures import animate, draw_panels
from isotruss_ros.demo.path import figure_9
from isotruss_ros.demo.record import PhaseRecord, Snapshot
import numpy as np
from PIL import Image
import pytest
from scipy.integrate import quad_vec

ROBOT = load_robot('nine_member')
PHASES = figure_9()


def integral(phase):
    """Return (dx, dy, dangle) of a phase by quadrature."""
    return quad_vec(lambda t: np.array(phase.twist(t)), 0.0, phase.duration)[0]


def test_path_is_that_of_figure_9():
    up, turn, arc = PHASES
    assert integral(up) == pytest.approx([0.0, 0.2, 0.0], abs=1e-9)
    assert integral(turn) == pytest.approx([0.0, 0.0, 0.5 * math.pi], abs=1e-9)
    assert integral(arc) == pytest.approx([0.25, -0.25, -0.5 * math.pi], abs=1e-6)


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
    """Plan a grasp of the object where it lies, and go there; return the time it took."""
    cylinder = Cylinder(OBJECT_CENTER, OBJECT_DIAMETER)
    needs = GraspRequirements(module=GRIP_MODULE, min_margin=MIN_MARGIN, count=1)
    grasp = plan_grasps(ROBOT.home, cylinder, needs, thorough=False).grasps[0]
    ways = np.abs(np.diff(grasp.path, axis=0)).max(axis=1)
    times = np.append(0.0, np.cumsum(np.maximum(ways / ROBOT.description.max_speed, 1e-3)))
    servo = RollerPathServo(ROBOT, timeout=0.2)
    now = 0.0

    def measure():
        state = RollerState(simulated.roller_positions, simulated.roller_velocities)
        servo.rollers = Sample(state, now)

    measure()
    servo.begin(RollerPath(ROBOT, grasp.path, times), now)
    while servo.busy:
        step = servo.decide(now)
        assert not step.failure
        simulated.command(step.speeds)
        simulated.advance(period)
        now += period
        measure()
    return now


def play(rate):
    """Grip the object and carry it along the whole path; return records and the exact end."""
    home, period = ROBOT.home, 1.0 / rate
    lying = LooseObject(Cylinder(OBJECT_CENTER, OBJECT_DIAMETER), friction=0.5)
    simulated = SimulatedRobot(home, lying, RollerFaults())
    now = grip(simulated, period)
    assert lying.grip == GRIP_MODULE
    gripped = Cylinder(simulated.object_pose[:2], OBJECT_DIAMETER)
    assert analyze_grasp(simulated.config, gripped).force_closure
    servo = TwistServo(ROBOT, GRIP_MODULE, OBJECT_DIAMETER, period, timeout=0.2)
    # What the servo sees is one cycle old, as over a real transport.
    config = simulated.config
    seen = (config.roller_positions, simulated.roller_velocities, simulated.object_pose)
    exact = np.array(simulated.object_pose)
    records = []
    for phase in PHASES:
        record = PhaseRecord(phase.name)
        for k in range(round(phase.duration * rate)):
            twist = phase.twist(k * period)
            servo.twist = Sample(twist, now)
            servo.rollers = Sample(RollerState(seen[0], seen[1]), now - period)
            servo.center = Sample(seen[2][:2], now - period)
            config = simulated.config
            seen = (config.roller_positions, simulated.roller_velocities, simulated.object_pose)
            command = servo.decide(now).command
            record.statuses.add(command.status)
            simulated.command(command.roller_velocities)
            simulated.advance(period)
            exact += period * np.array(twist)
            now += period
            record.snapshots.append(
                Snapshot(now, simulated.config.roller_positions, simulated.object_pose)
            )
        records.append(record)
    return simulated, records, exact


@pytest.fixture(scope='module')
def played():
    """Play the path once at the rate of the nodes."""
    return play(200.0)


def test_object_ends_where_the_commands_put_it(played):
    simulated, records, exact = played
    pose = simulated.object_pose
    assert math.hypot(pose.x - exact[0], pose.y - exact[1]) < 1e-6
    assert abs(math.remainder(pose.angle - exact[2], 2.0 * math.pi)) < 1e-6
    assert set().union(*(record.statuses for record in records)) <= {Status.OK, Status.IDLE}


def test_constraints_hold_after_the_whole_path(played):
    simulated, _, _ = played
    config, home, layout = simulated.config, ROBOT.home, ROBOT.layout
    assert np.abs(config.residual()).max() < 1e-9
    for tube in range(len(layout.tube_names)):
        on_tube = layout.tube == tube
        assert config.member_lengths[on_tube].sum() == pytest.approx(
            home.member_lengths[on_tube].sum(), abs=1e-9
        )


def test_pictures_are_written(played, tmp_path):
    _, records, _ = played
    for record in records:
        record.snapshots = record.snapshots[::40] + record.snapshots[-1:]
    start = PhaseRecord('start', snapshots=records[0].snapshots[:1])
    draw_panels(ROBOT, OBJECT_DIAMETER, [start, *records], tmp_path / 'demo.png')
    with Image.open(tmp_path / 'demo.png') as picture:
        # Four panels with something in each: no quarter is blank.
        pixels = np.asarray(picture.convert('L'))
        for half in np.array_split(pixels, 2):
            for quarter in np.array_split(half, 2, axis=1):
                assert quarter.std() > 10.0
    animate(ROBOT, OBJECT_DIAMETER, records, tmp_path / 'demo.gif')
    with Image.open(tmp_path / 'demo.gif') as animation:
        assert animation.n_frames > 50
