# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draw a robot with the forces on its object: writes drawing.png."""

from isotruss_ros import core
from isotruss_ros.extras import explained_imports

with explained_imports():
    from isotruss_ros import plotting
    from matplotlib.figure import Figure

config = core.load_robot('nine_member').home
x, y = core.tangent_center(config, 'north/Z', 0.3)
pressed = core.ConvexObject.disc((x, y + 0.01), 0.3)  # 1 cm deeper into the corner
held = core.settle_grasp(config, pressed, friction=0.8)

figure = Figure(figsize=(9.0, 4.5), layout='constrained')
left, right = figure.subplots(1, 2)
plotting.plot_robot(config, left)
left.autoscale_view()
left.set_aspect('equal')
plotting.plot_grasp(held.equilibrium, right)
figure.savefig('drawing.png')
print('the members press with', round(sum(held.normal_forces.values()), 1), 'N: see drawing.png')
