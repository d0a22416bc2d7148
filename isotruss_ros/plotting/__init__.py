# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Drawings of robots, grasps and fits with Matplotlib."""

from isotruss_ros.plotting.grasp_drawing import plot_grasp
from isotruss_ros.plotting.robot_drawing import plot_robot

__all__ = ['plot_grasp', 'plot_robot']
