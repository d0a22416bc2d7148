# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frame of a robot, and points on its tubes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
import copy
from dataclasses import replace
import functools
from typing import Any, NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.samples import pick, SampledValues, take
from isotruss_ros.core.statics.blocks import Bisections, Condensed, Layout, Numbering
from isotruss_ros.core.statics.frame import Frame, keep_apart
from isotruss_ros.core.statics.tangent import linearize, solve_unloaded, Tangent
from isotruss_ros.core.statics.tube_stiffness import (
    Pressure,
    tube_pressures,
    tube_stiffness,
    TubeSections,
)
from isotruss_ros.core.statics.unloaded_blocks import UnloadedBlocks
import numpy as np

# Frame of the robot: members of each module (Fig. 1b), tubes, and bisection constraints (3).
#
# A module's triangle ABC is rigid. The tube leaves the module from C through the guide ring E, and
# from B through the guide ring D. The rings are on arms that rotate about B and C and are coupled
# by (3). A ring holds the tube in the transverse direction only. Constraints have multipliers, so
# the matrix of (4) is symmetric.


class FrameLayout(NamedTuple):
    """Properties of a robot's frame that do not depend on the configuration."""

    tube: TubeSections  #: stiffness of the tube
    numbering: Numbering  #: connections of the frame, see `Structure`
    #: (3, m) tube pieces among the members: BD and CE of each module, and DE' of each member
    pieces: Indices
    owners: Indices  #: (3, m) index of the robot's member to which each piece belongs


@functools.lru_cache(maxsize=16)
def frame_layout(robot: Mechanism) -> FrameLayout:
    """Return the layout of a robot's frame, cached."""
    topology = robot.topology
    m, joints = topology.n_modules, len(topology.joint_names)
    a, b = topology.joint, joints + 4 * np.arange(m)
    c, d, e = b + 1, b + 2, b + 3
    module_nodes = [f'{module}/{node}' for module in topology.module_names for node in 'BCDE']
    held = np.zeros((joints + 4 * m, 3), dtype=bool)
    held[np.divmod(topology.grounded, 2)] = True  # coordinate 2 i is x of node i, 2 i + 1 is y
    # AB, AC, BC, BD, CE and DE' of all modules.
    numbering = Numbering(
        names=(*topology.joint_names, *module_nodes),
        start=np.concatenate([a, a, b, b, c, d]),
        end=np.concatenate([b, c, c, d, e, e[topology.following]]),
        pinned=np.repeat([True, True, False, True, True, False], m),
        held=held,
        constraints=Bisections(np.stack([a, b, c, d, e], axis=1)),  # (3)
    )
    # BD, CE and DE' are pieces of tubes; C and E are on the member of the previous module.
    pieces, modules = np.arange(3 * m, 6 * m).reshape(3, -1), np.arange(m)
    owners = np.stack([modules, topology.previous, modules])
    return FrameLayout(tube_stiffness(robot.description), numbering, pieces, owners)


class ConfigurationSamples(SampledValues):
    """Configurations of one robot, whose arrays are joined along a first axis."""

    sampled = 'points', 'roller_positions', 'member_lengths', 'member_axes'
    points: Any
    roller_positions: Any
    member_lengths: Any
    member_axes: Any

    def __init__(self, configs: Sequence[Configuration]) -> None:
        super().__init__(configs)
        self.configs, self.robot = list(configs), configs[0].robot

    def chosen(self, indices: Indices) -> ConfigurationSamples:
        """Return some of the configurations, by their indices (q,)."""
        taken = super().chosen(indices)
        taken.configs = [self.configs[i] for i in indices.tolist()]
        return taken


