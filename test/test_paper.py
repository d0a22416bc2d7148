"""The items of the paper: what must hold in each, and that the page in docs/ shows them."""

import importlib
import math
from pathlib import Path
import re

from isotruss_ros import core
from isotruss_ros.core.beam import local_stiffness
from isotruss_ros.core.frame import Frame
from isotruss_ros.core.power_law import PowerLaw
from isotruss_ros.core.tube_stiffness import InflatableBeam
from isotruss_ros.fit.measurements import MODES
from isotruss_ros.paper import (
    figure_4,
    figure_5,
    figure_6,
    figure_7,
    figure_9,
    synthetic,
    wrinkling,
)
from isotruss_ros.paper.clamped_tube import press
from isotruss_ros.paper.default_tube import end_stiffnesses
from isotruss_ros.paper.items import ITEMS
from isotruss_ros.paper.page import FOLDER, page
from isotruss_ros.paper.parameters import (
    CYLINDERS,
    DISCS,
    EDGES,
    LENGTHS,
    PRESSURE,
    PRESSURES,
    TUBE_DIAMETER,
    TUBE_LENGTH,
)
from isotruss_ros.paper.style import save, SETTINGS
from isotruss_ros.paper.tables import markdown, number, Table, write_csv
from matplotlib import rc_context
import numpy as np
import pytest
from scipy.integrate import quad

DOCS = Path(__file__).resolve().parents[1] / 'docs'
RADIUS = 0.5 * TUBE_DIAMETER
BEAM = InflatableBeam(RADIUS)


@pytest.fixture(scope='module')
def results():
    """Return the results of all items by name."""
    return {item.name: item.compute(lambda done: None) for item in ITEMS}


# -- The pages --


def named_objects(text):
    return sorted(set(re.findall(r'`(core(?:\.\w+)+)', text)))


@pytest.mark.parametrize('path', sorted(DOCS.glob('*.md')), ids=lambda path: path.name)
def test_functions_named_in_the_docs_exist(path):
    for name in named_objects(path.read_text(encoding='utf-8')):
        found, walked = importlib.import_module('isotruss_ros'), 'isotruss_ros'
        for part in name.split('.'):
            walked = f'{walked}.{part}'
            if not hasattr(found, part):
                importlib.import_module(walked)
            found = getattr(found, part)


def test_derivation_has_every_equation_with_a_function():
    text = (DOCS / 'derivation.md').read_text(encoding='utf-8')
    rows = re.findall(r'^\| \((\d+)\) \| [^|]+ \| (.*) \|$', text, re.MULTILINE)
    assert [int(equation) for equation, _ in rows] == list(range(1, 21))
    for _, functions in rows:
        assert named_objects(functions)


def test_page_is_what_the_items_say(results):
    """Run `make paper` where this fails: the numbers on the page are no longer those computed."""
    reports = [(item, item.report(results[item.name])) for item in ITEMS]
    digits = re.compile(r'-?\d+(?:\.\d+)?')
    written = (DOCS / 'paper.md').read_text(encoding='utf-8')
    computed = page(reports)
    assert digits.sub('#', written) == digits.sub('#', computed)
    # Another machine rounds another way, and may end on another last digit.
    numbers = np.array([[float(x) for x in digits.findall(text)] for text in (written, computed)])
    np.testing.assert_allclose(*numbers, rtol=0.03)
    for item, report in reports:
        assert all((report.heading, report.stated, report.computed, report.difference))
        assert report.assumption
        assert report.tables
        assert bool(item.draw) == bool(report.picture)


def test_page_links_to_files_that_are_there():
    text = (DOCS / 'paper.md').read_text(encoding='utf-8')
    links = re.findall(r'\]\(([\w/.]+)\)', text)
    for link in links:
        assert (DOCS / link).is_file(), link
    for path in (DOCS / FOLDER).iterdir():
        assert f'{FOLDER}/{path.name}' in links, f'{path.name} is not on the page'


def test_figures_and_tables_are_the_same_each_time(results, tmp_path):
    folders = (tmp_path / 'first', tmp_path / 'second')
    for folder in folders:
        folder.mkdir()
        for item in ITEMS:
            if item.draw:
                with rc_context(SETTINGS):
                    save(item.draw(results[item.name]), folder / f'{item.name}.png')
            for table in item.report(results[item.name]).tables:
                write_csv(table, folder)
    for path in folders[0].iterdir():
        assert path.read_bytes() == (folders[1] / path.name).read_bytes(), path.name
        assert (DOCS / FOLDER / path.name).exists()


def test_tables_are_markdown_and_numbers_have_no_exponent():
    table = Table('t', 'caption', ('a', 'b'), [('x', number(4644.1)), ('y', number(-4.6441e-5))])
    assert markdown(table).splitlines() == [
        '| a | b |',
        '| --- | ---: |',
        '| x | 4640 |',
        '| y | -0.0000464 |',
    ]
    assert number(0.0) == '0'


