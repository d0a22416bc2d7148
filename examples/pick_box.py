# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pick up a box between two sides that do not meet, turn it, and release it."""

from isotruss_ros import core
import numpy as np

SIDES, RATE = ('south/P-Q', 'north/R-P'), 50.0  # sides of two tubes, with the hole between them
robot = core.load_robot('nine_member')
shape = core.Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], corner_radius=0.02)
lying = core.place_between(robot.home, SIDES, shape, angle=-0.5, indentation=-0.02)
box = core.ElasticObject(lying.body, friction=0.9)  # pushed and held by elastic tubes
plant = core.SimulatedRobot(robot.home, box, core.RollerFaults())


def drive(twist: object, seconds: float, opening_rate: float = 0.0) -> None:
    """Move the box, or open and close the sides, for some time."""
    for _ in range(round(seconds * RATE)):
        body = lying.body.moved_to(plant.object_pose)
        grip = core.Grip(SIDES, body, 0.9)
        command = core.solve_twist(plant.config, grip, twist, opening_rate=opening_rate)
        plant.command(command.roller_velocities)
        plant.advance(1.0 / RATE)


def report(when: str) -> None:
    """Print the pose of the box and whether it is held."""
    x, y, angle = plant.object_pose
    held = f'held, slip margin {box.slip_margin:.1f} N' if box.grasp else 'lies'
    print(f'{when:10} ({x:.3f}, {y:.3f}) m, {np.degrees(angle):6.1f} degrees: {held}')


report('at first')
drive(np.zeros(3), 4.0, opening_rate=-0.02)
report('closed')
drive([0.02, 0.0, 0.05], 5.0)
report('turned')
assert box.grasp is not None
drive(np.zeros(3), 4.0, opening_rate=0.02)
report('put down')
assert box.grasp is None
