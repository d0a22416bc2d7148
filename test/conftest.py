# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tests keep to this machine, and away from each other and whatever else runs on it."""

import itertools
import os

from hypothesis import settings
import pytest

# Before rclpy is loaded; a domain that is set is where the counting begins.
_FIRST = int(os.environ.get('ROS_DOMAIN_ID', os.getpid()))
_WORKER = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
_WORKERS = int(os.environ.get('PYTEST_XDIST_WORKER_COUNT', '1'))
#: Each worker has a share of its own of the 101 domains whose ports are free on Linux.
_SHARE = max(1, 101 // _WORKERS)
_domains = (
    1 + (_FIRST - 1 + _WORKER * _SHARE + turn % _SHARE) % 101 for turn in itertools.count()
)
os.environ['ROS_DOMAIN_ID'] = str(next(_domains))
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
# Before NumPy is loaded: BLAS threads that wait for each other make a busy machine crawl.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
# However busy the machine is, and the same random examples each time.
settings.register_profile('any load', deadline=None, derandomize=True)
settings.load_profile('any load')


@pytest.fixture(autouse=True)
def own_domain(request, monkeypatch):
    """Give tests of processes a domain each: one that was killed leaves its traces in its own."""
    if request.node.get_closest_marker('system') and 'shared_domain' not in request.fixturenames:
        monkeypatch.setenv('ROS_DOMAIN_ID', str(next(_domains)))


@pytest.fixture(scope='module')
def shared_domain():
    """Give the tests of a file that share their processes one domain."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('ROS_DOMAIN_ID', str(next(_domains)))
        yield
