"""
What the tests of the search for grasps share: random objects inside loops, and oracles.

The oracles know nothing of the code under test: distances from many points, the rigidity from a
decomposition of the whole matrix, pairs of parts by their names.
"""

import functools
import itertools

from isotruss_ros.core import Cylinder, load_robot
from isotruss_ros.core.closing import Closing
from isotruss_ros.core.limits import MemberLengthLimit, RollerSpeedLimit
import numpy as np
import robots

#: Points on each side that stand for it.
SHARES = np.linspace(0.0, 1.0, 401)[:, None]


def parts(config):
    """Return where members begin and end and the middles of modules, (m,) each [m]."""
    place = dict(zip(config.robot.node_names, config.points, strict=True))
    begin, end, middle = [], [], []
    for tube in config.robot.description.tubes:
        for joint, following in zip(tube.joints, (*tube.joints[1:], tube.joints[0]), strict=True):
            b, c = place[f'{tube.name}/{joint}/B'], place[f'{tube.name}/{joint}/C']
            begin.append(b)
            end.append(place[f'{tube.name}/{following}/C'])
            middle.append(0.5 * (b + c))
    return np.array(begin), np.array(end), np.array(middle)


def disc(robot):
    """Return the radius of a module's disc [m]."""
    file = robot.description
    return max(0.5 * (file.module.pinch_separation + file.tube_diameter), file.module.rod_length)


def to_point(config, point):
    """Return the distances of a point from all sides (m,) and all middles of modules (m,) [m]."""
    begin, end, middle = parts(config)
    away = np.abs(begin + SHARES * (end - begin) - point).min(axis=0)
    return away, np.abs(middle - point)


def gaps(config, cylinder):
    """Return the distances of an object from members (m,) and modules (m,), by many points [m]."""
    members, modules = to_point(config, complex(*cylinder.center))
    radius = 0.5 * cylinder.diameter
    return (
        members - radius - 0.5 * config.robot.description.tube_diameter,
        modules - radius - disc(config.robot),
    )


def openings(config):
    """Return the angles between the two sides at each module, (m,) [rad]."""
    begin, end, _ = parts(config)
    back, first = {}, 0
    for tube in config.robot.description.tubes:
        count = len(tube.joints)
        for i in range(count):
            back[first + i] = first + (i - 1) % count
        first += count
    ahead = end - begin
    behind = np.array([begin[back[i]] - end[back[i]] for i in range(first)])
    cosine = (ahead.conj() * behind).real / np.abs(ahead) / np.abs(behind)
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def rigidity(config):
    """Return the least singular value of the scaled matrix of (12), against home."""
    return singular_values(config)[-1] / _least_at_home(config.robot)


def singular_values(config):
    """Return the singular values of the matrix of (12), its bisection rows times h."""
    m = config.robot.layout.n_modules
    bisection = slice(4 * m, 5 * m)
    matrix = config.matrix.copy()
    matrix[bisection] *= config.robot.description.module.rod_length
    return np.linalg.svd(matrix, compute_uv=False)


@functools.lru_cache(maxsize=64)
def _least_at_home(robot):
    return singular_values(robot.home)[-1]


def clearance(config):
    """Return the least distance of parts of the robot that must not meet, by many points [m]."""
    home = _apart_at_home(config.robot)
    return min((far for pair, far in _apart(config).items() if home[pair] > 0.0), default=np.inf)


@functools.lru_cache(maxsize=64)
def _apart_at_home(robot):
    return _apart(robot.home)


def _apart(config):
    begin, end, middle = parts(config)
    robot = config.robot
    tube, found = 0.5 * robot.description.tube_diameter, {}
    sides = begin + SHARES * (end - begin)
    for i, module in enumerate(robot.module_names):
        joint = module.split('/')[1]
        away = np.abs(sides - middle[i]).min(axis=0)
        for j, member in enumerate(robot.member_names):
            if joint not in member.split('/')[1].split('-'):
                found[module, member] = away[j] - disc(robot) - tube
        for j, other in enumerate(robot.module_names[:i]):
            name, theirs = other.split('/')
            ends = f'{joint}-{theirs}', f'{theirs}-{joint}'
            neighbours = any(f'{name}/{one}' in robot.member_names for one in ends)
            if joint != theirs and not (name == module.split('/')[0] and neighbours):
                found[module, other] = abs(middle[i] - middle[j]) - 2.0 * disc(robot)
    return found


def tube_lengths(config):
    """Return the length of tube between pinch points, by tube [m]."""
    begin, end, _ = parts(config)
    count = [len(tube.joints) for tube in config.robot.description.tubes]
    return np.add.reduceat(np.abs(end - begin), np.cumsum([0, *count[:-1]]))


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

    :return: configuration, cylinder, number of the tube.
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
        members = np.flatnonzero(robot.layout.tube == tube)
        corners = np.concatenate([begin[members], end[members]])
        center = rng.dirichlet(np.full(len(corners), 2.0)) @ corners
        room = min(
            (to_point(config, center)[0] - 0.5 * robot.description.tube_diameter).min(),
            (to_point(config, center)[1] - disc(robot)).min(),
        )
        if room > 0.05:
            diameter = 2.0 * room * rng.uniform(0.4, 0.9)
            return config, Cylinder((center.real, center.imag), diameter), tube


def closing(config, cylinder, tube, rng, **fields):
    """Return what is to close: the sides at a module of a tube, sometimes a third one."""
    layout, file = config.robot.layout, config.robot.description
    members = np.flatnonzero(layout.tube == tube)
    module = int(rng.choice(members))
    sides = (module, int(layout.previous[module]))
    if rng.random() < 0.3:
        sides = (*sides, int(rng.choice([i for i in members if i not in sides])))
    limits = (
        MemberLengthLimit(file.min_length, file.max_length, 0.5),
        RollerSpeedLimit(rng.uniform(0.01, 0.1)),
    )
    given = {'opening': rng.uniform(0.3, 1.2), 'limits': limits, 'min_rigidity': 0.15} | fields
    return Closing(cylinder, module, sides, **given)
