# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fig. 5: how stiff the triangle is in three shapes, and where its tubes give way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
import math

from isotruss_ros.core import Configuration, deform, load_robot, Robot
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.statics.structure import Deformation
from isotruss_ros.core.statics.tube_stiffness import tube_stiffness
import numpy as np
from paper.item import Advance
from paper.parameters import EDGES, PRESSURE
from paper.wrinkling import (
    COLLAPSE,
    column_load,
    load_factor,
    ONSET,
    pressure_force,
    wrinkling_moment,
)

#: Where the top is pushed, down; and what the file of the robot leaves free and the test holds.
PUSHED, HELD = ('T', 1), (('R', 0), ('R', 1))
#: Each makes an error in the edges at least six times smaller.
PASSES = 6


@dataclass(frozen=True)
class Shape:
    """
    One of the three triangles, pushed.

    :ivar config: its configuration.
    :ivar edges: the two equal members and the third, pinch to pinch [m].
    :ivar angle: of the legs with the ground [rad].
    :ivar stiffness: force over displacement of the top [N/m].
    :ivar truss: the same of two bars along the legs with their axial stiffness [N/m].
    :ivar stretching: share of the strain energy that is axial, not bending or shear.
    :ivar geometry: secant over tangent stiffness of the two bars at `onset`.
    :ivar axial: compression of a leg over the force on the top.
    :ivar moment: largest bending moment in a leg over the force on the top [m].
    :ivar bare: displacement at which that moment is M_w, compression left aside [m].
    :ivar onset: displacement at which a tube begins to wrinkle [m].
    :ivar collapse: displacement at which a tube folds [m].
    """

    config: Configuration
    edges: tuple[float, float]
    angle: float
    stiffness: float
    truss: float
    stretching: float
    geometry: float
    axial: float
    moment: float
    bare: float
    onset: float
    collapse: float


def compute(advance: Advance) -> Mapping[str, Shape]:
    """Return all three shapes by name."""
    shapes = {}
    for name, edges in EDGES.items():
        shapes[name] = shape(edges)
        advance(len(shapes) / len(EDGES))
    return shapes


def triangle(edges: tuple[float, float]) -> Robot:
    """
    Return the preset `triangle` with other edges, its top on a vertical track.

    A robot file grounds three coordinates. Here these are those of the left base module and the
    track; those of the right base module are held by the loads in `push`.

    :param edges: the two equal ones and the third, joint to joint [m].
    """
    leg, base = edges
    height = math.sqrt(leg**2 - 0.25 * base**2)
    file = load_robot('triangle').description
    joints = {'L': (0.0, 0.0), 'R': (base, 0.0), 'T': (0.5 * base, height)}
    supports = {'L': ('x', 'y'), 'T': ('x',)}
    return Robot(replace(file, joints=joints, supports=supports, pressures={'main': PRESSURE}))


def between_joints(edges: tuple[float, float]) -> tuple[float, float]:
    """
    Return the edges, joint to joint, of a triangle whose members have given lengths [m].

    :param edges: the two equal members and the third, pinch to pinch [m].
    """
    goal = np.array(edges)
    found = goal
    # How much longer a member is than its edge hardly depends on the edges.
    for _ in range(PASSES):
        base, leg, _ = triangle(tuple(found.tolist())).home.member_lengths
        found = found + goal - (leg, base)
    return tuple(found.tolist())


def push(config: Configuration) -> tuple[float, Deformation]:
    """
    Push the top down by 1 N, both base modules pinned.

    :return: the displacement of the top, down [m], and all of the deformation.
    """
    places = (PUSHED, *HELD)
    compliance = np.zeros((3, 3))
    for column, (joint, axis) in enumerate(places):
        state = deform(config, {joint: np.eye(2)[axis]})
        compliance[:, column] = [state.displacement(name)[along] for name, along in places]
    # What the pins must do so that they do not move.
    pins = np.linalg.solve(compliance[1:, 1:], compliance[1:, 0])
    state = deform(config, {PUSHED[0]: (0.0, -1.0), HELD[0][0]: pins})
    return -float(state.displacement(PUSHED[0])[PUSHED[1]]), state


def shape(edges: tuple[float, float]) -> Shape:
    """
    Return one triangle with its stiffness and its limits.

    :param edges: the two equal members and the third, pinch to pinch [m].
    """
    robot = triangle(between_joints(edges))
    config, file = robot.home, robot.description
    give, state = push(config)
    radius = 0.5 * file.tube_diameter
    tube = tube_stiffness(file).section_stiffness(config.member_lengths, PRESSURE)
    columns = column_load(tube.flexural, tube.shear, config.member_lengths)
    forces = state.state.end_forces[state.structure.pieces[2]].reshape(-1, 2, 3)
    compression, moment = forces[:, 0, 0], np.abs(forces[:, :, 2]).max(axis=1)
    pull = pressure_force(PRESSURE, radius)
    onset, collapse = (
        give * float(load_factor(moment, compression, columns, pull, radius, stage).min())
        for stage in (ONSET, COLLAPSE)
    )
    leg = robot.member_names.index('main/R-T')
    stiffness = float(tube.axial[leg] / config.member_lengths[leg])
    start, end = member_lines(config)[leg]
    angle = math.asin(abs((end - start).imag) / abs(end - start))
    return Shape(
        config,
        edges,
        angle,
        1.0 / give,
        2.0 * stiffness * math.sin(angle) ** 2,
        _axial_energy(state) / (0.5 * give),
        _secant(edges[0], angle, onset),
        float(compression[leg]),
        float(moment[leg]),
        give * wrinkling_moment(PRESSURE, radius) / float(moment.max()),
        onset,
        collapse,
    )


def _axial_energy(state: Deformation) -> float:
    """Return the energy of the members' axial strain [J]."""
    frame = state.structure.frame
    span = frame.points[frame.members.end] - frame.points[frame.members.start]
    pull = state.state.end_forces[:, 3]
    return float(0.5 * (pull**2 * np.abs(span) / frame.members.axial).sum())


def _secant(leg: float, angle: float, displacement: float) -> float:
    """Return secant over tangent stiffness of two bars whose tip has moved down."""
    height = leg * math.sin(angle)
    short = math.hypot(leg * math.cos(angle), height - displacement)
    force = (leg - short) * (height - displacement) / short
    return force / displacement / math.sin(angle) ** 2
