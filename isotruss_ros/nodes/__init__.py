"""The ROS nodes: messages in, messages out; the mathematics is in `isotruss_ros.core`."""

import importlib.util
import os
import sys

# Before NumPy is loaded: our matrices are small. With threads, BLAS workers that spin between the
# cycles took 8.6 s of kernel time in a run of 12 s at 200 Hz; without them 0.13 s.
for _variable in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ.setdefault(_variable, '1')

if importlib.util.find_spec('isotruss_msgs') is None:
    sys.exit(
        'isotruss_msgs, the interface package of isotruss_ros, is not built. It is the folder\n'
        'msg_defs of isotruss_ros, where colcon does not look by itself. In the workspace:\n'
        '  ln -s isotruss_ros/msg_defs src/isotruss_msgs\n'
        '  colcon build && source install/setup.bash'
    )
