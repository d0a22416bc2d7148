# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settle many grasps in processes: select the best of 200 configurations for a disc."""

from isotruss_ros import core
from isotruss_ros.workers import WorkerPool
import numpy as np

MEMBERS = ('north/P-Z', 'north/Z-R')

if __name__ == '__main__':
    home = core.load_robot('nine_member').home
    random = np.random.default_rng(1)
    shapes = [home.moved_to(travel) for travel in random.uniform(-0.06, 0.06, (200, 6))]
    bodies = [
        core.place_between(s, MEMBERS, core.Disc(0.3), indentation=0.01).body for s in shapes
    ]

    with WorkerPool() as pool:
        grasps = core.settle_grasps(shapes, bodies, 0.8, members=MEMBERS, executor=pool.executor)

    margins = np.where(grasps.held, grasps.slip_margin, 0.0)
    best = margins.argmax()
    print(f'{np.count_nonzero(margins)} of {len(grasps)} hold the disc')
    travel = shapes[best].roller_positions.round(3)
    print(f'the best by {margins[best]:.1f} N, with roller travel {travel} m')
