"""Tests keep to this machine, and away from whatever else runs on it."""

import os

# Before rclpy is loaded; a caller that has set a domain of its own keeps it.
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 101))
# Before NumPy is loaded: BLAS threads that wait for each other make a busy machine crawl.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
