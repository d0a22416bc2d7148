# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random objects inside loops, and distances from ends and heights alone as oracles."""

import itertools

import numpy as np
import robots


def parts(config):
    """Return where members begin and end and the middles of modules, (m,) each [m]."""
    robot = config.robot
    place = dict(zip(robot.node_names, config.points, strict=True))
    begin, end = np.transpose([robots.member_ends(config, name) for name in robot.member_names])
    middle = [0.5 * (place[f'{name}/B'] + place[f'{name}/C']) for name in robot.module_names]
    return begin, end, np.array(middle)


def to_segments(point, begin, end):
    """Return the distances of a point from straight segments (m,), by their ends and heights."""
    along, arm = end - begin, point - begin
    beside = (along.conj() * arm).real
    height = np.abs((along.conj() * arm).imag) / np.abs(along)
    ends = np.minimum(np.abs(arm), np.abs(point - end))
    return np.where((beside > 0.0) & (beside < np.abs(along) ** 2), height, ends)


def gaps(config, body):
    """Return the distances of an object from members, modules, rods, (m,) each [m]."""
    robot, file = config.robot, config.robot.description
    place = dict(zip(robot.node_names, config.points, strict=True))
    joints = np.array([place[name.split('/')[1]] for name in robot.module_names])
    begin, end, middle = parts(config)
    rods, disc = to_segments(body.center, joints, middle), 0.5 * file.module.pinch_separation
    tube = 0.5 * file.tube_diameter
    return (
        to_segments(body.center, begin, end) - body.arm - tube,
        np.abs(middle - body.center) - body.arm - disc - tube,
        rods - body.arm,
    )


def drive(robot, path, parts=30):
    """Let a simulated robot follow a path."""
    for begin, end in itertools.pairwise(path):
        robot.command((end - begin) / parts)
        for _ in range(parts):
            robot.advance(1.0)
