# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What the tests of the search for grasps share: random objects inside loops, and oracles.

The oracles know nothing of the code under test: distances from ends and heights, the rigidity from
a decomposition of the whole matrix, pairs of parts by their names.
"""

import functools
import itertools

from isotruss_ros.core import ConvexObject, load_robot
from isotruss_ros.core.manipulation.limits import MemberLengthLimit, RollerSpeedLimit
from isotruss_ros.core.planning.closing import Closing
import numpy as np
import robots


def parts(config):
    """Return where members begin and end and the middles of modules, (m,) each [m]."""
    robot = config.robot
    place = dict(zip(robot.node_names, config.points, strict=True))
    begin, end = np.transpose([robots.member_ends(config, name) for name in robot.member_names])
    middle = [0.5 * (place[f'{name}/B'] + place[f'{name}/C']) for name in robot.module_names]
    return begin, end, np.array(middle)


def disc(robot):
    """Return the radius of a module's disc [m]."""
    file = robot.description
    return 0.5 * (file.module.pinch_separation + file.tube_diameter)


def to_point(config, point):
    """Return the distances of a point from all sides (m,) and all middles of modules (m,) [m]."""
    begin, end, middle = parts(config)
    return to_segments(point, begin, end), np.abs(middle - point)


def to_segments(point, begin, end):
    """Return the distances of a point from straight segments (m,), by their ends and heights."""
    along, arm = end - begin, point - begin
    beside = (along.conj() * arm).real
    height = np.abs((along.conj() * arm).imag) / np.abs(along)
    ends = np.minimum(np.abs(arm), np.abs(point - end))
    return np.where((beside > 0.0) & (beside < np.abs(along) ** 2), height, ends)


def gaps(config, body):
    """Return the distances of an object from members, modules, rods, (m,) each [m]."""
    center, radius = body.center, body.arm
    members, modules = to_point(config, center)
    return (
        members - radius - 0.5 * config.robot.description.tube_diameter,
        modules - radius - disc(config.robot),
        to_segments(center, _joints(config), parts(config)[2]) - radius,
    )


def rigidity(config):
    """Return the least singular value of the scaled matrix of (12), against home."""
    return least_singular_value(config) / _least_at_home(config.robot)


def scaled_matrix(config):
    """Return the matrix of (12), its rows of angles times the rod length."""
    m, matrix = config.robot.topology.n_modules, config.matrix.copy()
    matrix[slice(4 * m, 5 * m)] *= config.robot.description.module.rod_length
    return matrix


def least_singular_value(config):
    """Return the smallest singular value of that matrix."""
    return np.linalg.svd(scaled_matrix(config), compute_uv=False)[-1]


@functools.lru_cache(maxsize=64)
def _least_at_home(robot):
    return least_singular_value(robot.home)


def clearance(config):
    """Return the least distance of parts of the robot that must not meet [m]."""
    begin, end, middle = parts(config)
    robot = config.robot
    tube, found = 0.5 * robot.description.tube_diameter, [np.inf]
    joints = _joints(config)
    owners = [name.split('/')[1] for name in robot.module_names]
    for i, module in enumerate(robot.module_names):
        own, joint = module.split('/')
        for j, member in enumerate(robot.member_names):
            other, ends = member.split('/')
            if own != other or joint not in ends.split('-'):
                found.append(to_segments(middle[i], begin[j], end[j]) - disc(robot) - tube)
            if joint not in ends.split('-'):
                found.append(to_segments(joints[i], begin[j], end[j]) - tube)
        found += [abs(middle[i] - middle[j]) - 2.0 * disc(robot) for j in range(i)]
        for j, owner in enumerate(owners):
            if owner != joint:
                found.append(to_segments(middle[i], joints[j], middle[j]) - disc(robot))
                found.append(to_segments(joints[i], joints[j], middle[j]))
    return min(found)


def _joints(config):
    """Return the joint of each module (m,) [m]."""
    place = dict(zip(config.robot.node_names, config.points, strict=True))
    return np.array([place[name.split('/')[1]] for name in config.robot.module_names])


def drive(robot, path, parts=30):
    """Let a simulated robot follow a path."""
    for begin, end in itertools.pairwise(path):
        robot.command((end - begin) / parts)
        for _ in range(parts):
            robot.advance(1.0)


def between(path, pieces=4):
    """Return configurations on a way, with those between its rows, and the row before each."""
    for row, (one, other) in enumerate(itertools.pairwise(path)):
        config = one
        for share in np.arange(pieces) / pieces:
            goal = one.roller_positions + share * (other.roller_positions - one.roller_positions)
            config = config.moved_to(goal)
            yield row, config
    yield len(path) - 1, path[-1]


@functools.lru_cache(maxsize=64)
def scene(seed):
    """
    Return a state of a random robot, an object that lies free in one of its loops, and the tube.

    :return: configuration, a disc, number of the tube.
    """
    rng = np.random.default_rng([7, seed])
    kinds = ('nine_member', 'triangle', 'arch', 'ring', 'polygon')
    kind = kinds[seed % len(kinds)]
    robot = (
        load_robot(kind)
        if kind in robots.PRESETS
        else robots.random_robot(seed, kind, 3 if kind == 'ring' else None)
    )
    config = robots.random_state(robot, rng)
    begin, end, _ = parts(config)
    while True:
        tube = int(rng.integers(len(robot.description.tubes)))
        members = np.flatnonzero(robot.topology.tube == tube)
        corners = np.concatenate([begin[members], end[members]])
        center = rng.dirichlet(np.full(len(corners), 2.0)) @ corners
        room = min(map(np.min, gaps(config, ConvexObject.disc((center.real, center.imag), 2e-9))))
        if room > 0.05:
            diameter = 2.0 * room * rng.uniform(0.4, 0.9)
            return config, ConvexObject.disc((center.real, center.imag), diameter), tube


def closing(config, body, tube, rng, **fields):
    """Return what is to close: the sides at a module of a tube, sometimes a third one."""
    topology, file = config.robot.topology, config.robot.description
    members = np.flatnonzero(topology.tube == tube)
    module = int(rng.choice(members))
    sides = (module, int(topology.previous[module]))
    if rng.random() < 0.3:
        sides = (*sides, int(rng.choice([i for i in members if i not in sides])))
    limits = (
        MemberLengthLimit(file.min_length, file.max_length, 0.5),
        RollerSpeedLimit(rng.uniform(0.01, 0.1)),
    )
    given = {'limits': limits, 'min_rigidity': 0.15} | fields
    return Closing(body, sides, **given)
