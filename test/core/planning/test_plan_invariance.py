# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plans depend neither on the place and direction of the robot nor on its names."""

import copy
from pathlib import Path

from isotruss_ros import core
from isotruss_ros.core.model.presets import config_directory
from isotruss_ros.core.model.robot_file import describe_robot
from nightly import some_now
import numpy as np
import pytest
from ruamel.yaml import YAML

DOCUMENT = YAML(typ='safe').load((config_directory() / 'nine_member.yaml').read_text('utf-8'))
MIDDLE = complex(*np.mean(list(DOCUMENT['joints'].values()), axis=0))
BOX = core.Polygon([(0.15, 0.1), (-0.15, 0.1), (-0.15, -0.1), (0.15, -0.1)])
NAMES = dict(zip('PQRXYZ', ('last', 'B', 'm', 'a', 'zz', 'c'), strict=True))
NAMES |= {'south': 'u', 'east': 'Z', 'north': 'b'}
#: Shapes with the places of their centres. From the first two, members are equally far; faces of
#: the first box are parallel to a member.
OBJECTS = [
    (core.Disc(0.3), 0.2j),
    (core.Disc(0.5), 0.1 + 0.05j),
    (BOX, 0.2j),
    (BOX, 0.12 + 0.03j),
    (core.Ellipse((0.2, 0.14)), 0.1j),
]


def plan(shape, away, shift=0j, quarters=0, names=None):
    """Return score, squeeze and travel (n, 3) of the grasps, and the names of their members."""
    turn, document = 1j**quarters, copy.deepcopy(DOCUMENT)
    rename = (names or {}).get
    document['joints'] = {
        rename(name, name): [(z := turn * complex(*place) + shift).real, z.imag]
        for name, place in document['joints'].items()
    }
    axes = {'x': 'y', 'y': 'x'} if quarters % 2 else {}
    document['supports'] = {
        rename(name, name): [axes.get(axis, axis) for axis in held]
        for name, held in document['supports'].items()
    }
    document['tubes'] = {
        rename(tube, tube): {
            'joints': [rename(name, name) for name in block['joints']],
            'passive': rename(block['passive'], block['passive']),
        }
        for tube, block in document['tubes'].items()
    }
    robot = core.Robot(describe_robot(Path('other.yaml'), document))
    place = turn * (MIDDLE + away) + shift
    body = core.ConvexObject(shape, (place.real, place.imag, 0.5 * np.pi * quarters))
    grasps = core.plan_grasps(
        robot.home, body, core.GraspRequirements(friction=0.6), max_rounds=1
    ).grasps
    order = robot.member_names
    members = [[order.index(name) for name in grasp.members] for grasp in grasps]
    return np.array([(grasp.score, grasp.squeeze, grasp.travel) for grasp in grasps]), members


@pytest.mark.parametrize('number', some_now(range(len(OBJECTS))))
def test_plans_depend_on_no_frame_or_name(number):
    values, members = plan(*OBJECTS[number])
    others, same = plan(*OBJECTS[number], shift=0.1 + 0.2j, quarters=1, names=NAMES)
    assert same == members
    assert others == pytest.approx(values, rel=1e-9)
    assert len(values)
