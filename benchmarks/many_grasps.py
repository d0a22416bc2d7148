# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Analyses of grasps per second in one process: `analyze_grasps` against a loop of `analyze_grasp`.

Grasps are those of `statics.py` in the paper's model, each in a configuration of its own: an
object in the corner at the top module of the nine-member preset, pressed in by 2 to 20 mm; and the
same objects up to 50 mm away from there along both axes, where many touch one tube or none.

    python benchmarks/many_grasps.py
"""

from __future__ import annotations

import cProfile
import os
import pstats

os.environ.update(OPENBLAS_NUM_THREADS='1', OMP_NUM_THREADS='1')  # before NumPy comes in

from isotruss_ros import core
from measuring import print_machine, print_table, timed
import numpy as np
from statics import DEPTHS, DIAMETER, MODULE, pressed

COUNT, ROUNDS, LINES = 512, 5, 12
ROOM = 0.05


def main() -> None:
    """Print the table, and where the time goes."""
    print_machine()
    robot, random = core.load_robot('nine_member'), np.random.default_rng(1)
    configs = [
        robot.configuration(random.uniform(-0.15, 0.15, len(robot.roller_names)))
        for _ in range(COUNT)
    ]
    nodes = np.stack([config.nodes for config in configs])
    corner = np.array([pressed(c, MODULE, random.uniform(*DEPTHS)).center for c in configs])
    rows = []
    for name, centers in (
        ('pressed into a corner', corner),
        ('near a corner', corner + random.uniform(-ROOM, ROOM, corner.shape)),
    ):
        single, together = [], []
        for _ in range(ROUNDS):
            # Alternating: what else the machine does meets both.
            single.append(timed(lambda: one_by_one(configs, centers))[0])  # noqa: B023
            together.append(timed(lambda: at_once(robot, nodes, centers))[0])  # noqa: B023
        alone, batch = min(single) / COUNT, min(together) / COUNT
        rows.append([name, f'{1 / alone:.0f}', f'{1 / batch:.0f}', f'{alone / batch:.1f}'])
    print(f'{COUNT} grasps, the best of {ROUNDS} rounds; analyses per second')
    print_table(['objects', 'one by one', 'at once', 'ratio'], rows)
    profile = cProfile.Profile()
    profile.runcall(at_once, robot, nodes, corner)
    print('\nProfile of the batch, pressed into a corner')
    pstats.Stats(profile).sort_stats('tottime').print_stats(LINES)


def one_by_one(configs: list[core.Configuration], centers: np.ndarray) -> None:
    """Analyse grasps in configurations for which no frame is at hand."""
    for config, center in zip(configs, centers, strict=True):
        fresh = core.Configuration(config.robot, config.roller_positions, config.points)
        core.analyze_grasp(fresh, core.Cylinder(tuple(center), DIAMETER), flattening=False)


def at_once(robot: core.Robot, nodes: np.ndarray, centers: np.ndarray) -> None:
    """Analyse the same grasps together."""
    core.analyze_grasps(robot, nodes, centers, DIAMETER)


if __name__ == '__main__':
    main()
