# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The lock of each ROS domain, between processes."""

import contextlib
import os
import subprocess
import sys

from isotruss_ros.demo import domains

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


def test_a_domain_locked_by_another_process_is_skipped_until_the_process_is_killed(monkeypatch):
    # The locks of the runs on this machine are left alone.
    name = f'isotruss_ros_test_{os.getpid()}_{{}}'
    monkeypatch.setattr(domains, 'LOCK_NAME', '\0' + name)
    command = [sys.executable, '-c', HOLD, '40', '@' + name]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert int(process.stdout.readline()) == 40
        with contextlib.closing(domains.lock_domain(40)) as own:
            assert own.number == 41
        process.kill()
        process.wait()
        with contextlib.closing(domains.lock_domain(40)) as own:
            assert own.number == 40
