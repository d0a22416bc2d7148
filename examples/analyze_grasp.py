# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Press an object that is held fast into a corner of the robot: the analysis of the paper."""

from isotruss_ros import core

config = core.load_robot('nine_member').home
x, y = core.tangent_center(config, 'north/Z', 0.3)
pressed = core.ConvexObject.disc((x, y + 0.01), 0.3)  # 1 cm deeper into the corner

grasp = core.analyze_grasp(config, pressed, friction=0.5)
print(f'{len(grasp.normal_forces)} contact points, {grasp.normal_forces.sum():.1f} N in all')
for member, length in grasp.contact_lengths.items():
    print(f'{member} touches over {1000 * length:.0f} mm')
print('normal forces add up to', grasp.normal_wrench.round(3) + 0.0, '[N, N, N m]')
print('closed by friction:', grasp.closed_by_friction)
print('required coefficient of friction:', grasp.required_friction)
