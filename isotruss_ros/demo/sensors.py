# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulated sensor faults of the demonstration, and a table of the errors that they cause."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_msgs.msg import StateEstimate
from isotruss_ros.core import Robot
from isotruss_ros.demo.record import PhaseRecord
from isotruss_ros.demo.tables import make_table
import numpy as np
from rich.table import Table

#: Parameters of `simulator` for encoders and a tracker with markers on all joints.
REAL_SENSORS = {
    'seed': 3,
    'encoder_step': 2e-5,
    'tracker_rate': 20.0,
    'tracker_delay': 0.03,
    'tracker_dropouts': 0.3,
    'tracker_noise': 1e-3,
    # Markers on the grounded joints determine the frame of the tracker. Three markers on other
    # joints cannot tell its rotation by 2 degrees from roller offsets of 6 mm.
    'marker_joints': ['all'],
    # Encoders measure neither slip nor roller offsets.
    'roller_slip': 0.02,
    'zero_deviation': 0.01,
}


def truth_table(records: Sequence[PhaseRecord], robot: Robot, squeeze: float) -> Table:
    """
    Return a table of the errors of estimated squeeze, joints and pose.

    :param squeeze: desired squeeze [N].
    """
    table = make_table(
        'Error of the true squeeze relative to its target; errors of the\n'
        'estimated squeeze, of estimated joints and of joints by encoders\n'
        'alone; error of the true pose relative to the twists',
        ('phase',),
        (
            'squeeze, end\n%',
            'worst\n%',
            'estimated\n%',
            'joints\nmm',
            'by encoders\nmm',
            'pose\nmm',
            'pose\ndeg',
        ),
    )
    for record in records:
        off = 100.0 * (np.array(record.squeezes) / squeeze - 1.0)
        joints, estimate = record.joints[-1], record.estimates[-1]
        found = np.array([(place.x, place.y) for place in estimate.joints])
        encoders = np.array(estimate.travel) - estimate.offsets
        read = robot.configuration(encoders).nodes[: len(joints)]
        missed = 100.0 * (estimate.squeeze - record.squeezes[-1]) / squeeze
        table.add_row(
            record.name,
            f'{off[-1]:+.0f}',
            f'{off[np.abs(off).argmax()]:+.0f}',
            f'{missed:+.0f}' if estimate.held == StateEstimate.HELD_YES else 'none',
            f'{1e3 * np.hypot(*(joints - found).T).max():.1f}',
            f'{1e3 * np.hypot(*(joints - read).T).max():.1f}',
            f'{1e3 * record.position_error:.1f}',
            f'{np.rad2deg(record.angle_error):.2f}',
        )
    return table
