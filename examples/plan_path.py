# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Find a path of a held object around a post, and stop before the post without it."""

from isotruss_ros import core
from isotruss_ros.core.planning.foresee_path import foresee_path

robot = core.load_robot('nine_member')
center = core.tangent_center(robot.home, 'north/Z', 0.3, shift=0.02)
body = core.ConvexObject.disc(center, diameter=0.3, friction=0.8)
grip = core.Grip.at_module(robot, 'north/Z', body)
post = core.Obstacle('post', core.ConvexObject.disc((0.805, 0.574), 0.063))
goal = (1.045, 0.781, 0.615)

plan = core.plan_path(robot, grip, goal, [post])
print(plan.why or f'{len(plan)} poses lead around the post')

held = core.settle_grasp(robot.home, body).equilibrium
straight = foresee_path(held, body.friction, plan.poses[[0, -1]], obstacles=[post])
print(f'straight: {straight.why}, at {straight.share:.0%} of the path')
