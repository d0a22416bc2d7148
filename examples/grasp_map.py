# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Map slip margin and force closure over the position of a large disc: writes map.png."""

from isotruss_ros import core
from isotruss_ros.extras import explained_imports
import numpy as np

with explained_imports():
    from isotruss_ros import plotting
    from matplotlib.figure import Figure

config = core.load_robot('nine_member').home
x, y = np.meshgrid(np.linspace(0.62, 0.82, 20), np.linspace(0.31, 0.51, 20))
# Each disc is grasped by the two or three members that it touches at its position [m].
poses = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
disc = core.ConvexObject.disc((0.0, 0.0), 0.6)
grasps = core.settle_grasps(config, disc, friction=0.8, poses=poses)
has_closure = grasps.required_friction <= grasps.friction
margin = np.reshape(np.where(has_closure, grasps.slip_margin, np.nan), x.shape)
held = np.reshape(grasps.held, x.shape)
figure = Figure(figsize=(9.0, 4.2), layout='constrained')
left, right = figure.subplots(1, 2, width_ratios=(1, 1.4))
plotting.plot_robot(config, left).plot(x[held], y[held], '.', ms=2)
left.autoscale_view()
left.set(title='centres at which the disc is held')
filled = right.contourf(x, y, margin, np.linspace(0.0, 6.0, 13), extend='max')
right.contour(x, y, held, [0.5], colors='white')
right.set(xlabel='x [m]', ylabel='y [m]', title='coloured: force closure; line: held')
for axes in (left, right):
    axes.set_aspect('equal')
figure.colorbar(filled, ax=right, label='slip margin [N]')
figure.savefig('map.png')
print(f'held with a slip margin of up to {margin[held].max():.1f} N: see map.png')
