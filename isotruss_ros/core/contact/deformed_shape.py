# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lines of a grasp for drawings: undeformed tubes, bent tubes, forces and contact regions."""

from __future__ import annotations

from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Points
import numpy as np

#: Number of points on each member from guide ring to guide ring [-].
POINTS_PER_MEMBER = 13


def deformed_lines(analysis: GraspAnalysis) -> Points:
    """
    Return points (m, s) on the members' centre lines under contact forces, between pinch points.

    :param analysis: analysis of a grasp.
    """
    structure = analysis.structure
    config = structure.config
    length, ring = config.member_lengths, config.robot.description.module.guide_ring_distance
    between = ring + (length - 2.0 * ring)[:, None] * np.linspace(0.0, 1.0, POINTS_PER_MEMBER)
    places = np.column_stack([np.zeros_like(length), between, length])
    drawn = np.repeat(np.arange(len(places)), places.shape[1])
    points, contact = analysis.solved.points, analysis.solved.contact
    moved = points.bent.tangent.displacements + points.move(contact.push)[0]
    piece, within, _ = structure.locate(drawn, places.ravel())
    frame, straight = points.bent.frame, structure.frame
    lines = straight.points[straight.members.start[piece]] + within * straight.axis[piece]
    lines += frame.interpolate(moved, piece, within)[:, :2] @ (1.0, 1j)
    return lines.reshape(places.shape)


def force_lines(body: ConvexObject, analysis: GraspAnalysis, scale: float) -> Points:
    """
    Return the tails and tips (k, 2) [m] of arrows for the contact forces on the object.

    :param body: the object.
    :param analysis: analysis of the grasp.
    :param scale: length of an arrow per force [m/N]; its tip is on the object's surface.
    """
    touching = analysis.normal_forces > 0.0
    normals = analysis.normals[touching] @ np.array([1.0, 1.0j])
    forces = 1j * analysis.friction_forces[touching] - analysis.normal_forces[touching]
    tips = _feet(body, analysis.points[touching] @ np.array([1.0, 1.0j]))
    return np.stack([tips - scale * forces * normals, tips], axis=1)


def region_lines(
    config: Configuration, body: ConvexObject, analysis: GraspAnalysis
) -> list[Points]:
    """
    Return each contact region as a line of k points (k,) on the object's surface [m].

    :param config: configuration of the robot.
    :param body: the object.
    :param analysis: analysis of the grasp in this configuration.
    :return: regions in the order of `GraspAnalysis.contact_spans`.
    """
    regions = []
    for name, (start, end) in analysis.contact_spans.items():
        here = np.flatnonzero(analysis.members == config.robot.member_names.index(name))
        places, points = analysis.places[here], analysis.points[here]
        inside = places[(places > start) & (places < end)]
        along = np.concatenate([[start], inside, [end]])
        met = np.interp(along, places, points[:, 0]) + 1j * np.interp(along, places, points[:, 1])
        regions.append(_feet(body, met))
    return regions


def _feet(body: ConvexObject, points: Points) -> Points:
    """Return the points (c,) of the object's surface nearest to given points [m]."""
    found = body.nearest(points)
    return points - found.gaps * found.normals