class Structure:
    """
    Structural model of a robot in one configuration: a frame of members and nodes.

    The first nodes are the joints, followed by B, C, D, E of each module. For m modules the frame
    has 6 m members, m of each kind in this order: sides AB, AC and BC, tube pieces BD and CE, and
    long tube pieces DE' to the ring E' of the following module. `pressures` (t,) are the gauge
    pressures of the tubes [Pa], `stiffness` is a factor on EA, EI and GA of the tubes [-]; for
    `pieces` and `owners` see `FrameLayout`.

    The structures of n samples are one, with `ConfigurationSamples`, pressures (n, t) and
    stiffness (n,).
    """

    def __init__(
        self,
        config: Any,
        pressures: Any,
        stiffness: Any = 1.0,
    ) -> None:
        self.config, self.pressures, self.stiffness = config, pressures, stiffness
        self.tube, numbering, self.pieces, self.owners = frame_layout(config.robot)
        self.node_names = numbering.names
        topology, module = config.robot.topology, config.robot.description.module
        joints, lengths = len(topology.joint_names), config.member_lengths
        to_ring, lead = module.guide_ring_distance * config.member_axes, lengths.shape[:-1]
        points = np.empty((*lead, len(numbering.names)), dtype=np.complex128)
        points[..., :joints] = config.points[..., :joints]
        # The pieces BD, CE and DE' start at B, C and D.
        (b, c, d), e = numbering.start[self.pieces], numbering.end[self.pieces[1]]
        points[..., b] = config.points[..., topology.b]
        points[..., c] = config.points[..., topology.c]
        points[..., d] = points[..., b] + to_ring
        points[..., e] = points[..., c] - to_ring[..., topology.previous]
        # Section stiffness belongs to whole members, pinch to pinch; their pieces inherit it.
        gauge = np.asarray(pressures)[..., topology.tube]
        flat = np.array(self.tube.section_stiffness(lengths.ravel(), gauge.ravel()))
        of_members = flat.reshape(3, *lengths.shape) * np.asarray(stiffness)[..., None]
        # Axes: EA, EI and GA; three sides of the modules, then three kinds of pieces; module.
        sections = np.empty((*lead, 3, 6, topology.n_modules))
        sections[..., 0, :3, :] = module.axial_rigidity
        sections[..., 1, :3, :] = module.flexural_rigidity
        sections[..., 2, :3, :] = np.inf
        for quantity, values in enumerate(of_members):
            sections[..., quantity, 3:, :] = values[..., self.owners]
        self.frame = Frame.of(points, sections.reshape(*lead, 3, -1), numbering)

    def take_samples(self, index: Any) -> Structure:
        """Return the structures of chosen samples, or of one, see `samples.take`."""
        changed, chosen = copy.copy(self), np.arange(len(self.stiffness))[index]
        changed.frame, blocks = take((self.frame, vars(self).get('blocks')), index)
        changed.pressures, changed.stiffness = self.pressures[index], self.stiffness[index]
        if chosen.ndim:
            changed.config = self.config.chosen(chosen)
        else:
            changed.config = self.config.configs[chosen]
        for name in ('straight', 'unloaded', 'blocks', '_kept'):
            changed.__dict__.pop(name, None)
        if blocks is not None:
            changed.__dict__['blocks'] = blocks
        return changed

    @functools.cached_property
    def straight(self) -> Tangent:
        """Return the frame linearised without loads; it may be a mechanism."""
        return linearize(self.frame, np.zeros(self.frame.scale.shape))

    @functools.cached_property
    def unloaded(self) -> tuple[Tangent, Condensed]:
        """Return the frame linearised without loads, and its condensed matrix."""
        no_loads = np.zeros((3 * self.frame.points.shape[-1], 0))
        condensed, _ = solve_unloaded(self.straight, no_loads)
        return self.straight, condensed

    @functools.cached_property
    def blocks(self) -> list[UnloadedBlocks | None]:
        """Return the unloaded blocks of each group; None for blocks without own unknowns."""
        _, condensed = self.unloaded
        groups = self.frame.layout.groups, condensed.schur, condensed.spread
        return [
            UnloadedBlocks.of(self.frame, group, schur, spread) if spread.size else None
            for group, schur, spread in zip(*groups, strict=True)
        ]

    def kept_blocks(self, layout: Layout) -> list[UnloadedBlocks]:
        """Return the unloaded blocks that a layout keeps undeformed."""
        if not layout.kept:
            return []
        known = self.__dict__.setdefault('_kept', {})
        if layout.key not in known:
            known[layout.key] = [self.blocks[i].chosen(blocks) for i, blocks in layout.kept]
        return known[layout.key]

    @property
    def tube_radius(self) -> float:
        """Return the radius of the tubes [m]."""
        return 0.5 * self.config.robot.description.tube_diameter

    @property
    def ring_nodes(self) -> Indices:
        """Return the indices of the nodes at the guide rings."""
        return self.frame.layout.numbering.end[self.pieces[:2]]

    def nearest_rings(self, members: Indices, positions: Array) -> Array:
        """Return the positions (c,) of the guide rings nearest to positions in members [m]."""
        ring = self.config.robot.description.module.guide_ring_distance
        lengths = self.config.member_lengths[..., members]
        return np.where(positions < 0.5 * lengths, ring, lengths - ring)

    def tube_parts(self, frame: Frame) -> tuple[Indices, Indices]:
        """Return the indices of a frame's parts that are tubes, and the robot's member of each."""
        pieces, first_piece = frame.layout.whole, self.pieces[0, 0]
        parts = np.flatnonzero(pieces >= first_piece)
        return parts, self.owners.ravel()[pieces[parts] - first_piece]

    def node(self, name: str) -> int:
        """Return the index of a node among the frame's nodes."""
        if name not in self.node_names:
            raise StructureError(
                f'node {name!r}: robot {self.config.robot.name} has no such node; '
                'nodes are joints j, and t/j/B, t/j/C, t/j/D, t/j/E of each module'
            )
        return self.node_names.index(name)

    def locate(self, members: Indices, positions: Array) -> tuple[Indices, Array, Array]:
        """Return pieces at positions [m], distances in them, and -1 for pieces that run back."""
        ring = self.config.robot.description.module.guide_ring_distance
        to_end = self.config.member_lengths[..., members] - positions
        on_start = positions < ring  # on BD
        on_end = ~on_start & (to_end <= ring)  # on CE
        kind = np.where(on_start, 0, np.where(on_end, 1, 2))
        module = np.where(on_end, self.config.robot.topology.following[members], members)
        within = np.where(on_start, positions, np.where(on_end, to_end, positions - ring))
        return self.pieces[kind, module], within, np.where(on_end, -1.0, 1.0)


