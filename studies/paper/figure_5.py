# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fig. 5: stiffness and limit load of the triangle in three shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
import math

from isotruss_ros.core import Configuration, load_robot, Robot
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.blocks import Numbering
from isotruss_ros.core.statics.frame import end_forces, Frame
from isotruss_ros.core.statics.structure import Structure, structure_of
from isotruss_ros.core.statics.tangent import (
    bend,
    follow_loads,
    LoadPath,
    solve,
    Tangent,
    unloaded,
)
from isotruss_ros.core.statics.tube_stiffness import tube_stiffness
from isotruss_ros.core.statics.wrinkling import find_utilisation
import numpy as np
import scipy
from studies.paper.item import Advance
from studies.paper.parameters import EDGES, PRESSURE

#: Fixed displacements (both base modules at A, and the top on its track), and the joint that is
#: pushed down.
PINNED, PUSHED = (('L', 0), ('L', 1), ('R', 0), ('R', 1), ('T', 0)), 'T'
#: Number of iterations for the edges [-]; each reduces the error at least to a sixth.
PASSES = 6
#: Force above all limit loads [N].
MOST = 500.0
#: Displacement at which the curves end [m], a tenth of a side.
FARTHEST = 0.1


@dataclass(frozen=True)
class Shape:
    """
    One of the three triangles under load.

    :ivar config: configuration of the triangle.
    :ivar edges: lengths of the two equal members and of the third, pinch point to pinch point [m].
    :ivar angle: angle of the legs with the ground [rad].
    :ivar stiffness: force over displacement of the top, for small displacements [N/m].
    :ivar truss: this stiffness for two hinged bars that have the axial stiffness of the legs
        [N/m].
    :ivar stretching: axial fraction of the strain energy; the rest is due to bending and shear
        [-].
    :ivar axial: compression of a leg over a small force on the top [-].
    :ivar moment: largest bending moment in a leg over a small force on the top [m].
    :ivar displacements: (s,) downward displacements of the top, up to the limit load [m].
    :ivar forces: (s,) forces on the top at these displacements [N].
    :ivar onset: displacement and force at which a tube begins to wrinkle [m, N].
    """

    config: Configuration
    edges: tuple[float, float]
    angle: float
    stiffness: float
    truss: float
    stretching: float
    axial: float
    moment: float
    displacements: Array
    forces: Array
    onset: tuple[float, float]

    @property
    def excess(self) -> float:
        """Return the relative excess of the linear model's force at the onset of wrinkling [-]."""
        displacement, force = self.onset
        return self.stiffness * displacement / force - 1.0


def compute(advance: Advance) -> Mapping[str, Shape]:
    """Return all three shapes by name."""
    shapes = {}
    for name, edges in EDGES.items():
        shapes[name] = shape(edges)
        advance(len(shapes) / len(EDGES))
    return shapes


def triangle(edges: tuple[float, float]) -> Robot:
    """
    Return the preset `triangle` with other edges.

    :param edges: lengths of the two equal edges and of the third, joint to joint [m].
    """
    leg, base = edges
    height = math.sqrt(leg**2 - 0.25 * base**2)
    file = load_robot('triangle').description
    joints = {'L': (0.0, 0.0), 'R': (base, 0.0), 'T': (0.5 * base, height)}
    return Robot(replace(file, joints=joints, pressures={'main': PRESSURE}))


def between_joints(edges: tuple[float, float]) -> tuple[float, float]:
    """
    Return the edges from joint to joint of a triangle with given member lengths [m].

    :param edges: lengths of the two equal members and of the third, pinch point to pinch point
        [m].
    """
    goal = np.array(edges)
    found = goal
    # How much longer a member is than its edge hardly depends on the edges.
    for _ in range(PASSES):
        base, leg, _ = triangle(tuple(found.tolist())).home.member_lengths
        found = found + goal - (leg, base)
    return tuple(found.tolist())


def pinned_frame(config: Configuration) -> Frame:
    """
    Return the frame of a triangle with the supports of the test.

    :param config: configuration of the triangle.
    """
    structure = structure_of(config)
    held = np.zeros((len(structure.node_names), 3), dtype=bool)
    for joint, axis in PINNED:
        held[structure.node(joint), axis] = True
    free, layout = structure.frame, structure.frame.layout
    members = layout.start, layout.end, layout.pinned
    numbering = Numbering(structure.node_names, *members, held, layout.numbering.constraints)
    return Frame.of(free.points, free.section, numbering)


def find_onset(
    structure: Structure, frame: Frame, loads: Array, path: LoadPath
) -> tuple[Tangent, float]:
    """
    Return the state in which a tube begins to wrinkle, and the load factor of this state.

    :param structure: structure of the robot.
    :param frame: frame with the supports of the test.
    :param loads: (n, 3) loads that increase [N, N m].
    :param path: equilibria on both sides of the state.
    """

    def bend_by(factor: float) -> Tangent:
        before = path.tangents[max(np.searchsorted(path.factors, factor) - 1, 0)]
        found = bend(before, factor * loads)
        assert found is not None
        return found

    def reserve(factor: float) -> float:
        bent = bend_by(factor)
        pulls = bent.forces.values[:, 0]
        forces = end_forces(bent.forces.values, bent.length), pulls
        return 1.0 - float(find_utilisation(structure, frame, *forces).used.max())

    factor = scipy.optimize.brentq(reserve, 0.0, path.factors[-1])
    return bend_by(factor), factor


def shape(edges: tuple[float, float]) -> Shape:
    """
    Return one triangle with its stiffness, and its curve up to the limit load.

    :param edges: lengths of the two equal members and of the third, pinch point to pinch point
        [m].
    """
    robot = triangle(between_joints(edges))
    config, structure = robot.home, structure_of(robot.home)
    frame, top = pinned_frame(config), structure.node(PUSHED)
    loads = np.zeros((len(frame.points), 3))
    loads[top, 1] = -1.0
    rest = unloaded(frame)
    small = solve(rest, loads)
    give = -float(small.displacements[top, 1])
    tube = tube_stiffness(robot.description).section_stiffness(config.member_lengths, PRESSURE)
    ends = small.end_forces[structure.pieces[2]].reshape(-1, 2, 3)
    leg = robot.member_names.index('main/R-T')
    stiffness = float(tube.axial[leg] / config.member_lengths[leg])
    start, end = member_lines(config)[leg]
    angle = math.asin(abs((end - start).imag) / abs(end - start))
    path = follow_loads(rest, loads, MOST, FARTHEST)
    sunk = np.array([-each.displacements[top, 1] for each in path.tangents])
    forces = np.array(path.factors)
    wrinkling, force = find_onset(structure, frame, loads, path)
    onset = -float(wrinkling.displacements[top, 1]), force
    return Shape(
        config,
        edges,
        angle,
        1.0 / give,
        2.0 * stiffness * math.sin(angle) ** 2,
        float((small.end_forces[:, 3] ** 2 * frame.length / frame.section[0]).sum()) / give,
        float(ends[leg, 0, 0]),
        float(np.abs(ends[leg, :, 2]).max()),
        sunk,
        forces,
        onset,
    )
