# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robot files: what loads, and that every refusal names the file, the key and what is right."""

import contextlib
import copy
from datetime import date, datetime
import io
import re

from hypothesis import given
from isotruss_ros.core import load_robot
from isotruss_ros.core.errors import RobotFileError, StructureError
from isotruss_ros.core.model.safe_yaml import MAX_FILE_SIZE
from isotruss_ros.core.model.stiffness_law import read_laws
from isotruss_ros.core.statics.tube_stiffness import PowerLaw, tube_stiffness
import pytest
import robots
from robots import refusal
from ruamel.yaml import YAML


def as_yaml(document):
    stream = io.StringIO()
    YAML(typ='safe', pure=True).dump(document, stream)
    return stream.getvalue()


def test_numbers_may_be_whole_and_frame_and_stiffness_left_out():
    document = robots.example()
    del document['tube']['stiffness']
    document['joints'] = {'P': [0, 0], 'Q': [1, 0], 'X': [0, 1]}
    document['tube']['pressure'] = 34500
    robot = robots.load(document)
    assert robot.frame == 'truss'
    assert robot.description.stiffness == {'model': 'inflatable_beam'}
    assert all(isinstance(value, float) for value in robot.description.pressures.values())


# Each numeric key must be positive and finite.
NUMBERS = """
module.pinch_separation module.rod_length module.guide_ring_distance module.axial_rigidity
module.flexural_rigidity tube.diameter tube.pressure tube.stiffness.axial_rigidity
tube.stiffness.flexural_rigidity tube.stiffness.shear_rigidity rollers.max_speed
members.min_length members.max_length
"""
NOT_POSITIVE = (0, -1.5, '.nan', '.inf', '-.inf', '1e400', '9' * 400, 'true', 'soft', '"1"', '[]')


@pytest.mark.parametrize('key', NUMBERS.split())
def test_number_that_is_not_positive_is_refused(key):
    for value in NOT_POSITIVE:
        document = robots.example()
        *blocks, last = key.split('.')
        at(document, blocks)[last] = 'VALUE'
        text = as_yaml(document).replace('VALUE', str(value))
        message = refusal(text)
        assert f'{key}: ' in message
        assert 'must be' in message
        assert 'a positive number' in message


#: Changes to a file, and parts of the refusals; a key without a value is removed.
REFUSALS = r"""
tubes.south.joints: [P, Q, W] -> tubes.south.joints: unknown joint 'W' | known are P, Q, X
joints.W: [3.0, 3.0] -> joints.W: no tube has this joint | add it to a tube, or remove it
supports.Q: [z] -> supports.Q.0: 'z' | must be x or y
tubes.south.passive: W -> tubes.south.passive: 'W' is not a joint | must be one of P, Q, X
tubes.south.passive -> tubes.south: key 'passive' is missing | no motor
tubes.south.joints: [P, Q, P, X] -> tubes.south.joints: | three or more different joints
"joints.W\n": [3.0, 3.0] -> 'W\n' | letters, digits and underscores
joints.X: [1.0, 0.0] -> joints.X: [1.0, 0.0] | joint Q is at this position | must differ
module.rod_lenght: 0.1 -> unknown key 'rod_lenght' | did you mean rod_length? | known are pinch_sep
colour: red -> top level: unknown key 'colour' | known are name, frame, joints
module: [1, 2] -> module: [1, 2]: must be the dimensions
tube.stiffness: {model: spring} -> stiffness.model: 'spring' | inflatable_beam, power_law or
tube.stiffness: {model: power_law, axial: {C: 1.0, a: 1.0}} -> stiffness.axial: key 'b' is missing
tube.stiffness: {model: power_law, rotary: {C: -1.0, a: 1.0, b: -1.0}} -> stiffness.rotary.C: -1.0
members: {min_length: 3.0, max_length: 0.25} -> min_length: 3.0 | be less than max_length, 0.25
members.max_length: 0.7 -> members: south/P-Q is | must be from min_length 0.25 to max_length 0.7
module.guide_ring_distance: 0.6 -> guide_ring_distance: 0.6 | south/P-Q | must be less than
tube.diameter: 10.2 -> tube.diameter: 10.2: | from 0.005 to 0.5; if it is in cm, it is 0.102 m
tube.pressure: 34.5 -> tube.pressure: 34.5: | if it is in kPa, it is 34500 Pa
joints.Q: [1.0, .nan] -> joints.Q.1: nan: must be a finite coordinate [m]
joints.Q: [1000.0, 0.0] -> joints.Q.0: 1000.0: | if it is in mm, it is 1 m
joints.X: [2.0, 0.0] -> module south/P does not fit its corner | between 1 and 179 degrees
tube.pressure: 135825 -> tube.pressure: 135825: | if it is absolute, it is 34500 Pa
tube.stiffness_scale: 95 -> tube.stiffness_scale: 95: | if it is in percent, it is 0.95
calibration: {zero_deviations: {south/W: 0.1}} -> zero_deviations: unknown roller 'south/W'
calibration: {checked_rollers: [P]} -> checked_rollers: unknown roller 'P' | known are south/
tube.pressure: 0.0 -> tube.pressure: 0.0: must be gauge pressure, a positive number [Pa]
tube.pressure: {} -> tube.pressure: tube south is missing; give one number, or one per tube
tube.pressure: {south: 2e+4, west: 2e+4} -> tube.pressure: unknown tube 'west'; known are south
tube.stiffness: {model: inflatable_beam, membrane_modulus: 60} -> if it is in kN/m or N/mm, it is 6
tube.stiffness: {model: inflatable_beam, membrane_modulus: 5e+8} -> in Pa, of a wall of 0.1 mm, it
tube.stiffness: {model: inflatable_beam, end_softening: 732} -> from 0.2 to 200; | it is 7.32
tube.stiffness.flexural_rigidity: 2.5e+5 -> if it is in N cm^2, it is 25 N m^2
tube.stiffness.pressure: 34.5 -> if it is in kPa, it is 34500 Pa
tube.stiffness.pressure: 135825 -> if it is absolute, it is 34500 Pa
"""