def structure_of(
    config: Configuration, pressure: Pressure | None = None, stiffness: float = 1.0
) -> Structure:
    """Return the structural model, cached; for `pressure` see `tube_pressures`."""
    return structure_under(config, tube_pressures(config.robot.description, pressure), stiffness)


def structures_under(
    configs: Sequence[Configuration],
    pressures: Sequence[tuple[float, ...]],
    stiffness: Sequence[float],
    deforms: bool = True,
) -> Structure:
    """Return the structural models of samples; `deforms` as in `BentState.straight`."""
    first = configs[0], pressures[0], stiffness[0]
    others = zip(configs[1:], pressures[1:], stiffness[1:], strict=True)
    if not all(c is first[0] and p == first[1] and k == first[2] for c, p, k in others):
        return Structure(ConfigurationSamples(configs), np.array(pressures), np.array(stiffness))
    one = _sample_under(*first)
    if len(configs) == 1:
        return one
    if not deforms:
        _ = one.blocks  # computed once, not for each sample
    return take(one, np.zeros(len(configs), dtype=int))


@functools.lru_cache(maxsize=8)
def _sample_under(
    config: Configuration, pressures: tuple[float, ...], stiffness: float
) -> Structure:
    """Return the structural model of one sample, cached."""
    values = np.array([pressures]), np.array([stiffness])
    return Structure(ConfigurationSamples([config]), *values)


#: Returns the structural model for a configuration, tube pressures (t,) [Pa], and a factor on the
#: stiffness of the tubes [-], cached.
structure_under = functools.lru_cache(maxsize=8)(Structure)


