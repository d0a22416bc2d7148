# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compute whether friction holds a grasped object, and its slip margin."""

from isotruss_ros import core

config = core.load_robot('nine_member').home
x, y = core.tangent_center(config, 'north/Z', 0.3)
pressed = core.ConvexObject.disc((x, y + 0.02), 0.3)

for friction in (0.4, 0.8):
    grasp = core.settle_grasp(config, pressed, friction)
    print(f'friction {friction}: {"held" if grasp.held else grasp.reason}')
    if grasp.held:
        for member, force in grasp.normal_forces.items():
            print(f'  {member} presses with {force:.1f} N')
        print(f'  slips from {grasp.slip_margin:.2f} N on')
