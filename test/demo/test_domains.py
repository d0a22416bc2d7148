# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The lock of each ROS domain, between processes."""

import contextlib
import os
import subprocess
import sys

from isotruss_ros.demo import domains
import pytest

HOLD = """
import sys
from isotruss_ros.demo import domains
domains.LOCK_NAME = sys.argv[2].replace('@', chr(0))
lock = domains.lock_domain(int(sys.argv[1]))
print(lock.number, flush=True)
sys.stdin.read()
"""


def test_the_domain_of_this_run_is_locked():
    own = int(os.environ['ROS_DOMAIN_ID'])
    with contextlib.closing(domains.lock_domain(own)) as other:
        assert other.number != own


@pytest.fixture
def own_locks(monkeypatch):
    """Leave the locks of the runs on this machine alone."""
    monkeypatch.setattr(domains, 'LOCK_NAME', f'\0isotruss_ros_test_{os.getpid()}_{{}}')


@contextlib.contextmanager
def other_run(first):
    """Run a process that locks a domain; yield it and the number."""
    name = domains.LOCK_NAME.replace('\0', '@')
    process = subprocess.Popen(
        [sys.executable, '-c', HOLD, str(first), name],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process, int(process.stdout.readline())
    finally:
        process.kill()
        process.communicate()


@pytest.mark.usefixtures('own_locks')
def test_a_domain_locked_by_another_process_is_skipped():
    with other_run(40) as (_, taken), contextlib.closing(domains.lock_domain(40)) as own:
        assert (taken, own.number) == (40, 41)


@pytest.mark.usefixtures('own_locks')
def test_a_domain_is_free_again_after_its_process_was_killed():
    with other_run(40) as (process, taken):
        process.kill()
        process.wait()
        with contextlib.closing(domains.lock_domain(40)) as own:
            assert own.number == taken
