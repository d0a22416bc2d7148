# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The core is plain Python: it works where ROS is not installed, and loads what it needs."""

import subprocess
import sys

from isotruss_ros import core

SCRIPT = """
import sys

blocked = ('rclpy', 'rcl_interfaces', 'std_msgs', 'geometry_msgs', 'sensor_msgs', 'isotruss_msgs',
           'builtin_interfaces', 'visualization_msgs', 'ament_index_python', 'rosidl_runtime_py')
for name in blocked:
    sys.modules[name] = None  # importing it raises ImportError

from isotruss_ros import core

assert 'jsonschema' not in sys.modules, 'the core imports it before a robot file is read'
for name in core.__all__:
    getattr(core, name)
robot = core.load_robot('nine_member')
center = core.tangent_center(robot.home, 'east/Q', 0.3)
grip = core.Grip.at_module(robot, 'east/Q', core.ConvexObject.disc(center, 0.3))
command = core.solve_twist(robot.home, grip, [0.0, 0.01, 0.0])
assert command.status is core.Status.OK, command
print(*sorted({name.split('.')[0] for name, module in sys.modules.items() if module}))
"""

#: A third of the time of an import of the core without them.
LATE = ('scipy.optimize', 'scipy.interpolate', 'scipy.special')
LOADING = """
import sys

from isotruss_ros import core

print(*sys.modules)
robot = core.load_robot('nine_member')
core.TwistServo(robot, 'east/Q', 0.3, period=0.005, timeout=0.1)
print(*sys.modules)
"""


def run(script):
    """Return what a script prints in a process of its own, in words by line."""
    done = subprocess.run(
        [sys.executable, '-c', script], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return [line.split() for line in done.stdout.splitlines()]


def test_there_are_few_names_at_the_top():
    assert len(core.__all__) <= 35


def test_core_works_without_ros():
    (loaded,) = run(SCRIPT)
    assert 'isotruss_ros' in loaded
    assert not [name for name in loaded if name.endswith('_msgs') or name.startswith('rcl')]


def test_a_control_loop_has_its_solver_before_it_begins():
    imported, ready = run(LOADING)
    assert not set(LATE) & set(imported)
    assert 'scipy.optimize' in ready
