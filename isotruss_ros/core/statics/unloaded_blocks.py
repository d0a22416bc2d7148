# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Blocks of a frame without loads, such as the tubes of an isostatic robot that touch nothing.

These blocks are linear in axes that turn with their hinges, so their stiffness is computed once
for a configuration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.samples import apply
from isotruss_ros.core.statics.blocks import Group
from isotruss_ros.core.statics.frame import Frame
import numpy as np


@dataclass(frozen=True, eq=False)
class UnloadedBlocks:
    """Equal blocks that are loaded only at their hinges and hardly deform."""

    shared: ClassVar[tuple[str, ...]] = ('ids', 'outer', 'inner')
    ids: Indices  #: (b,) indices of the blocks
    outer: Indices  #: (b, t) unknowns of the hinges: x and y of each
    inner: Indices  #: (b, s) unknowns of the blocks: multipliers, then ux, uy, theta of each node
    hinges: Points  #: (b, t / 2) hinges relative to their mean [m]
    nodes: Points  #: (b, .) nodes of the blocks relative to this mean [m]
    stiffness: Array  #: (b, t, t) stiffness of the hinges
    #: (b, s, t) multipliers and displacements by unit displacements of the hinges
    spread: Array

    @classmethod
    def of(cls, frame: Frame, group: Group, schur: Array, spread: Array) -> UnloadedBlocks:
        """Return a group of blocks from its eliminated matrix, which is scaled."""
        # Unknowns x of the hinges, and ux of the nodes after the blocks' multipliers.
        multipliers, hinge_x = group.rows.shape[1], group.outer[:, ::2]
        node_x = group.inner[:, multipliers::3]
        hinges = frame.points[..., (hinge_x - frame.layout.numbering.rows) // 3]
        nodes = frame.points[..., (node_x - frame.layout.numbering.rows) // 3]
        middles = hinges.mean(axis=-1, keepdims=True)
        outer, inner = frame.scale[..., group.outer], frame.scale[..., group.inner]
        return cls(
            ids=group.ids,
            outer=group.outer,
            inner=group.inner,
            hinges=hinges - middles,
            nodes=nodes - middles,
            stiffness=schur / (outer[..., None] * outer[..., None, :]),
            spread=spread * inner[..., None] / outer[..., None, :],
        )

    def chosen(self, blocks: Indices) -> UnloadedBlocks:
        """Return some of the blocks, by their indices in this group."""
        return UnloadedBlocks(
            ids=self.ids[blocks],
            outer=self.outer[blocks],
            inner=self.inner[blocks],
            hinges=self.hinges.take(blocks, axis=-2),
            nodes=self.nodes.take(blocks, axis=-2),
            stiffness=self.stiffness.take(blocks, axis=-3),
            spread=self.spread.take(blocks, axis=-3),
        )

    def place(self, unknowns: Array) -> tuple[Points, Array]:
        """
        Return the rigid rotations exp(i angle) (b,) of the blocks, and the hinges' strains (b, t).

        The strains are the displacements of the hinges in axes that turn with their block [m].
        """
        displaced = self.hinges + _take_complex(unknowns, self.outer)
        displaced -= displaced.sum(axis=-1, keepdims=True) / displaced.shape[-1]
        rotation = (self.hinges.conj() * displaced).sum(axis=-1)
        rotation /= np.abs(rotation)
        strain = displaced * rotation.conj()[..., None] - self.hinges
        return rotation, strain.view(np.float64)

    def linearize(self, unknowns: Array) -> tuple[Array, Array]:
        """Return the forces (b, t) on the displaced hinges, and their stiffness (b, t, t)."""
        rotation, strain = self.place(unknowns)
        # Rotations from axes of the blocks to those of the frame.
        turns = np.empty((*rotation.shape, 1, 2, 2))
        turns[..., 0, 0, 0] = turns[..., 0, 1, 1] = rotation.real
        turns[..., 0, 1, 0], turns[..., 0, 0, 1] = rotation.imag, -rotation.imag
        shape, (*lead, rows, _) = self.stiffness.shape, self.stiffness.shape
        # Components x and y of each hinge are turned in the rows, and then in the columns.
        of_hinges = self.stiffness.reshape(*lead, -1, 2, rows)
        by_strain = (turns @ of_hinges).reshape(shape)
        turned = by_strain.reshape(*lead, rows, -1, 2) @ turns.swapaxes(-1, -2)
        return apply(by_strain, strain), turned.reshape(shape)

    def turn_motions(self, unknowns: Array, motions: Points) -> Array:
        """Return motions (b, t / 2, p) of the hinges at rest, x + iy, as unknowns (b, t, p)."""
        rotation, _ = self.place(unknowns)
        turned = rotation[:, None, None] * motions
        return np.stack([turned.real, turned.imag], axis=2).reshape(*self.outer.shape, -1)

    def complete(self, unknowns: Array) -> None:
        """Set the inner unknowns of the blocks, among all (u,), from the hinges' unknowns."""
        rotation, strain = self.place(unknowns)
        # Multipliers, then x, y and angle of each node in axes that turn with its block.
        values = (self.spread @ strain[..., None])[..., 0]
        multipliers = self.inner.shape[1] - 3 * self.nodes.shape[-1]
        x, y, angles = (slice(multipliers + i, None, 3) for i in range(3))
        # Displacements in the axes of the robot; multipliers do not depend on the axes.
        strained = self.nodes + values[..., x] + 1j * values[..., y]
        middle = _take_complex(unknowns, self.outer).mean(axis=-1)
        displacements = strained * rotation[..., None] - self.nodes + middle[..., None]
        values[..., x], values[..., y] = displacements.real, displacements.imag
        values[..., angles] += np.angle(rotation)[..., None]
        unknowns[..., self.inner] = values


def _take_complex(unknowns: Array, places: Indices) -> Points:
    """Return values x + iy (..., b, t / 2) among all (..., u), at places (b, t) of x and y."""
    return unknowns.take(places, axis=-1).view(np.complex128)
