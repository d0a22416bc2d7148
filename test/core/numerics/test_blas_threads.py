# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Solves of this package have one BLAS thread; NumPy of the user keeps its own."""

import os
import subprocess
import sys

from isotruss_ros.core.numerics import blas_threads
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
