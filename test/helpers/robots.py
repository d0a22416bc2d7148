# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random robots, which are feasible by a plain pin-jointed truss, and states from seeds."""

import atexit
import contextlib
from dataclasses import replace
import functools
import itertools
import json
import os
from pathlib import Path
import tempfile

from hypothesis import assume, HealthCheck, settings, strategies
from isotruss_ros.core import ConvexObject, Grip, load_robot, Robot
from isotruss_ros.core.errors import ConfigurationError, RobotFileError
from isotruss_ros.core.model.presets import find_robot_file
from isotruss_ros.core.model.robot_file import describe_robot
import numpy as np
import pytest
from ruamel.yaml import YAML

PRESETS = ('nine_member', 'triangle')
KINDS = ('arch', 'ring', 'polygon')
#: Returns the robot of a preset, which is read once.
preset = functools.cache(load_robot)
_folder = tempfile.TemporaryDirectory(prefix='isotruss_test_')
atexit.register(_folder.cleanup)


#: Share of the random examples that are run: `make test` is content with fewer.
SHARE = float(os.environ.get('EXAMPLES_SHARE', '1'))


def examples(count):
    """Run a property on the same `count` examples each time."""
    return settings(
        max_examples=max(1, round(SHARE * count)),
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )


def quick_robot():
    """Return the file of a nine-member robot with rollers twice as quick: motions end sooner."""
    file = Path(_folder.name) / 'quick.yaml'
    slow = find_robot_file('nine_member').read_text(encoding='utf-8')
    assert 'max_speed: 0.10' in slow
    file.write_text(slow.replace('max_speed: 0.10', 'max_speed: 0.20'), encoding='utf-8')
    return str(file)


def example():
    """Return the document of a small robot, for tests that break it."""
    return {
        'name': 'example',
        'joints': {'P': [0.0, 0.0], 'Q': [1.0, 0.0], 'X': [0.4, 0.9]},
        'tubes': {'south': {'joints': ['P', 'Q', 'X'], 'passive': 'X'}},
        'module': {
            'pinch_separation': 0.12,
            'rod_length': 0.1,
            'guide_ring_distance': 0.08,
            'axial_rigidity': 5.0e6,
            'flexural_rigidity': 2.0e3,
        },
        'tube': {
            'diameter': 0.102,
            'pressure': 34500.0,
            'stiffness': {
                'model': 'section',
                'axial_rigidity': 1.9e4,
                'flexural_rigidity': 25.0,
                'shear_rigidity': 1.9e3,
            },
        },
        'supports': {'P': ['x', 'y'], 'Q': ['y']},
        'rollers': {'max_speed': 0.1},
        'members': {'min_length': 0.25, 'max_length': 3.0},
    }


def preset_document(name):
    path = find_robot_file(name)
    return YAML(typ='safe', pure=True).load(path.read_text(encoding='utf-8'))


def write(content):
    """Write a robot file of a document, a text or bytes, and return its path."""
    if isinstance(content, dict):
        content = json.dumps(content)  # JSON is YAML too
    with tempfile.NamedTemporaryFile(dir=_folder.name, suffix='.yaml', delete=False) as file:
        file.write(content if isinstance(content, bytes) else content.encode())
    return Path(file.name)


def load(content):
    """Return the robot of a file with a content, see `write`."""
    path = write(content)
    try:
        return load_robot(path)
    finally:
        path.unlink()


def refusal(content):
    """Return the message about a file that is no robot; each of its lines names the file."""
    path = write(content)
    with pytest.raises(RobotFileError) as caught:
        load_robot(path)
    path.unlink()
    lines = str(caught.value).splitlines()
    assert all(line.startswith(f'{path}: ') and line.count(str(path)) == 1 for line in lines)
    return str(caught.value)


def random_document(seed, kind=None, size=None):
    """Return the document of a feasible robot of a kind and size, without overlaps at home."""
    rng = np.random.default_rng(seed)
    kind = kind or str(rng.choice(KINDS))
    grow = {'arch': _arches, 'ring': _ring, 'polygon': _polygon}[kind]
    while True:
        joints, tubes = grow(rng, size)
        joints = joints * np.exp(1j * rng.uniform(0.0, 2.0 * np.pi))
        joints = joints * rng.uniform(1.4, 3.0) + complex(*rng.uniform(-5.0, 5.0, 2))
        supports = _supports(rng, joints, tubes) if _fits(joints, tubes) else None
        if supports is not None:
            return _document(rng, joints, tubes, supports)


def random_robot(seed, kind=None, size=None):
    """Return a robot that can work; its document is not read from a file, which takes longer."""
    document = json.loads(json.dumps(random_document(seed, kind, size)))
    return Robot(describe_robot(Path('random.yaml'), document))


