# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Write a robot file, load it, and print the error of a mistake."""

from pathlib import Path
import tempfile

from isotruss_ros import core
from isotruss_ros.core.errors import RobotFileError

ROBOT = """
name: tall_triangle
joints: {L: [0.0, 0.0], R: [1.0, 0.0], T: [0.5, 1.4]}
tubes:
  main: {joints: [L, R, T], passive: L}
module:
  pinch_separation: 0.12
  rod_length: 0.15
  guide_ring_distance: 0.08
  axial_rigidity: 5.0e+6
  flexural_rigidity: 2.0e+3
tube: {diameter: 0.08, pressure: 40000.0, stiffness: {model: inflatable_beam}}
supports: {L: [x, y], R: [y]}
rollers: {max_speed: 0.10}
members: {min_length: 0.25, max_length: 2.5}
"""
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / 'tall_triangle.yaml'
    path.write_text(ROBOT)
    robot = core.load_robot(path)
    print(robot.name, robot.roller_names, robot.home.member_lengths.round(3))

    path.write_text(ROBOT.replace('rod_length: 0.15', 'rod_length: -0.15'))
    try:
        core.load_robot(path)
    except RobotFileError as error:
        print('refused:', error)