@pytest.mark.parametrize('case', REFUSALS.strip().splitlines())
def test_errors_name_the_key_and_the_valid_value(case):
    change, _, wanted = case.partition(' -> ')
    if ':' in change:
        ((path, value),) = YAML(typ='safe', pure=True).load(change).items()
    else:
        path, value = change, None
    document = robots.example()
    *blocks, key = path.split('.')
    block = at(document, blocks)
    if value is None:
        del block[key]
    else:
        block[key] = value
    message = refusal(as_yaml(document))
    for part in wanted.split(' | '):
        assert part in message, message


def test_overlapping_parts_at_home_are_refused():
    document = robots.preset_document('nine_member')
    document['joints']['Z'] = [0.716, -2.2]
    message = refusal(as_yaml(document))
    assert 'module east/R and module north/R overlap at home' in message
    assert 'their clearance is -0.040 m' in message


@pytest.mark.parametrize(('mistakes', 'lines'), [(50, 50), (51, 51), (2_000, 51)])
def test_complaints_are_truncated_after_fifty(mistakes, lines):
    document = robots.example()
    document['joints'] |= {f'J{i}': 'here' for i in range(mistakes)}
    told = refusal(as_yaml(document)).splitlines()
    assert len(told) == lines
    assert told[-1].endswith('and more like these') == (mistakes > 50)


@pytest.mark.parametrize('key', ['tubes', 'supports'])
def test_list_of_mistakes_is_refused_in_time(key):
    # Compared in pairs, as JSON Schema would have it, these take hours; the runner gives minutes.
    wrong = [{'a': i} for i in range(1_500)]
    document = robots.example()
    document[key] = {'P': wrong} if key == 'supports' else {'t': {'joints': wrong, 'passive': 'P'}}
    content = as_yaml(document)
    assert 12_000 < len(content) < MAX_FILE_SIZE
    assert "{'a': 0}: must be" in refusal(content)


EXAMPLE = as_yaml(robots.example())
LAST_LINE = EXAMPLE.count('\n') + 1
NO_ROBOTS = {
    'duplicate key': (
        EXAMPLE + 'name: twice\n',
        f'line {LAST_LINE}, column 1: not YAML 1.2: found duplicate key "name"',
    ),
    'number as a name': (
        EXAMPLE.replace('P: [0', '1: [0'),
        "joints: 1 is not text; put quotes around it: '1'",
    ),
    'alias': ('name: x\nframe: *a\n', 'line 2: *a: anchors and aliases are not used'),
    'bracket that does not close': ('{name: [}', 'line 1, column 9: not YAML 1.2'),
    'object of Python': ('name: !!python/object:os.system x\n', 'not YAML 1.2'),
    # Python reads it, and then cannot print it.
    'very long number in base 16': ('name: 0x' + 'f' * 5000, 'must be at most 1000'),
    # The reader takes time in the square of the depth: hours for a file of brackets.
    'very deep': ('[\n' * 100_000, 'line 9: nested too deeply'),
    'empty': ('', 'top level: None: must be a robot: the keys name, joints'),
    'UTF-16': ('name: x'.encode('utf-16'), 'not UTF-8 text'),
    'too long': (b'#' * (MAX_FILE_SIZE + 1), f'at most {MAX_FILE_SIZE} bytes'),
}


