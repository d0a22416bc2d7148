# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Map slip margin and chance of being held over the position of a disc: chance_map.png."""

from isotruss_ros import core
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.extras import explained_imports
import numpy as np

with explained_imports():
    from matplotlib.figure import Figure

config = core.load_robot('nine_member').home
uncertainty = core.Uncertainty(stiffness=0.1, roller_offset=0.003)
left, low = core.tangent_center(config, 'north/Z', 0.3) - np.array([0.05, 0.005])
x, y = np.meshgrid(np.linspace(left, left + 0.1, 25), np.linspace(low, low + 0.06, 16))


def settle(x: float, y: float) -> SettledGrasp:
    """Return the grasp with the disc at a position [m]."""
    members, disc = ('north/P-Z', 'north/Z-R'), core.ConvexObject.disc((x, y), 0.3)
    return core.settle_grasp(config, disc, 0.7, members=members)


grasps = [settle(*center) for center in zip(x.flat, y.flat, strict=True)]
margin = np.reshape([g.slip_margin if g.held else np.nan for g in grasps], x.shape)
# Without an equilibrium the chance takes samples, a second each, and is small.
chance = np.reshape(
    [g.chance(uncertainty).probability if g.equilibrium else 0.0 for g in grasps], x.shape
)
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