def random_state(robot, rng, reach=0.05):
    """Return a configuration in which no member has changed by more than 2 reach of the least."""
    step = reach * robot.home.member_lengths.min()
    return robot.configuration(rng.uniform(-step, step, len(robot.roller_names)))


def with_round_tubes(config):
    """Return a configuration with tubes whose sections hardly flatten."""
    description = replace(config.robot.description, local_stiffness=1e6)
    return Robot(description).configuration(config.roller_positions)


def dense_matrix(config):
    """Return the matrix of (12) in a configuration as a dense array."""
    matrix = config.robot.constraints.matrix(config.points)
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


def far_state(robot, rng, reach):
    try:
        return random_state(robot, rng, reach)
    except ConfigurationError:
        assume(False)


def extreme_state(robot, rng, halvings=8):
    """Return a configuration near the end of a random way of the rollers."""
    size, reached = robot.home.member_lengths.min(), 0.0
    way = rng.uniform(-size, size, len(robot.roller_names))
    for share in 0.5 ** np.arange(1, halvings + 1):
        with contextlib.suppress(ConfigurationError):
            robot.configuration((reached + share) * way)
            reached += share
    return robot.configuration(reached * way)


def random_grasp(robot, rng, number):
    """Return a state, a grip of a disc at a module (by number), and the ends of both members."""
    config = random_state(robot, rng)
    module = robot.module_names[number % len(robot.module_names)]
    ends, tube = side_ends(config, module), robot.description.tube_diameter
    spans = ends[1] - ends[0], ends[3] - ends[2]
    axes = [span / abs(span) for span in spans]
    inward = sum(axes) / abs(sum(axes))
    corner = 0.5 * (ends[0] + ends[2])
    diameter = 0.0
    while diameter < 0.02:
        # On the bisector, touching so far along the shorter member.
        along = rng.uniform(0.3, 0.9) * min(map(abs, spans))
        depth = along - (axes[0].conjugate() * (corner - ends[0])).real
        center = corner + depth / (axes[0].conjugate() * inward).real * inward
        diameter = 2.0 * abs((axes[0].conjugate() * (center - ends[0])).imag) - tube
    center += 0.1 * tube * complex(*rng.uniform(-1.0, 1.0, 2))
    body = ConvexObject.disc((center.real, center.imag), diameter)
    return config, Grip.at_module(robot, module, body), ends


def member_ends(config, name):
    """Return B where a member starts and C where it ends, found by their names."""
    place = dict(zip(config.robot.node_names, config.points, strict=True))
    module, end = name.split('-')
    return place[f'{module}/B'], place[f'{module.split("/")[0]}/{end}/C']


def side_ends(config, module):
    """Return B, B', C and C' of a module, found by the names of its members."""
    tube, joint = module.split('/')
    names = [name for name in config.robot.member_names if name.startswith(f'{tube}/')]
    (ahead,) = (name for name in names if name.startswith(f'{module}-'))
    (back,) = (name for name in names if name.endswith(f'-{joint}'))
    return *member_ends(config, ahead), *reversed(member_ends(config, back))


def robots(kinds=KINDS):
    return strategies.builds(
        random_robot, strategies.integers(0, 2**32 - 1), strategies.sampled_from(kinds)
    )


def generators():
    return strategies.integers(0, 2**32 - 1).map(np.random.default_rng)


def apex(rng, a, b):
    """Return a point that makes a well-shaped triangle with a and b."""
    side = rng.choice([-1.0, 1.0])
    return a + (b - a) * complex(rng.uniform(0.3, 0.7), side * rng.uniform(0.6, 1.1))


def _arches(rng, size):
    """Grow a triangle by three-hinged arches: two more tubes that share a joint."""
    joints = [0j, 1.0 + 0j]
    joints.append(apex(rng, joints[0], joints[1]))
    tubes = [[0, 1, 2]]
    for _ in range(rng.integers(0, 4) if size is None else size):
        feet = rng.permutation(len(joints))[:2]
        a, b = (joints[i] for i in feet)
        hinge = apex(rng, a, b)
        # Keep members near 1 m however far the feet are apart.
        hinge = 0.5 * (a + b) + (hinge - 0.5 * (a + b)) / max(1.0, abs(b - a))
        n = len(joints)
        joints += [hinge, apex(rng, a, hinge), apex(rng, b, hinge)]
        tubes += [[int(feet[0]), n, n + 1], [int(feet[1]), n, n + 2]]
    return np.array(joints), tubes


