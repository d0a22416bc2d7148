# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A short part of the comparison with MuJoCo, and the page in docs/ that shows all of it."""

from pathlib import Path

from comparison import boxes, carried, drops, faulty_carries, friction, grasps, pulls
from comparison.grips import PressedCase
from comparison.page import FOLDER, page
from comparison.section import Check, Section
from comparison.sections import SECTIONS
from isotruss_ros.demo.path import rotation, translation
from matplotlib.figure import Figure
from mujoco_worlds import needs_mujoco
from nightly import some_now
import numpy as np
from paper.tables import Table
import pytest

DOCS = Path(__file__).resolve().parents[2] / 'docs'


def require_kept(section):
    for check in section.checks:
        assert check.kept, check.row()


@pytest.mark.nightly
@needs_mujoco
def test_a_grasp_is_within_its_bounds():
    require_kept(grasps.compare(wedges=(40.0,), indentations=(0.02,)))


@pytest.mark.nightly
@needs_mujoco
def test_a_pull_that_slips_is_within_its_bounds():
    require_kept(pulls.compare((PressedCase(40.0, 0.04),), directions=(np.pi, -0.5 * np.pi)))


@pytest.mark.nightly
@needs_mujoco
def test_an_object_is_lost_where_friction_is_too_low():
    require_kept(friction.compare((PressedCase(50.0, 0.03),)))


@pytest.mark.nightly
@needs_mujoco
def test_an_object_carried_with_its_squeeze_regulated_follows_its_path():
    result = carried.run(carried.REGULATED, (translation('up', 3.0, 0.03, 0.08),))
    position, angle = carried.BOUNDS[carried.REGULATED]
    assert 1e3 * result.position_error < position
    assert np.degrees(result.angle_error) < angle
    assert result.squeezes.min() > 0.9 * result.squeezes.max()
    assert np.hypot(*(result.poses[-1] - result.poses[0])[:2]) == pytest.approx(0.085, abs=2e-3)


@pytest.mark.nightly
@needs_mujoco
def test_a_box_between_sides_that_do_not_meet_is_within_its_bounds():
    phases = (translation('along', 3.0, 0.04, 0.0), rotation('turn', 3.0, 0.15))
    section = boxes.compare(boxes.CASES[:1], phases)
    require_kept(section)
    assert len(section.figure.axes) == 4


@needs_mujoco
@pytest.mark.parametrize(('above', 'dropped'), some_now([(-0.4, True), (0.1, False)]))
def test_a_load_below_the_slip_margin_is_held_and_one_above_is_not(above, dropped, monkeypatch):
    monkeypatch.setattr(drops, 'ABOVE', above)
    case = drops.Case(PressedCase(40.0, 0.05, 0.2), 0.6, None, np.array([0.01, 0.0, 0.05]))
    assert drops.attempt(case).dropped == dropped


def test_the_table_of_faulty_carries_is_replaced_in_its_page(tmp_path):
    page = tmp_path / 'page.md'
    page.write_text((DOCS / 'safety.md').read_text(encoding='utf-8'), encoding='utf-8')
    rows = faulty_carries.tabulate([])
    before = page.read_text(encoding='utf-8')
    assert '\n'.join(rows) in before
    faulty_carries.write_table(page, [*rows, '| new |'])
    after = page.read_text(encoding='utf-8')
    assert '\n'.join([*rows, '| new |']) in after
    ahead, table = before.split(rows[0])
    assert after.startswith(ahead)
    assert after.endswith(table.partition('\n\n')[2])


def test_the_page_shows_what_is_out_of_bounds():
    table = Table('things', 'Some', ('a', 'b'), [('1', '2')])
    checks = (Check('kept', 1.0, 2.0, 'mm', 'steps'), Check('broken', 3.0, 2.0, '%', 'why'))
    text = page([Section('Things', 'Words.', checks, (table,), Figure(), 'A picture')])
    assert '| kept | 1 mm | 2 mm | steps |' in text
    assert '| broken | **3 %** | 2 % | why |' in text
    assert f'![A picture]({FOLDER}/things.png)' in text
    assert f'Some ([CSV]({FOLDER}/things.csv)):' in text
    assert not checks[1].kept


def test_the_page_in_the_docs_keeps_all_bounds():
    text = (DOCS / 'plant.md').read_text(encoding='utf-8')
    bounds = text.split('## Bounds')[1].split('\n## ')[0]
    assert '**' not in bounds
    assert text.count('\n## ') == 1 + len(SECTIONS)
    tables = {path.stem for path in (DOCS / FOLDER).glob('*.csv')}
    assert tables == {name for name in tables if f'({FOLDER}/{name}.csv)' in text}
