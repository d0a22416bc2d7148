# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Carry a held object along a path, with feedback of its measured pose."""

from isotruss_ros import core
from isotruss_ros.core.paths.path_tracking import PathPhase, TrackingSettings
import numpy as np

PERIOD = 0.02  # [s]
home = core.load_robot('nine_member').home
body = core.ConvexObject.disc(core.tangent_center(home, 'north/Z', 0.3), 0.3)
rolling = core.RollingGrip.attach(home, core.Grip.at_module(home.robot, 'north/Z', body))
faults = core.RollerFaults(slip=0.05)  # slip, which encoders do not measure
robot = core.SimulatedRobot(home, core.RigidObject(rolling), faults, seed=1)

start = robot.object_pose
poses = [(start.x, start.y, 0.0), (start.x, start.y + 0.05, 0.0), (start.x + 0.05, start.y, 0.2)]
path = core.ObjectPath(poses, speed=0.02, turn_rate=0.2)
tracker = core.PathTracker(path, TrackingSettings(), period=PERIOD)

phase, finished = None, (PathPhase.REACHED, PathPhase.OFF_PATH, PathPhase.STUCK)
while phase not in finished:
    pose = robot.object_pose
    tracking = tracker.update(pose, age=0.0, elapsed=PERIOD)
    phase = tracking.phase
    grip = core.Grip.at_module(home.robot, 'north/Z', body.moved_to(pose))
    command = core.solve_twist(robot.config, grip, tracking.twist)
    robot.command(command.roller_velocities)
    robot.advance(PERIOD)

end = robot.object_pose
off = np.hypot(end.x - poses[-1][0], end.y - poses[-1][1])
print(phase.name.lower(), f'{1000 * off:.2f} mm off')
