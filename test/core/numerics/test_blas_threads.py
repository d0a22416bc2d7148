# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Solves of this package have one BLAS thread; NumPy of the user keeps its own."""

import os
import subprocess
import sys
import threading

from isotruss_ros.core.numerics import blas_threads
from isotruss_ros.core.numerics.blas_threads import Library, OneThread
import pytest

#: Counts the threads wherever public calls factor and solve.
SCRIPT = """
import sys
from isotruss_ros import core
from isotruss_ros.core.numerics import blas_threads

libraries = blas_threads.find_libraries()
before = [library.count() for library in libraries]
inside = set()

def watch(frame, event, _):
    name = frame.f_code.co_filename
    if event == 'call' and name.endswith(('factorization.py', 'frame.py', 'friction_closure.py')):
        inside.update(library.count() for library in libraries)

robot = core.load_robot('nine_member')
body = core.ConvexObject(core.Disc(0.3), (*core.tangent_center(robot.home, 'north/Z', 0.3), 0.0))
for call in (
    lambda: robot.configuration([0.1] * 6),
    lambda: core.deform(robot.home, joint_loads={'Z': (1.0, 0.0)}),
    lambda: core.analyze_grasp(robot.home, body),
    lambda: core.settle_grasp(robot.home, body),
):
    sys.setprofile(watch)
    try:
        call()
    except core.IsotrussError:
        pass
    sys.setprofile(None)
print(sorted(inside), before == [library.count() for library in libraries], max(before))
"""


@pytest.mark.skipif(not blas_threads.find_libraries(), reason='BLAS is not OpenBLAS')
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason='OpenBLAS has one thread on one core')
def test_solves_have_one_thread_and_the_user_keeps_all():
    names = ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS')
    environment = {name: value for name, value in os.environ.items() if name not in names}
    told = subprocess.run(
        [sys.executable, '-c', SCRIPT],
        env={**environment, 'OPENBLAS_NUM_THREADS': '2'},
        capture_output=True,
        text=True,
        check=True,
    )
    assert told.stdout == '[1] True 2\n'


class Threads:
    """A library that knows how many threads it has."""

    def __init__(self, count):
        self.now, self.set = count, []

    def library(self):
        return Library(lambda: self.now, self.change)

    def change(self, count):
        self.now = count
        self.set.append(count)


def test_solves_that_overlap_set_the_threads_back_at_the_end_of_the_last():
    """The first ends before the second."""
    threads = Threads(8)
    one = OneThread(lambda: (threads.library(),))
    first, second = threading.Event(), threading.Event()

    def solve():
        with one:
            first.set()
            second.wait()

    other = threading.Thread(target=solve)
    other.start()
    first.wait()
    with one:
        second.set()
        other.join()
        assert threads.now == 1
    assert threads.set == [1, 8]