def test_discs_are_cylinder_and_tube():
    # Of the paper, which rounds both to three digits.
    assert np.array(DISCS) == pytest.approx(np.array(CYLINDERS) + TUBE_DIAMETER, abs=1.5e-3)


# -- Table I and Fig. 4 --


def test_stiffnesses_are_those_of_clamped_beams():
    for pressure in PRESSURES:
        for length in LENGTHS:
            k = end_stiffnesses(pressure, length)
            EA, EI, GA = (float(value[0]) for value in BEAM.rigidities(length, pressure))
            assert k['axial'] == pytest.approx(EA / length)
            # One end sinks and does not turn: twice the tip of a cantilever of half the length.
            assert k['transverse'] == pytest.approx(1.0 / (length**3 / (12 * EI) + length / GA))
            # One end turns and does not sink: from the flexibility of the tip of a cantilever.
            sink = length**3 / (3 * EI) + length / GA
            turn = length / EI - (length**2 / (2 * EI)) ** 2 / sink
            assert k['rotary'] == pytest.approx(1.0 / turn)


def test_fit_returns_what_made_the_points(results):
    result = results['figure_4']
    model = PowerLaw(*(result.laws[mode].law for mode in MODES))
    assert all(figure_4.inside(result.analysis, model))
    # Three standard deviations of a count of 95 % in 1200: of the three constants of each of the
    # 600 fits, C and a go together.
    assert result.held == pytest.approx(0.95, abs=3 * math.sqrt(0.05 * 0.95 / 1200))
    for mode in MODES:
        assert result.analysis.laws[mode].count == 9
        assert result.analysis.points(mode) > 0.95 * 9 * 5 * synthetic.COUNT


def test_fit_without_noise_is_exact(results, monkeypatch):
    monkeypatch.setattr(synthetic, 'SCATTER', 0.0)
    monkeypatch.setattr(synthetic, 'NOISE', 0.0)
    laws = results['figure_4'].laws
    analysis = figure_4.fit_points(PowerLaw(*(laws[mode].law for mode in MODES)), 0)
    for mode in MODES:
        assert analysis.laws[mode].law == pytest.approx(laws[mode].law, rel=1e-6)
        assert analysis.laws[mode].r_squared == pytest.approx(1.0)


def test_points_end_where_the_tube_wrinkles():
    moment = wrinkling.wrinkling_moment(34.5e3, RADIUS)
    for length in LENGTHS:
        # Both ends of a member that is sheared carry half of V L.
        force = synthetic.largest_load('transverse', 34.5e3, length)
        assert force * length / 2 == pytest.approx(moment)
        assert synthetic.largest_load('rotary', 34.5e3, length) == moment


# -- Fig. 5 --


def test_triangles_are_ordered(results):
    obtuse, equilateral, acute = (results['figure_5'][name] for name in EDGES)
    assert 1.1 * obtuse.stiffness < equilateral.stiffness
    assert 1.1 * equilateral.stiffness < acute.stiffness
    # The explanation: two bars with the legs' axial stiffness are about as stiff, never softer.
    for shape in (obtuse, equilateral, acute):
        assert 0.85 * shape.truss < shape.stiffness < shape.truss
    # The same tube in all shapes.
    totals = [shape.config.member_lengths.sum() for shape in (obtuse, equilateral, acute)]
    assert np.ptp(totals) < 0.01


def test_edges_between_pinch_points_are_members():
    for edges in EDGES.values():
        base, right, left = figure_5.triangle(figure_5.between_joints(edges)).home.member_lengths
        assert (left, right, base) == pytest.approx((edges[0], edges[0], edges[1]), abs=1e-6)


@pytest.mark.parametrize('name', EDGES)
def test_push_is_that_of_a_frame_with_these_supports(name, results):
    """Solve the frame with the supports as supports, not as loads."""
    config = results['figure_5'][name].config
    structure = config.structure
    held = np.zeros((len(structure.node_names), 3), dtype=bool)
    for joint, axes in (('L', [0, 1]), ('R', [0, 1]), ('T', [0])):
        held[structure.node(joint), axes] = True
    old = structure.frame
    frame = Frame(old.points, old.members, held, structure.node_names, old._rows)
    loads = np.zeros((len(structure.node_names), 3))
    loads[structure.node('T'), 1] = -1.0
    state = frame.solve(loads)
    give, pushed = figure_5.push(config)
    assert -state.displacements[structure.node('T'), 1] == pytest.approx(give, rel=1e-9)
    assert pushed.state.displacements == pytest.approx(state.displacements, abs=1e-9 * give)
    # Symmetric: the top neither turns nor pushes the track.
    assert state.reactions[structure.node('T'), 0] == pytest.approx(0.0, abs=1e-6)
    left, right = (state.reactions[structure.node(joint)] for joint in 'LR')
    assert left[:2] == pytest.approx([-right[0], right[1]], abs=1e-6)
    assert left[1] == pytest.approx(0.5, abs=1e-6)