def _ring(rng, size):
    """Close a ring of triangles; each shares one joint with the next."""
    n = int(rng.integers(3, 6)) if size is None else size
    angles = 2.0 * np.pi * (np.arange(n) + rng.uniform(-0.1, 0.1, n)) / n
    inner = np.exp(1j * angles) / (2.0 * np.sin(np.pi / n))
    outer = [apex(rng, inner[i], inner[(i + 1) % n]) for i in range(n)]
    return np.array([*inner, *outer]), [[i, (i + 1) % n, n + i] for i in range(n)]


def _polygon(rng, size):
    """Lay one tube through three or more joints."""
    n = int(rng.integers(3, 7)) if size is None else size
    angles = 2.0 * np.pi * (np.arange(n) + rng.uniform(-0.15, 0.15, n)) / n
    return np.exp(1j * angles) / (2.0 * np.sin(np.pi / n)), [list(range(n))]


def _bars(tubes):
    return [pair for tube in tubes for pair in itertools.pairwise([*tube, tube[0]])]


def truss_matrix(joints, tubes):
    """Return the rigidity matrix of straight bars from joint to joint."""
    matrix = np.zeros((sum(map(len, tubes)), len(joints), 2))
    for row, (a, b) in enumerate(_bars(tubes)):
        unit = (joints[b] - joints[a]) / abs(joints[b] - joints[a])
        matrix[row, b] = unit.real, unit.imag
        matrix[row, a] = -unit.real, -unit.imag
    return matrix.reshape(len(matrix), -1)


def _supports(rng, joints, tubes):
    """Return as many grounded coordinates as are needed to hold the truss well, or None."""
    bars = truss_matrix(joints, tubes)
    count = 2 * len(joints) - len(bars)
    for _ in range(50):
        grounded = rng.permutation(2 * len(joints))[:count]
        matrix = np.vstack([bars, np.eye(2 * len(joints))[grounded]])
        if np.linalg.svd(matrix, compute_uv=False)[-1] > min(0.2, 2.0 / len(joints)):
            return sorted(map(int, grounded))
    return None


def _fits(joints, tubes):
    """Tell whether sides are long enough, corners neither sharp nor flat, and nothing overlaps."""
    corners = []
    for tube in tubes:
        here = joints[tube]
        ahead, back = np.roll(here, -1) - here, np.roll(here, 1) - here
        opening = np.abs(np.angle(ahead * back.conj()))
        if np.abs(ahead).min() < 0.9 or opening.min() < 0.5 or opening.max() > 2.6:
            return False
        inward = ahead / np.abs(ahead) + back / np.abs(back)
        corners += zip(tube, inward, 0.5 * opening, strict=True)
    # Modules of other tubes at a joint point away from each other.
    for (one, rod, half), (other, rod_2, half_2) in itertools.combinations(corners, 2):
        if one == other and abs(np.angle(rod / rod_2)) < max(1.75, half + half_2 + 0.1):
            return False
    bars = _bars(tubes)
    for (a, b), (c, d) in itertools.combinations(bars, 2):
        if not {a, b} & {c, d} and _apart(*joints[[a, b, c, d]]) < 0.35:
            return False
    return True


def _apart(a, b, c, d):
    """Return the distance of two straight bars, 0 where they cross."""

    def left(p, q, r):
        return ((q - p).conjugate() * (r - p)).imag > 0.0

    def to_bar(p, q, r):
        share = min(max(((r - q).conjugate() * (p - q)).real / abs(r - q) ** 2, 0.0), 1.0)
        return abs(p - q - share * (r - q))

    if left(a, b, c) != left(a, b, d) and left(c, d, a) != left(c, d, b):
        return 0.0
    return min(to_bar(a, c, d), to_bar(b, c, d), to_bar(c, a, b), to_bar(d, a, b))


def _document(rng, joints, tubes, supports):
    order = rng.permutation(len(joints))
    names = [f'J{i}' for i in range(len(joints))]
    document = example()
    document['name'] = 'random'
    document['joints'] = {names[i]: [joints[i].real, joints[i].imag] for i in order}
    document['tubes'] = {}
    for number, tube in enumerate(tubes):
        visited = [names[i] for i in np.roll(tube, rng.integers(len(tube)))]
        visited = visited[:: rng.choice([-1, 1])]
        document['tubes'][f't{number}'] = {'joints': visited, 'passive': str(rng.choice(visited))}
    document['supports'] = {}
    for coordinate in supports:
        document['supports'].setdefault(names[coordinate // 2], []).append('xy'[coordinate % 2])
    document['module'].update(
        pinch_separation=rng.uniform(0.05, 0.12),
        rod_length=rng.uniform(0.18, 0.25),
        guide_ring_distance=0.05,
    )
    document['members'] = {'min_length': 0.15, 'max_length': 20.0}
    return document
