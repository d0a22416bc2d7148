# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Map slip margin and chance of being held over the position of a disc: chance_map.png."""

from isotruss_ros import core
from isotruss_ros.extras import explained_imports
import numpy as np

with explained_imports():
    from matplotlib.figure import Figure

SAMPLES = 50  # at each position
config = core.load_robot('nine_member').home
uncertainty = core.Uncertainty(stiffness=0.1, roller_offset=0.003)
left, low = core.tangent_center(config, 'north/Z', 0.3) - np.array([0.05, 0.005])
x, y = np.meshgrid(np.linspace(left, left + 0.1, 25), np.linspace(low, low + 0.06, 16))
poses = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
disc, members = core.ConvexObject.disc((0.0, 0.0), 0.3), ('north/P-Z', 'north/Z-R')
grasps = core.settle_grasps(config, disc, 0.7, members=members, poses=poses)
margin = np.reshape(np.where(grasps.held, grasps.slip_margin, np.nan), x.shape)
# With the same random numbers at all positions, few samples of each give a smooth map.
chances = [grasp.chance(uncertainty, samples=SAMPLES).probability for grasp in grasps]
chance = np.reshape(chances, x.shape)
safest = np.unravel_index(chance.argmax(), x.shape)
firmest = np.nanargmax(margin[:, safest[1]]), safest[1]  # the margin does not depend on x
figure = Figure(figsize=(9.0, 2.8), layout='constrained')
maps = (
    (margin, np.arange(0.0, 1.5, 0.2), 'nominal slip margin [N]'),
    (chance, np.arange(0.0, 1.05, 0.1), 'chance of being held'),
)
for axes, (values, levels, label) in zip(figure.subplots(1, 2), maps, strict=True):
    filled = axes.contourf(x, y, values, levels)
    axes.plot(x[firmest], y[firmest], 'kx', x[safest], y[safest], 'ro')
    axes.set(xlabel='x [m]', ylabel='y [m]', aspect='equal')
    figure.colorbar(filled, ax=axes, label=label)
figure.savefig('chance_map.png', dpi=110)
print(f'largest chance {chance[safest]:.2f}, at the largest slip margin {chance[firmest]:.2f}')
