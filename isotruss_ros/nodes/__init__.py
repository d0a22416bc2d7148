# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The ROS nodes: messages in, messages out; the mathematics is in `isotruss_ros.core`."""

import os

# Before NumPy is loaded: our matrices are small. With threads, BLAS workers that spin between the
# cycles took 8.6 s of kernel time in a run of 12 s at 200 Hz; without them 0.13 s.
for _variable in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ.setdefault(_variable, '1')

#: In the words of a terminal, since that is where it is read.
NO_MESSAGES = (
    'isotruss_msgs, the interface package of isotruss_ros, is not built. It is the folder\n'
    'msg_defs of isotruss_ros, where colcon does not look by itself. In the workspace:\n'
    '  ln -s isotruss_ros/msg_defs src/isotruss_msgs\n'
    '  colcon build && source install/setup.bash'
)