def test_tube_wrinkles_where_its_wall_goes_slack():
    pull = wrinkling.pressure_force(PRESSURE, RADIUS)
    for compression in (0.0, 0.4 * pull):
        tension = (pull - compression) / (2 * math.pi * RADIUS)
        # Membrane force of bending at the outer fibre: M / (pi r^2).
        slack = tension * math.pi * RADIUS**2
        factor = wrinkling.load_factor(1.0, compression / slack, math.inf, pull, RADIUS)
        assert factor == pytest.approx(slack)
    assert wrinkling.wrinkling_moment(PRESSURE, RADIUS) == pytest.approx(
        math.pi * PRESSURE * RADIUS**3 / 2
    )


def test_load_factor_solves_its_equation():
    random = np.random.default_rng(3)
    moment, compression = random.uniform(0.001, 10.0, 50), random.uniform(0.0, 300.0, 50)
    column, pull = random.uniform(10.0, 1e4, 50), 282.0
    factors = [
        wrinkling.load_factor(moment, compression, column, pull, RADIUS, stage)
        for stage in (wrinkling.ONSET, wrinkling.COLLAPSE)
    ]
    for stage, t in zip((1.0, 2.0), factors, strict=True):
        assert (t > 0.0).all()
        assert (t * compression < np.minimum(column, pull)).all()
        grown = t * moment / (1.0 - t * compression / column)
        assert grown == pytest.approx(stage * (pull - t * compression) * RADIUS / 2.0, rel=1e-6)
    assert (factors[0] < factors[1]).all()


def test_column_is_that_of_euler_without_shear():
    assert wrinkling.column_load(25.0, math.inf, 2.0) == pytest.approx(math.pi**2 * 25.0 / 4.0)
    # However stiff in bending, it does not bear more than its shear stiffness.
    assert wrinkling.column_load(1e12, 1.9e3, 1.0) == pytest.approx(1.9e3, rel=1e-6)


def test_linear_range_ends_before_buckling(results):
    for shape in results['figure_5'].values():
        assert 0.005 < shape.onset < shape.collapse < shape.bare
        assert 0.9 < shape.geometry < 1.0


# -- Fig. 6 --


def test_stiffness_of_the_middle_is_that_of_the_textbook():
    _, EI, GA = (float(value[0]) for value in BEAM.rigidities(TUBE_LENGTH, PRESSURE))
    shear = TUBE_LENGTH / (4 * GA)
    for pinned, share in ((False, 192), (True, 48)):
        exact = 1.0 / (TUBE_LENGTH**3 / (share * EI) + shear)
        found = press(BEAM, TUBE_LENGTH / 2, DISCS[0], 1e-4, pinned=pinned).stiffness
        assert found == pytest.approx(exact, rel=1e-3)


def test_tube_wrinkles_at_its_ends(results):
    """Half of the tube, its end in the middle pushed and not turning: the moment at the wall."""
    half = local_stiffness(np.array([TUBE_LENGTH / 2]), *BEAM.rigidities(TUBE_LENGTH, PRESSURE))
    moment = results['figure_6'].wrinkling * half[0, 2, 4]
    assert abs(moment) == pytest.approx(wrinkling.wrinkling_moment(PRESSURE, RADIUS), rel=2e-3)


