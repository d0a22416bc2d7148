# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The robot at home: names, orders, joints where the file puts them, modules that bisect."""

from hypothesis import given, strategies
from isotruss_ros.core.errors import RobotFileError
import numpy as np
import pytest
import robots

SEEDS = strategies.integers(0, 2**32 - 1)


def modules_of(document):
    """Return (tube, joint, next joint, previous joint, driven) in the order of the file."""
    return [
        (tube, joint, after, before, joint != block['passive'])
        for tube, block in document['tubes'].items()
        for before, joint, after in zip(
            np.roll(block['joints'], 1),
            block['joints'],
            np.roll(block['joints'], -1),
            strict=True,
        )
    ]


def nodes_by_name(config):
    points = config.nodes @ np.array([1.0, 1.0j])
    return dict(zip(config.robot.node_names, points, strict=True))


def signed_angle(a, b):
    """Return the angle from a to b."""
    return np.angle(b * np.conj(a))


def check_names(robot, document):
    modules = modules_of(document)
    names = [f'{tube}/{joint}' for tube, joint, *_ in modules]
    assert robot.module_names == tuple(names)
    pinch = [f'{name}/{node}' for name in names for node in 'BC']
    assert robot.node_names == (*document['joints'], *pinch)
    assert robot.member_names == tuple(f'{t}/{j}-{after}' for t, j, after, _, _ in modules)
    assert robot.roller_names == tuple(f'{t}/{j}' for t, j, _, _, driven in modules if driven)
    assert robot.home.nodes.shape == (len(robot.node_names), 2)
    assert robot.home.member_lengths.shape == (len(robot.member_names),)
    assert robot.home.roller_positions.tolist() == [0.0] * len(robot.roller_names)


@robots.examples(60)
@given(SEEDS, strategies.sampled_from(robots.KINDS))
def test_home_fulfils_the_constraints_of_the_paper(seed, kind):
    document = robots.random_document(seed, kind)
    robot = robots.load(document)
    check_names(robot, document)
    place = nodes_by_name(robot.home)
    s, h = document['module']['pinch_separation'], document['module']['rod_length']
    for joint, (x, y) in document['joints'].items():
        assert place[joint] == complex(x, y)  # to the last bit
    for (tube, joint, after, before, _), length in zip(
        modules_of(document), robot.home.member_lengths, strict=True
    ):
        a, b, c = place[joint], place[f'{tube}/{joint}/B'], place[f'{tube}/{joint}/C']
        ahead = place[f'{tube}/{after}/C'] - b
        back = place[f'{tube}/{before}/B'] - c
        rod = 0.5 * (b + c) - a
        # The module: |BC| = s, the rod of length h goes to the middle of BC at a right angle.
        assert abs(abs(b - c) - s) < 1e-12
        assert abs(abs(rod) - h) < 1e-12
        assert abs((rod.conjugate() * (b - c)).real) < 1e-12
        # (3): the rod bisects the two sides, which open at a sharp angle from it.
        assert abs(signed_angle(rod, ahead) + signed_angle(rod, back)) < 1e-12
        assert (np.conj(rod) * ahead).real > 0.0
        # B faces the next joint, C the previous one; the rod points into the triangle.
        to_next, to_previous = place[after] - a, place[before] - a
        to_next, to_previous = to_next / abs(to_next), to_previous / abs(to_previous)
        assert (np.conj(b - c) * (to_next - to_previous)).real > 0.0
        assert (np.conj(rod) * (to_next + to_previous)).real > 0.0
        assert abs(abs(ahead) - length) < 1e-12
    assert np.abs(robot.constraints.residual(robot.home.points, robot.home_lengths)).max() < 1e-12


def pinched(opening, module):
    """Return an isosceles triangle with this angle [deg] at its top, and this module."""
    document = robots.example()
    half = np.deg2rad(0.5 * opening)
    document['joints'] = {
        'P': [-np.sin(half), 0.0],
        'Q': [np.sin(half), 0.0],
        'X': [0.0, np.cos(half)],
    }
    document['module'].update(module, guide_ring_distance=0.001)
    document['members'] = {'min_length': 1e-3, 'max_length': 10.0}
    return document


@pytest.mark.parametrize(
    ('opening', 'size', 'message'),
    [
        # The rod at the blunt top is longer than the triangle is high: its end comes out below.
        (150.0, {'pinch_separation': 0.1, 'rod_length': 0.25}, 'leave it at -.* must be more'),
        # The modules at the short base are wider than it.
        (10.0, {'pinch_separation': 0.1, 'rod_length': 0.1}, 'no angle of its rod bisects'),
        (0.95, {'pinch_separation': 1e-5, 'rod_length': 1e-3}, '0.95 degrees; must be between 1'),
    ],
)
def test_module_that_does_not_fit_its_corner_is_refused(opening, size, message):
    with pytest.raises(RobotFileError, match=f'does not fit its corner: .*{message}'):
        robots.load(pinched(opening, size))
