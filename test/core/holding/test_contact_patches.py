# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact patches of a held object: forces from pressures, wall tension, and known limits."""

from held_grips import APART, BOX, HOME, NINE
from isotruss_ros.core import deform, Disc, Ellipse, place_between, settle_grasp
from isotruss_ros.core.holding.contact_patches import find_patches
import numpy as np
import pytest
from skin_depths import contact_loads

RADIUS = 0.5 * NINE.description.tube_diameter
GAUGE = 34500.0


def settled(shape, angle=0.4, depth=0.01):
    """Return an object that is pressed into two sides."""
    body = place_between(HOME, APART, shape, angle, depth).body
    return settle_grasp(HOME, body, 5.0, members=APART)


@pytest.mark.parametrize('shape', [Disc(0.4), Ellipse((0.25, 0.2)), BOX])
@pytest.mark.parametrize('angle', [0.0, 0.4])
def test_mean_pressure_times_area_is_the_normal_force(shape, angle):
    grasp = settled(shape, angle)
    for name, force in grasp.normal_forces.items():
        carried = grasp.contact_pressures[name] * grasp.contact_areas[name]
        assert carried == pytest.approx(force, rel=1e-9)
        assert GAUGE <= grasp.contact_pressures[name] <= grasp.peak_pressures[name]
        widest = grasp.contact_widths[name]
        assert widest <= np.pi * RADIUS
        assert grasp.contact_areas[name] <= widest * grasp.contact_lengths[name]
    if shape is not BOX:  # one dent on each member
        patches = grasp.equilibrium.patches
        assert np.ptp(patches.spans, axis=1) == pytest.approx(patches.lengths)


@pytest.mark.parametrize('depth', [0.004, 0.012])
def test_pressure_of_a_disc_is_gas_pressure_plus_wall_tension_over_its_radius(depth):
    grasp = settled(Disc(0.4), depth=depth)
    grip = grasp.equilibrium
    bent = deform(HOME, {}, tube_loads=contact_loads(grip))
    ends, layout = bent.state.end_forces, bent.frame.layout
    for number, name in enumerate(grip.member_names):
        before, behind = ends[layout.before[number]], ends[layout.behind[number]]
        # The moment at the contact compresses the wall on the object's side.
        moment = 0.5 * (abs(before[5]) + abs(behind[2]))
        pull = GAUGE * np.pi * RADIUS**2 - 2.0 / RADIUS * moment
        pull -= max(-before[3], behind[0])
        pressure = GAUGE + pull / (2.0 * np.pi * RADIUS) / 0.2
        assert grasp.contact_pressures[name] == pytest.approx(pressure, rel=2e-3)


def test_a_section_is_flat_where_the_contact_is_as_wide_as_half_of_the_circumference():
    grasp = settled(Disc(0.4))
    assert not grasp.flattened
    grip = grasp.equilibrium
    skins = grip.statics.dents.press(300.0 * grip.state.normal_forces, grip.angles)
    deep = find_patches(grip.contacts, grip.state, grip.statics.bent, skins)
    assert deep.flattened.all()
    assert deep.widths == pytest.approx(np.pi * RADIUS)
    assert deep.pressures.min() > GAUGE