def section_rates(
    structure: Structure,
    frame: Frame,
    node_rates: Points,
    pressure_rates: Array,
    stiffness_rates: Array,
) -> Array:
    """
    Return changes (4, c, p) of rest length, EA, EI and GA.

    They follow from changes of the nodes' positions (n, p), of the pressures (t, p), and of the
    factor on the stiffness of the tubes (p,).
    """
    config, topology = structure.config, structure.config.robot.topology
    spans = node_rates[topology.end] - node_rates[topology.b]
    elongations = (spans * config.member_axes[:, None].conj()).real
    pressures = np.array(structure.pressures)[topology.tube]
    tube = replace(structure.tube, scale=structure.stiffness * structure.tube.scale)
    by_length, by_pressure = tube.flexibility_rates(config.member_lengths, pressures)
    flexibility_rates = by_length[:, :, None] * elongations
    flexibility_rates += by_pressure[:, :, None] * pressure_rates[topology.tube]
    layout, (parts, owner) = frame.layout, structure.tube_parts(frame)
    rates = np.zeros((4, len(frame.length), node_rates.shape[1]))
    sections = frame.section[:, parts, None]
    rates[1:, parts] = -(sections**2) * flexibility_rates[:, owner]
    rates[1:, parts] += sections * stiffness_rates / structure.stiffness
    # If a member becomes longer, both nodes of its last piece (CE, from pinch point to ring) shift
    # along it; this piece runs backward. Other nodes and cuts are fixed.
    last_pieces = structure.pieces[1]
    shifts = np.zeros((len(frame.points), node_rates.shape[1]))
    shifts[layout.numbering.start[last_pieces]] = elongations[topology.previous]
    shifts[layout.numbering.end[last_pieces]] = elongations[topology.previous]
    directions = np.where(np.isin(layout.whole[parts], last_pieces), -1.0, 1.0)
    relative_shifts = shifts[layout.end[parts]] - shifts[layout.start[parts]]
    rates[0, parts] = directions[:, None] * relative_shifts
    return rates


# Inclinations of bent centre lines at k load points.
#
# A centre line has a kink at a transverse force; at a load point, the mean of the inclinations on
# both sides is used. A guide ring exerts a transverse force, too, so this mean changes by the kink
# of the ring when a load point crosses it. The change is distributed over the width of the ring.
# With a jump there may be no equilibrium: a contact before the ring rolls forward, behind it back.

#: Half of the width of a guide ring [m]. Nearer contacts have other inclinations: those at both
#: ends of the width differ by up to 0.01 rad. With a third and with three times of it, two
#: families of grasps that had holes have an equilibrium at each of 51 stiffnesses.
RING_HALF_WIDTH = 1e-4


class InclinationWeights(NamedTuple):
    """
    Inclinations at k load points as weighted sums of those at q ends of a frame's parts.

    Of several samples, weights that are not equal have the samples as their first axis.
    """

    parts: Indices  #: (q,) parts of the frame
    signs: Array  #: (q,) 1 for the start of the part, -1 for its end
    weights: Array  #: (k, q) weights [-]
    #: (k, q) derivatives of the weights by the length of the part between load point and ring
    by_length: Array
    between: Indices  #: (k,) this part; any part where `by_length` is zero

    @property
    def is_at_ring(self) -> bool:
        """Return whether a load point is within the width of a ring."""
        return len(self.parts) > 2 * len(self.between)

    @classmethod
    def of(cls, structure: Structure, frame: Frame) -> InclinationWeights:
        """Return the weights at the cuts of a frame; all samples have the same cuts at rings."""
        layout, lead = frame.layout, frame.length.shape[:-1]
        parts, signs, count = layout.beside, layout.signs, len(layout.before)
        weights, by_length, between = layout.mean_weights, layout.no_weights, layout.before
        lengths = frame.length.reshape(-1, frame.length.shape[-1])[0, parts]
        if lengths.min(initial=np.inf) >= RING_HALF_WIDTH:
            return cls(parts, signs, weights, by_length, between)
        shape = (*lead, *weights.shape)
        weights, by_length = np.broadcast_to(weights, shape), np.broadcast_to(by_length, shape)
        between = between.copy()
        for near in np.flatnonzero(lengths < RING_HALF_WIDTH).tolist():
            part, point = int(parts[near]), near % count
            node = (layout.start if near < count else layout.end)[part]
            if node not in structure.ring_nodes:
                continue
            # The kink is the inclination beyond the ring minus that between ring and load point.
            at_node = np.flatnonzero((layout.start == node) | (layout.end == node))
            at_ends = np.append(at_node[at_node != part], part)
            parts = np.append(parts, at_ends)
            signs = np.append(signs, np.where(layout.start[at_ends] == node, 1.0, -1.0))
            kink = np.zeros((*lead, count, 2))
            kink[..., point, :] = 1.0, -1.0
            share = 0.5 * (1.0 - frame.length[..., part] / RING_HALF_WIDTH)
            weights = np.concatenate([weights, share[..., None, None] * kink], axis=-1)
            by_length = np.concatenate([by_length, -0.5 / RING_HALF_WIDTH * kink], axis=-1)
            between[point] = part
        return cls(parts, signs, weights, by_length, between)


