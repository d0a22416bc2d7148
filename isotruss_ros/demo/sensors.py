# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The demonstration with the faults of real sensors: which, and what they make of it."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_ros.core import Robot
from isotruss_ros.demo.record import PhaseRecord
from isotruss_ros.executables import NODES
import numpy as np
from rich.table import Table

PERFECT, REAL = 'perfect', 'real'
#: Encoders, and a tracker with markers on three joints, as parameters of `simulator`.
REAL_SENSORS = {
    'seed': 3,
    'encoder_step': 2e-5,
    'pose_rate': 20.0,
    'pose_delay': 0.03,
    'pose_dropouts': 0.3,
    'pose_noise': 1e-3,
    'angle_noise': float(np.radians(0.5)),
    'marker_rate': 20.0,
    'marker_delay': 0.03,
    'marker_dropouts': 0.3,
    'marker_noise': 1e-3,
    'marker_joints': ['P', 'R', 'Z'],
}
#: What encoders cannot tell: a loop that goes by them alone does not squeeze as it should.
UNSEEN = {'roller_slip': 0.02, 'zero_deviation': 0.01}
#: The node that estimates it from the markers.
ESTIMATOR = 'state_estimator'
HAS_ESTIMATOR = ESTIMATOR in NODES


def sensor_faults(kind: str) -> dict[str, object]:
    """
    Return the faults of the sensors that the loop bears, as parameters of `simulator`.

    :param kind: of `PERFECT` and `REAL`.
    """
    if kind == PERFECT:
        return {}
    return REAL_SENSORS | (UNSEEN if HAS_ESTIMATOR else {})


def truth_table(records: Sequence[PhaseRecord], robot: Robot, squeeze: float) -> Table:
    """
    Return how far squeeze, joints and pose are off what is true.

    :param records: of the phases, with the truth.
    :param robot: as its file has it.
    :param squeeze: that is regulated [N].
    """
    table = Table(
        title=(
            'True squeeze against its target; true joints, which tubes bend, against those\n'
            'that follow from the encoders; true object against the twists'
        ),
        box=None,
        pad_edge=False,
        collapse_padding=True,
    )
    table.add_column('phase', no_wrap=True)
    for heading in (
        'squeeze, end\n%',
        'squeeze, worst\n%',
        'joints\nmm',
        'pose\nmm',
        'pose\ndeg',
    ):
        table.add_column(heading, justify='right', no_wrap=True)
    for record in records:
        off = 100.0 * (np.array(record.squeezes) / squeeze - 1.0)
        joints = record.joints[-1]
        known = robot.configuration(record.snapshots[-1].rollers).nodes[: len(joints)]
        table.add_row(
            record.name,
            f'{off[-1]:+.0f}',
            f'{off[np.abs(off).argmax()]:+.0f}',
            f'{1e3 * np.hypot(*(joints - known).T).max():.1f}',
            f'{1e3 * record.position_error:.1f}',
            f'{np.rad2deg(record.angle_error):.2f}',
        )
    return table