def test_stiffness_without_gas_does_not_see_the_diameter(results):
    result = results['figure_6']
    differ = figure_6.spread(result.stiffness)
    assert differ.max() < 0.05
    assert differ[np.abs(result.positions / TUBE_LENGTH - 0.5) < 0.2].max() < 0.01
    # It does see the position, and both halves are alike.
    assert (result.stiffness[:, 0] > 2.0 * result.stiffness[:, len(result.positions) // 2]).all()
    assert result.stiffness == pytest.approx(result.stiffness[:, ::-1], rel=1e-6)


def test_stiffness_with_gas_grows_with_the_diameter(results):
    result = results['figure_6']
    for gain in (result.gain, result.proportional):
        assert (gain[0] > 0.0).all()
        assert (np.diff(gain, axis=0) > 0.0).all()
        assert (np.diff(gain, axis=1) > 0.0).all()
    # Where the stiffness is the pressure's, so is the gain.
    (_, gas), gain = result.middle[-1], result.proportional[-1]
    at = int(np.argmin(np.abs(result.depths - figure_6.DEPTH)))
    assert gain[at] == pytest.approx(gas.pressure / PRESSURE - 1.0, rel=1e-3)


def test_gas_is_compressed_by_what_the_cylinder_takes():
    depth, disc = 0.02, DISCS[1]
    height = disc / 2 - depth

    def cut(x):
        """Return the area of the tube's cross-section beyond the skin of the cylinder."""
        edge = RADIUS - max(0.0, disc / 2 - math.hypot(x, height))
        area, _ = quad(lambda y: 2 * math.sqrt(max(0.0, RADIUS**2 - y**2)), edge, RADIUS)
        return area

    half = math.sqrt((disc / 2) ** 2 - height**2)
    taken = 2 * quad(cut, 0.0, half)[0]
    volume = math.pi * RADIUS**2 * TUBE_LENGTH
    absolute = (PRESSURE + 101_325.0) * volume / (volume - taken)
    gas = press(BEAM, TUBE_LENGTH / 2, disc, depth, gas=True)
    assert gas.pressure - PRESSURE == pytest.approx(absolute - 101_325.0 - PRESSURE, rel=1e-3)


# -- Fig. 7 --


def test_grasps_are_three_of_one_object_in_one_place(results):
    held = results['figure_7']
    assert [each.plan.grasp.module for each in held] == list(figure_7.MODULES)
    for each in held:
        plan, config = each.plan, each.plan.config
        assert plan.grasp.center == figure_7.CYLINDER.center
        assert plan.grasp.diameter == figure_7.CYLINDER.diameter
        # The way begins at home, where nothing touches the object, and ends in the grasp.
        home = config.robot.home
        assert plan.path[0] == pytest.approx(home.roller_positions)
        assert plan.path[-1] == pytest.approx(config.roller_positions)
        assert not core.analyze_grasp(home, figure_7.CYLINDER).normal_forces.any()
        assert np.abs(config.residual()).max() < 1e-9
        assert plan.analysis.force_closure
        assert plan.required_friction <= figure_7.FRICTION
        # Both sides at the module hold it, with forces that closer contact points do not change.
        assert set(each.analysis.contact_lengths) == set(plan.members)
        assert len(plan.members) == 2
        total = each.analysis.normal_forces.sum()
        assert total == pytest.approx(plan.analysis.normal_forces.sum(), rel=0.02)


def test_grasps_differ(results):
    held = results['figure_7']
    regions = [each.analysis.points[each.analysis.normal_forces > 0.0] for each in held]
    values = np.array(
        [
            [
                each.analysis.normal_forces.sum(),
                each.deflection,
                *np.diag(each.analysis.stiffness),
            ]
            for each in held
        ]
    )
    for i, j in ((0, 1), (0, 2), (1, 2)):
        # Forces, deformation and stiffness by more than their errors, regions by centimetres.
        assert (np.abs(values[i] / values[j] - 1.0) > 0.02).all()
        apart = np.abs(regions[i][:, None] - regions[j]).max(axis=2)
        assert apart.max(axis=0).max() > 0.05
    # So that the stiffness can be chosen, the object where it is.
    assert (values[:, 2:4].max(axis=0) > 1.5 * values[:, 2:4].min(axis=0)).all()


# -- Fig. 9 --


def test_object_keeps_to_the_path(results):
    result = results['figure_9']
    start, up, turn, arc = result.parts
    for part in result.parts[1:]:
        assert part.position_error < 2e-6
        assert part.angle_error < math.radians(1e-3)
        assert part.statuses <= {core.Status.OK, core.Status.IDLE}
        assert np.abs(part.config.residual()).max() < 1e-9
    assert up.poses[-1] - start.poses[0] == pytest.approx([0.0, 0.2, 0.0], abs=1e-5)
    assert np.ptp(turn.poses[:, :2], axis=0) == pytest.approx([0.0, 0.0], abs=1e-5)
    assert turn.poses[-1, 2] - up.poses[-1, 2] == pytest.approx(math.pi / 2, abs=1e-5)
    # A quarter of a circle below its highest point, the orientation away from its centre.
    center = turn.poses[-1, :2] - [0.0, 0.25]
    outward = arc.poses[:, :2] - center
    assert np.hypot(*outward.T) == pytest.approx(0.25, abs=1e-5)
    assert np.arctan2(*outward.T[::-1]) == pytest.approx(arc.poses[:, 2], abs=1e-5)
    assert outward[-1] == pytest.approx([0.25, 0.0], abs=1e-5)
    assert figure_9.normal_error(arc, turn) < math.radians(1e-3)


def test_errors_are_those_of_the_midpoint_rule(results):
    """Half the rate makes at least four times the error, and looking ahead matters."""
    coarse = figure_9.carry(0.5 / 25.0, 25.0, lambda done: None)
    result = results['figure_9']
    for fine, rough, plain in zip(result.parts[1:], coarse[1:], result.plain[1:], strict=True):
        assert rough.position_error > 3.0 * fine.position_error
        assert plain.position_error > 50.0 * fine.position_error