@pytest.mark.parametrize('case', NO_ROBOTS)
def test_invalid_robot_files_are_refused(case):
    content, wanted = NO_ROBOTS[case]
    assert wanted in refusal(content)


@pytest.mark.parametrize(
    'name', ['nine', '~nobody_of_this_name/x.yaml', 'x\0y', 'x' * 300, '/', '', None], ids=repr
)
def test_missing_file_is_refused_with_the_presets(name):
    with pytest.raises(RobotFileError, match=r'give one of bow_tie, .*, triangle, or the path'):
        load_robot(name)


def at(document, path):
    for part in path:
        document = document[part]
    return document


#: Keys and values of every type that YAML knows, extremes among them.
ODD = [None, True, 0, -(10**30), 5e-324, -1e12, float('nan'), '', 'x', 'P', 'section', 'power_law']
ODD += [date(2001, 2, 3), datetime(2001, 2, 3), b'xyz', [], {}, [[0.0]], {0: None}, {'C': [1]}]


def mutate(rng, document):
    """Replace, remove or insert a random value somewhere in a document."""
    block = document
    while True:
        places = list(block) if isinstance(block, dict) else list(range(len(block)))
        if not places:
            return
        key = places[rng.integers(len(places))]
        if rng.random() < 0.4 or not isinstance(block[key], (dict, list)):
            break
        block = block[key]
    odd, change = copy.deepcopy(ODD[rng.integers(len(ODD))]), rng.integers(3)
    if change == 0:
        block[key] = odd
    elif change == 1:
        del block[key]
    elif isinstance(block, list):
        block.insert(key, odd)
    else:
        block[str(odd)[:4]] = odd


@robots.examples(150)
@given(robots.generators())
def test_mutated_file_loads_or_is_refused(rng):
    document = robots.example()
    for _ in range(rng.integers(1, 4)):
        mutate(rng, document)
    with contextlib.suppress(RobotFileError):
        robots.load(as_yaml(document))


def laws(b_rotary=0.5, c_rotary=0.3, a_rotary=0.6):
    """Return power laws whose transverse one goes with p^0.6 / L."""
    return {
        'model': 'power_law',
        'axial': {'C': 8.0, 'a': 0.6, 'b': 0.0},
        'transverse': {'C': 0.5, 'a': 0.6, 'b': -1.0},
        'rotary': {'C': c_rotary, 'a': a_rotary, 'b': b_rotary},
    }


def with_laws(block, **members):
    document = robots.example()
    document['tube']['stiffness'] = block
    document['members'] |= members
    return document


@pytest.mark.parametrize(
    ('constant', 'words'),
    [(8e-3, 'if it is in kN/m or N/mm, it is'), (505, 'if it is with p in kPa, it is')],
)
def test_law_in_another_unit_is_refused_with_the_unit(constant, words):
    block = laws() | {'axial': {'C': constant, 'a': 0.6, 'b': 0.0}}
    assert words in refusal(with_laws(block))


def test_length_of_a_contradiction_is_the_limit_of_beams():
    """Against the model itself: a beam on one side of the length that is named, none beyond."""
    for block in (laws(c_rotary=0.2), laws(b_rotary=2.5, c_rotary=0.25)):
        message = refusal(with_laws(block, min_length=0.5))
        length = float(re.search(r'([\d.]+) m from pinch to pinch', message).group(1))
        model = PowerLaw(**read_laws(block), guide_ring_distance=0.08)
        inside = -1e-4 if 'above' in message else 1e-4
        model.section_stiffness([length + inside], 34.5e3)
        with pytest.raises(StructureError, match='no beam has'):
            model.section_stiffness([length - inside], 34.5e3)


def test_laws_are_checked_at_the_pressure_of_each_tube():
    document = with_laws(laws(a_rotary=0.8, c_rotary=0.3 * 34.5e3**-0.2))
    robots.load(document)
    document['tube']['pressure'] = {'south': 1e4}
    assert 'at 10000 Pa in tube south' in refusal(document)


def test_section_of_tubes_with_different_pressures_needs_its_own():
    document = robots.preset_document('nine_member')
    document['tube']['stiffness'] = robots.example()['tube']['stiffness']
    document['tube']['pressure'] = {'south': 2e4, 'east': 3e4, 'north': 3e4}
    assert "tube.stiffness: key 'pressure' is missing" in refusal(document)
    document['tube']['stiffness']['pressure'] = 3e4
    model = tube_stiffness(robots.load(document).description).model
    assert model.section_stiffness([1.0], 3e4).shear == pytest.approx([1.9e3])
