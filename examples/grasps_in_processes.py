# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settle many grasps in processes: select the best of 200 configurations for a disc."""

from concurrent.futures import ProcessPoolExecutor
from functools import partial
import multiprocessing

from isotruss_ros import core
import numpy as np

MEMBERS = ('north/P-Z', 'north/Z-R')

if __name__ == '__main__':
    home = core.load_robot('nine_member').home
    random = np.random.default_rng(1)
    shapes = [home.moved_to(travel) for travel in random.uniform(-0.06, 0.06, (200, 6))]
    bodies = [
        core.place_between(s, MEMBERS, core.Disc(0.3), indentation=0.01).body for s in shapes
    ]

    settle = partial(core.settle_grasp, friction=0.8, members=MEMBERS)
    # Spawned processes inherit no state of this process, on any operating system.
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context('spawn')) as processes:
        grasps = list(processes.map(settle, shapes, bodies, chunksize=20))

    margins = np.array([grasp.slip_margin if grasp.held else 0.0 for grasp in grasps])
    best = margins.argmax()
    print(f'{np.count_nonzero(margins)} of {len(grasps)} hold the disc')
    travel = shapes[best].roller_positions.round(3)
    print(f'the best by {margins[best]:.1f} N, with roller travel {travel} m')