# Load points on tubes: members, nodes at the load points, and samples divided alike.
#
# Each load point is a node that divides its member into parts; its place is its distance from the
# start of the member.


class Lines(NamedTuple):
    """Members of k load points: start x + iy [m], unit vector to the end x + iy, length [m]."""

    start: Points
    axis: Points
    length: Array
    turns: Array  #: (k, 3, 3) unit loads and displacements of the member's axes as (fx, fy, m)

    @classmethod
    def of(cls, structure: Structure, members: Indices) -> Lines:
        """Return the members with given indices (k,), from pinch point to pinch point."""
        config, topology = structure.config, structure.config.robot.topology
        start, axis = config.points[..., topology.b[members]], config.member_axes[..., members]
        turns = np.zeros((*axis.shape, 3, 3))
        turns[..., 0, 0] = turns[..., 1, 1] = axis.real
        turns[..., 1, 0], turns[..., 0, 1], turns[..., 2, 2] = axis.imag, -axis.imag, 1.0
        return cls(start, axis, config.member_lengths[..., members], turns)


class Cuts(NamedTuple):
    """Nodes of a frame at k load points, no two of them nearer than the shortest part."""

    pieces: Indices  #: (k,) members of the frame that the nodes divide
    within: Array  #: (k,) distances of the nodes from the starts of these members [m]
    directions: Array  #: (k,) 1 for a piece that runs along its member of the robot, else -1
    places: Array  #: (k,) distances of the nodes from the starts of the robot's members [m]

    @classmethod
    def of(cls, structure: Structure, members: Indices, positions: Array) -> Cuts:
        """Return the nodes at positions (k,) on members (k,) of the robot."""
        pieces, within, directions = structure.locate(members, positions)
        lengths = pick(structure.frame.length, pieces)
        inside = keep_apart(pieces, within, lengths)
        return cls(pieces, inside, directions, positions + directions * (inside - within))


def group_samples(
    structure: Structure, cuts: Cuts, chosen: Flags | None = None
) -> Sequence[Indices | None]:
    """
    Return the chosen samples, or all, in groups with equal layouts of cuts.

    None are all samples, or the only one.
    """
    if cuts.pieces.ndim == 1 or len(cuts.pieces) == 1:
        return [None]
    order = np.lexsort((cuts.within, cuts.pieces), axis=-1)
    rows = np.concatenate([cuts.pieces, order, are_at_rings(structure, cuts)], axis=-1)
    numbers = range(len(rows)) if chosen is None else np.flatnonzero(chosen).tolist()
    groups = defaultdict[bytes, list[int]](list)
    for i in numbers:
        groups[rows[i].tobytes()].append(i)
    return [None if len(group) == len(rows) else np.array(group) for group in groups.values()]


def are_at_rings(structure: Structure, cuts: Cuts) -> Flags:
    """Return whether cuts are at the start and at the end (..., 2k) of their piece."""
    lengths = pick(structure.frame.length, cuts.pieces)
    ends = np.concatenate([cuts.within, lengths - cuts.within], axis=-1)
    return ends < RING_HALF_WIDTH
