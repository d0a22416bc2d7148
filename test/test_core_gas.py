"""The gas in the tubes: indentation raises pressure, pressure raises stiffness."""

from dataclasses import replace

from isotruss_ros.core import analyze_grasp, Cylinder, load_robot, Robot, StructureError
from isotruss_ros.core.candidates import find_candidates
from isotruss_ros.core.gas import ATMOSPHERE, raised_pressure, segment_area
import numpy as np
import pytest
from scipy.integrate import quad

TRIANGLE = load_robot('triangle')
PRESSURE = TRIANGLE.description.pressure
TUBE = TRIANGLE.description.tube_diameter
#: The paper's cylinders [m].
DIAMETERS = (0.0254, 0.102, 0.203)
STIFFNESSES = {
    'inflatable_beam': {'model': 'inflatable_beam'},
    'section': {
        'model': 'section',
        'axial_rigidity': 1.9e4,
        'flexural_rigidity': 25.0,
        'shear_rigidity': 1.9e3,
    },
    'power_law': {
        'model': 'power_law',
        'axial': {'C': 0.3, 'a': 1.0, 'b': 0.0},
        'transverse': {'C': 0.005, 'a': 1.0, 'b': -2.0},
        'rotary': {'C': 0.02, 'a': 0.8, 'b': -0.5},
    },
}


def pressed(depth, diameter):
    """Return an object that is pressed into the middle of the base from the inside."""
    base = TRIANGLE.home.nodes[TRIANGLE.node_names.index('main/L/B')]
    return Cylinder((0.51, base[1] + 0.5 * (diameter + TUBE) - depth), diameter)


def test_segment_area_is_the_integral_of_its_chord():
    radius = 0.05
    for depth in (0.0, 0.01, 0.05, 0.08, 0.1):
        exact, _ = quad(lambda h: 2.0 * np.sqrt(max(0.0, 2.0 * radius * h - h**2)), 0.0, depth)
        assert segment_area(np.array([depth]), radius)[0] == pytest.approx(exact, abs=1e-9)


def test_pressure_is_that_of_the_compressed_volume():
    """A long, deep cut: p V is constant with the volume that quadrature finds."""
    cylinder, depth = pressed(0.03, 0.4), 0.03
    radius = 0.5 * (cylinder.diameter + TUBE)
    center = complex(*cylinder.center)
    config = TRIANGLE.home
    candidates = find_candidates(config.structure, center, radius, 1e-3)
    (raised,) = raised_pressure(config, candidates, center, radius)
    half = np.sqrt(radius**2 - (radius - depth) ** 2)
    taken, _ = quad(
        lambda x: segment_area(radius - np.hypot(radius - depth, np.array([x])), 0.5 * TUBE)[0],
        -half,
        half,
    )
    length = config.member_lengths.sum() + 3 * TRIANGLE.description.module.pinch_separation
    volume = np.pi * (0.5 * TUBE) ** 2 * length
    absolute = (PRESSURE + ATMOSPHERE) * volume / (volume - taken)
    assert raised - PRESSURE == pytest.approx(absolute - ATMOSPHERE - PRESSURE, rel=2e-3)


def test_without_a_touch_nothing_changes():
    apart = pressed(-0.05, 0.1)
    with_gas = analyze_grasp(TRIANGLE.home, apart, gas=True)
    assert with_gas.pressures == {'main': PRESSURE}
    assert not with_gas.normal_forces.any()


@pytest.mark.parametrize('model', STIFFNESSES)
def test_interference_stiffness_grows_with_the_diameter_by_the_gas_alone(model):
    robot = Robot(replace(TRIANGLE.description, stiffness=STIFFNESSES[model]))
    depth = 0.02
    gains, plain = [], []
    for diameter in DIAMETERS:
        cylinder = pressed(depth, diameter)
        without = analyze_grasp(robot.home, cylinder).normal_forces.sum() / depth
        with_gas = analyze_grasp(robot.home, cylinder, gas=True).normal_forces.sum() / depth
        plain.append(without)
        gains.append(with_gas / without - 1.0)
    assert 0.0 < gains[0] < gains[1] < gains[2]
    # As in the paper, the model without gas hardly sees the diameter.
    assert max(plain) / min(plain) < 1.01
    if model == 'power_law':
        # Stiffness goes as the pressure there, so that the gain is that of the pressure.
        rise = analyze_grasp(robot.home, pressed(depth, DIAMETERS[2]), gas=True).pressures['main']
        assert gains[2] == pytest.approx(rise / PRESSURE - 1.0, rel=0.5)


def test_only_the_tubes_that_are_indented_are_compressed():
    robot = load_robot('nine_member')
    x, y = robot.home.nodes[robot.node_names.index('north/Z/B')]
    analysis = analyze_grasp(robot.home, Cylinder((x - 0.3, y - 0.3), 0.3), gas=True)
    pressures = analysis.pressures
    touched = {name.split('/')[0] for name in analysis.contact_lengths}
    assert touched
    for tube, pressure in pressures.items():
        assert (pressure > PRESSURE) == (tube in touched)


def test_an_object_that_leaves_no_volume_is_refused():
    with pytest.raises(StructureError, match=r'tube main: the object would take .* m\^3'):
        analyze_grasp(TRIANGLE.home, Cylinder((0.51, 0.3), 20.0), gas=True, spacing=0.05)
