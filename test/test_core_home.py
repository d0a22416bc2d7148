"""The robot at home: names, orders, joints where the file puts them, modules that bisect."""

from hypothesis import given, strategies
from isotruss_ros.core import load_robot, RobotFileError
from isotruss_ros.core.presets import config_directory
import numpy as np
import pytest
import robots
from ruamel.yaml import YAML

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


@robots.examples(25)
@given(SEEDS, strategies.sampled_from(robots.KINDS))
def test_names_and_orders_are_those_of_the_file(seed, kind):
    document = robots.random_document(seed, kind)
    check_names(robots.load(document), document)


@pytest.mark.parametrize('name', robots.PRESETS)
def test_presets_are_what_their_files_say(name):
    path = config_directory() / f'{name}.yaml'
    document = YAML(typ='safe', pure=True).load(path)
    check_names(load_robot(name), document)
    check_home(load_robot(name), document)


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
def test_home_is_what_the_file_and_the_paper_say(seed, kind):
    document = robots.random_document(seed, kind)
    check_home(robots.load(document), document)


def check_home(robot, document):
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
        # (3): the rod bisects the two sides.
        assert abs(signed_angle(rod, ahead) + signed_angle(rod, back)) < 1e-12
        # B faces the next joint, C the previous one; the corner is beyond BC, seen from A.
        to_next, to_previous = place[after] - a, place[before] - a
        assert (
            np.conj(b - c) * (to_next / abs(to_next) - to_previous / abs(to_previous))
        ).real > 0
        assert (np.conj(rod) * ahead).real < 0.0
        assert (np.conj(rod) * back).real < 0.0
        corner = crossing(b, ahead, c, back)
        assert (np.conj(rod) * (corner - 0.5 * (b + c))).real > 0.0
        assert abs(abs(ahead) - length) < 1e-12
    assert np.abs(robot.home.residual()).max() < 1e-12


def crossing(b, ahead, c, back):
    """Return where the lines from b along ahead and from c along back cross."""
    matrix = np.array([[ahead.real, -back.real], [ahead.imag, -back.imag]])
    t = np.linalg.solve(matrix, [(c - b).real, (c - b).imag])
    return b + t[0] * ahead


def test_home_of_the_equilateral_triangle_is_symmetric():
    robot = load_robot('triangle')
    # Modules are symmetric about the bisectors; the sides run parallel to the joints' sides.
    s, h = 0.12, 0.10
    outward = np.deg2rad(30.0)
    length = 1.02 + 2.0 * (h * np.cos(outward) - 0.5 * s * np.sin(outward))
    assert robot.home.member_lengths == pytest.approx([length] * 3, abs=1e-14)
    place = nodes_by_name(robot.home)
    rod = np.exp(1j * np.deg2rad(90.0))
    assert 0.5 * (place['main/T/B'] + place['main/T/C']) == pytest.approx(place['T'] + h * rod)
    # Counter-clockwise: at the top the tube comes from the right and leaves to the left.
    assert place['main/T/B'] - place['main/T/C'] == pytest.approx(-s)


@robots.examples(20)
@given(SEEDS, strategies.sampled_from(robots.KINDS))
def test_the_other_way_round_the_tube_lies_in_the_same_place(seed, kind):
    document = robots.random_document(seed, kind)
    there = robots.load(document)
    for tube in document['tubes'].values():
        tube['joints'].reverse()
    back = robots.load(document)
    place, mirrored = nodes_by_name(there.home), nodes_by_name(back.home)
    for name in there.module_names:
        assert place[f'{name}/B'] == pytest.approx(mirrored[f'{name}/C'], abs=1e-12)
    lengths = dict(zip(there.member_names, there.home.member_lengths, strict=True))
    for name, length in zip(back.member_names, back.home.member_lengths, strict=True):
        tube, ends = name.split('/')
        a, b = ends.split('-')
        assert lengths[f'{tube}/{b}-{a}'] == pytest.approx(length, abs=1e-12)


@robots.examples(20)
@given(SEEDS, strategies.sampled_from(robots.KINDS), strategies.floats(-6.0, 6.0))
def test_home_moves_and_grows_with_the_file(seed, kind, decades):
    scale, shift = 10.0 ** (0.5 * decades), 3.0 - 4.0j
    document = robots.random_document(seed, kind)
    robot = robots.load(document)
    for joint, place in document['joints'].items():
        moved = scale * (complex(*place) + shift)
        document['joints'][joint] = [moved.real, moved.imag]
    for key in ('pinch_separation', 'rod_length', 'guide_ring_distance'):
        document['module'][key] *= scale
    for key in ('min_length', 'max_length'):
        document['members'][key] *= scale
    grown = robots.load(document)
    assert grown.home.points / scale - shift == pytest.approx(robot.home.points, abs=1e-10)


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


def test_module_fits_until_the_sides_have_no_length():
    # In an equilateral triangle the sides are 1 + 2 (h cos 30 - s/2 sin 30) long.
    h = 0.05
    limit = 2.0 * (1.0 + 2.0 * h * np.cos(np.deg2rad(30.0)))
    for s in np.linspace(0.02, 2.0 * limit, 60):
        document = pinched(60.0, {'pinch_separation': s, 'rod_length': h})
        if s < limit - 0.01:
            lengths = robots.load(document).home.member_lengths
            assert lengths == pytest.approx([0.5 * (limit - s)] * 3, abs=1e-12)
        else:
            with pytest.raises(RobotFileError, match='does not fit its corner'):
                robots.load(document)


def test_corner_that_is_nearly_folded_is_refused():
    document = pinched(0.5, {'pinch_separation': 1e-4, 'rod_length': 1e-4})
    with pytest.raises(RobotFileError, match=r'module south/X does not fit .* 0\.5 degrees'):
        robots.load(document)


@pytest.mark.parametrize('bend', [-0.4, 0.4])
def test_corner_that_is_nearly_straight_is_refused(bend):
    document = robots.example()
    document['joints']['M'] = [0.5, 0.5 * np.tan(np.deg2rad(0.5 * bend))]
    document['tubes']['south']['joints'] = ['P', 'M', 'Q', 'X']
    document['supports'] = {'P': ['x', 'y'], 'Q': ['y'], 'M': ['y']}
    with pytest.raises(RobotFileError) as caught:
        robots.load(document)
    assert 'module south/M does not fit its corner' in str(caught.value)
    assert 'at 180 degrees; must be between 1 and 179 degrees (move the joints)' in str(
        caught.value
    )


def test_robot_keeps_what_it_was_made_of():
    robot = load_robot('nine_member')
    for array in (robot.home.points, robot.home.nodes, robot.home.roller_positions):
        with pytest.raises(ValueError, match='read-only'):
            array[0] = 1.0
