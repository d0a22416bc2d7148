"""The ROS nodes: messages in, messages out; the mathematics is in `isotruss_ros.core`."""

import os

# Before NumPy is loaded: our matrices are small. With threads, BLAS workers that spin between the
# cycles took 8.6 s of kernel time in a run of 12 s at 200 Hz; without them 0.13 s.
for _variable in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ.setdefault(_variable, '1')
