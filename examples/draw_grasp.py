# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Draw a robot that presses an object, and the forces on it: writes drawing.png."""

from isotruss_ros import core, plotting
from matplotlib.figure import Figure

config = core.load_robot('nine_member').home
x, y = core.tangent_center(config, 'north/Z', 0.3)
pressed = core.ConvexObject.disc((x, y + 0.01), 0.3)  # 1 cm deeper into the corner
analysis = core.analyze_grasp(config, pressed, friction=0.5)

figure = Figure(figsize=(9.0, 4.5), layout='constrained')
left, right = figure.subplots(1, 2)
plotting.plot_robot(config, left)
left.autoscale_view()
left.set_aspect('equal')
plotting.plot_grasp(config, pressed, analysis, right)
figure.savefig('drawing.png')
print('the members press with', round(analysis.normal_forces.sum(), 1), 'N: see drawing.png')
