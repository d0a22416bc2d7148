# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The lines that are drawn are those of the analysis."""

from types import SimpleNamespace

from isotruss_ros.core import analyze_grasp, ConvexObject, load_robot, tangent_center
from isotruss_ros.core.contact.contact_points import points_on_members
from isotruss_ros.core.contact.deformed_shape import deformed_lines, force_lines, region_lines
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
DIAMETER = 0.3


def grasp(config, squeeze, module='north/Z'):
    """Return the analysis of an object pressed into the corner of a module."""
    cylinder = ConvexObject.disc(tangent_center(config, module, DIAMETER, squeeze), DIAMETER)
    return analyze_grasp(config, cylinder, paper_model=True)


def distance(points, lines):
    """Return how far each point (k,) is from the nearest piece of any line."""
    start, step = lines[:, :-1].ravel(), np.diff(lines).ravel()
    start, step = start[step != 0.0], step[step != 0.0]
    part = ((points[:, None] - start) * step.conj()).real / np.abs(step) ** 2
    return np.abs(points[:, None] - start - np.clip(part, 0.0, 1.0) * step).min(axis=1)


@pytest.fixture(params=[0.0, 0.1], ids=['home', 'elsewhere'])
def config(request):
    """Return a configuration."""
    return ROBOT.configuration(request.param * np.linspace(-1.0, 1.0, len(ROBOT.roller_names)))


def test_shape_is_undeformed_without_contact(config):
    analysis = grasp(config, -0.01)
    lines, straight = deformed_lines(analysis), member_lines(config)
    assert lines[:, 0] == pytest.approx(straight[:, 0])
    assert lines[:, -1] == pytest.approx(straight[:, 1])
    assert distance(lines.ravel(), straight).max() < 1e-12
    ring = config.robot.description.module.guide_ring_distance
    steps = (config.member_lengths[:, None] - 2.0 * ring) / np.full(12, 12.0)
    assert np.abs(np.diff(lines))[:, 1:-1] == pytest.approx(steps)
    assert np.abs(np.diff(lines))[:, [0, -1]] == pytest.approx(ring)


@pytest.mark.parametrize('share', [0.02, 0.37, 0.98])
def test_drawn_lines_agree_with_member_displacements(config, share):
    # However small the force.
    number, force = 2, 0.05 * np.exp(0.7j)
    place, structure = share * config.member_lengths[number], structure_of(config, 2e4)
    points = points_on_members(BentTubes(structure, np.array([number]), np.array([place])), 1e-3)
    solved = SimpleNamespace(points=points, contact=SimpleNamespace(push=np.array([force])))
    analysis = SimpleNamespace(structure=structure, solved=solved)
    straight = member_lines(config)
    unloaded = deformed_lines(grasp(config, -0.01))
    for other, line in enumerate(deformed_lines(analysis)):
        # Without the ends of pieces: there members give as 1 mm beside them.
        for point, before in zip(line[2:-2], unloaded[other, 2:-2], strict=True):
            at = np.array([place, abs(before - straight[other, 0])])
            bent = BentTubes(structure, np.array([number, other]), at, linear=True)
            local = force * bent.axis[0].conj()
            found = bent.respond(np.array([[local.real, local.imag, 0.0], [0.0] * 3]), at)
            moved = bent.axis[1] * complex(found[1, 0], found[1, 1])
            assert point - before == pytest.approx(moved, rel=1e-5, abs=1e-11)


def test_force_arrows_end_on_the_object_and_sum_to_its_wrench(config):
    center = tangent_center(config, 'north/Z', DIAMETER, 0.01)
    cylinder = ConvexObject.disc(center, DIAMETER)
    analysis = analyze_grasp(config, cylinder, friction=0.0)
    arrows = force_lines(cylinder, analysis, 0.02)
    assert np.abs(arrows[:, 1] - complex(*center)) == pytest.approx(0.5 * DIAMETER)
    # Where the tubes touch it.
    touching = analysis.normal_forces > 0.0
    outward = analysis.normals[touching] @ np.array([1.0, 1.0j])
    assert arrows[:, 1] == pytest.approx(complex(*center) + 0.5 * DIAMETER * outward)
    resultant = np.diff(arrows).sum() / 0.02
    assert (resultant.real, resultant.imag) == pytest.approx(tuple(analysis.normal_wrench[:2]))
    rough = analyze_grasp(config, cylinder, friction=0.5)
    left = np.diff(force_lines(cylinder, rough, 1.0)).sum()
    assert abs(left) <= min(rough.closure_residual * (1.0 + 1e-9), 0.9 * abs(resultant))


@pytest.mark.parametrize('flattening', [True, False])
def test_regions_are_on_the_object_and_as_long_as_the_contact(config, flattening):
    cylinder = ConvexObject.disc(tangent_center(config, 'north/Z', DIAMETER, 0.01), DIAMETER)
    analysis = analyze_grasp(config, cylinder, paper_model=not flattening)
    regions = region_lines(config, cylinder, analysis)
    assert len(regions) == len(analysis.contact_lengths) == 2
    for region, length in zip(regions, analysis.contact_lengths.values(), strict=True):
        assert np.abs(region - cylinder.center) == pytest.approx(0.5 * DIAMETER)
        # Tubes that stay round are touched half their diameter farther out.
        share = 1.0 if flattening else DIAMETER / (DIAMETER + 0.102)
        assert np.abs(np.diff(region)).sum() == pytest.approx(share * length, rel=0.03)
