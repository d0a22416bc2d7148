# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tests keep to this machine, away from each other and whatever else runs, in any order."""

import contextlib
import itertools
import os
import random

from hypothesis import settings
import pytest

# Before NumPy is loaded: BLAS threads that wait for each other make a busy machine crawl.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
from isotruss_ros.demo.domains import DOMAINS, lock_domain  # noqa: E402,I100

# A domain that is set is where the counting begins; each worker begins elsewhere, so that the
# traces of a killed process are left alone for long.
_WORKER = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
_WORKERS = int(os.environ.get('PYTEST_XDIST_WORKER_COUNT', '1'))
_FIRST = int(os.environ.get('ROS_DOMAIN_ID', os.getpid()))
_turns = itertools.count(_FIRST + _WORKER * (len(DOMAINS) // _WORKERS))
#: Of this process, before rclpy is loaded; locked until it ends.
_OWN = lock_domain(next(_turns))
os.environ['ROS_DOMAIN_ID'] = str(_OWN.number)
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
# However busy the machine is, and the same random examples each time.
settings.register_profile('any load', deadline=None, derandomize=True)
settings.load_profile('any load')
# The failed checks of a shape or barrier of one's own show their values.
pytest.register_assert_rewrite('contracts')


def pytest_collection_modifyitems(items):
    """Begin with the longest file; shuffle files and their tests by the seed `SHUFFLE` if set."""
    items.sort(key=lambda item: item.path.stem != 'test_pick_and_place')
    if seed := os.environ.get('SHUFFLE'):
        draw = random.Random(seed).random
        files = {item.path: draw() for item in items}
        items.sort(key=lambda item: (files[item.path], draw()))


@contextlib.contextmanager
def _next_domain():
    """Set the next free domain for a block."""
    with contextlib.closing(lock_domain(next(_turns))) as lock, pytest.MonkeyPatch.context() as p:
        p.setenv('ROS_DOMAIN_ID', str(lock.number))
        yield


@pytest.fixture(autouse=True)
def own_domain(request):
    """Give tests of processes a domain each: one that was killed leaves its traces in its own."""
    marked = request.node.get_closest_marker('system')
    own = marked and 'shared_domain' not in request.fixturenames
    with _next_domain() if own else contextlib.nullcontext():
        yield


@pytest.fixture(scope='module')
def shared_domain():
    """Give the tests of a file that share their processes one domain."""
    with _next_domain():
        yield
