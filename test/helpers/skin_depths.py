# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Depths of a polygon's corners in the bent tubes, by `deform` under a grip's contact forces."""

from isotruss_ros.core import deform
import numpy as np
import robots

#: Points of the bent centre line beside the foot of a corner, in tube radii [-].
AROUND = np.array([-0.6, -0.3, -0.1, 0.0, 0.1, 0.3, 0.6])
#: Points on the arc of a rounded corner, as fractions of its angle [-].
ARC_POINTS = np.linspace(0.0, 1.0, 7)


def contact_loads(grip):
    """Return the forces of a grip on the tubes as loads of `deform`, (s, fx, fy, m) by member."""
    loads, axes = {}, grip.config.member_axes[grip.contacts.members]
    rows = zip(grip.contacts.members, grip.state.feet, grip.state.loads, axes, strict=True)
    for number, foot, (along, across, moment), axis in rows:
        force = complex(along, across) * axis
        row = np.array([force.real, force.imag, moment])
        loads.setdefault(grip.config.robot.member_names[number], []).append((foot, *row))
    return loads


def bent_line(grip, name, places):
    """Return the points (p,) of a member's bent centre line at distances from its start [m]."""
    loads = contact_loads(grip)
    loads.setdefault(name, []).extend((place, 0.0, 0.0, 0.0) for place in places)
    begin = sum(map(len, list(loads.values())[: list(loads).index(name)]))
    begin += len(loads[name]) - len(places)
    bent = deform(grip.config, {}, grip.pressures, tube_loads=loads)
    nodes = bent.frame.layout.nodes[begin + np.arange(len(places))]
    return bent.frame.points[nodes] + bent.state.displacements[nodes] @ (1.0, 1.0j, 0.0)


def corner_depths(grip, name):
    """Return the depths (c,) of corners in a bent member, minus infinity far from it [m]."""
    shape, body = grip.body.shape, grip.body
    radius = 0.5 * grip.config.robot.description.tube_diameter
    start, end = robots.member_ends(grip.config, name)
    axis = (end - start) / abs(end - start)
    turned = np.exp(1j * np.outer(shape.turns, ARC_POINTS))
    arcs = shape.arc_centers[:, None] + (shape.radii * np.roll(shape.normals, 1))[:, None] * turned
    local = (body.center + body.turn * arcs - start) / axis
    side = np.sign(((body.middle - start) / axis).imag)
    depths = np.full(local.shape, -np.inf)
    near = (side * local.imag < 3.0 * radius) & (local.real > 0.0)
    near &= local.real < abs(end - start)
    if near.any():
        places = (local.real[near][:, None] + radius * AROUND).ravel()
        ends = 1e-3 * radius
        places = np.unique(places.clip(ends, abs(end - start) - ends).round(6))
        line = (bent_line(grip, name, places) - start) / axis
        depths[near] = [radius - side * gap(point, line) for point in local[near]]
    return depths.max(axis=1)


def gap(point, line):
    """Return the distance of a point from a line of points, positive on the line's left [m]."""
    spans = np.diff(line)
    along = ((point - line[:-1]) / spans).real.clip(0.0, 1.0)
    away = (point - line[:-1] - along * spans) / (spans / np.abs(spans))
    nearest = away[np.abs(away).argmin()]
    return np.copysign(abs(nearest), nearest.imag)


def hidden_depth(grip):
    """Return how much deeper in a member a corner is than those that press there [m]."""
    worst = -np.inf
    for number, name in enumerate(grip.config.robot.member_names):
        depths, pressed = corner_depths(grip, name), grip.contacts.members == number
        corners = grip.contacts.corners[pressed]
        deepest = depths[corners].max() if len(corners) else 0.0
        depths[corners] = -np.inf
        worst = max(worst, depths.max() - deepest)
    return worst
