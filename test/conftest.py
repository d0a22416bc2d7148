"""Tests keep to this machine, and away from whatever else runs on it."""

import os

# Before rclpy is loaded; a domain that is set is kept. Tests that run side by side have their own.
_domain = int(os.environ.get('ROS_DOMAIN_ID', os.getpid()))
_worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
os.environ['ROS_DOMAIN_ID'] = str(1 + (_domain - 1 + 17 * _worker) % 101)
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
# Before NumPy is loaded: BLAS threads that wait for each other make a busy machine crawl.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
