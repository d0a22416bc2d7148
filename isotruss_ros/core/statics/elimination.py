# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scaled and factorised matrix of (4): tubes are condensed to the hinges between them."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.block_matrix import FactoredBlocks
from isotruss_ros.core.statics.frame_pattern import FramePattern
import numpy as np


class Scaling(NamedTuple):
    """
    Numbering and scaling of the matrix of (4).

    Scaled, displacements and rotations, soft tubes and stiff modules have stiffness 1.
    """

    pattern: FramePattern  #: numbering of the unknowns
    scale: Array  #: (u,) scale of each unknown; 0 for displacements that are fixed
    weight: Array  #: scale of each of `FramePattern.entries`

    @classmethod
    def of(cls, pattern: FramePattern, entries: Array) -> Scaling:
        """Return the scaling by which the diagonal and the norms of the constraints are 1."""
        (first, second), size = pattern.entries, len(pattern.unknowns.free)
        stiff = first == second
        diagonal = np.bincount(first[stiff], entries[stiff], size)
        count = size - np.count_nonzero(pattern.unknowns.multiplier)
        # Equal scales for both directions of a node: across a bar the stiffness is a rounding
        # error.
        diagonal[0:count:3] = diagonal[1:count:3] = np.maximum(
            diagonal[0:count:3], diagonal[1:count:3]
        )
        positive = (diagonal > 0.0) & pattern.unknowns.free
        scale = np.where(positive, diagonal, diagonal.max(initial=0.0, where=positive) or 1.0)
        scale = pattern.unknowns.free / np.sqrt(scale)
        bound = (first >= count) & (second < count)
        norms = np.bincount(first[bound], (entries[bound] * scale[second[bound]]) ** 2, size)
        norms = norms[count:]
        scale[count:] = 1.0 / np.sqrt(np.where(norms > 0.0, norms, 1.0))
        return cls(pattern, scale, scale[first] * scale[second])

    def eliminate(self, entries: Array, right: Array) -> tuple[Elimination, Array]:
        """Factorise the matrix of (4), and return the changes (u, p) of all unknowns."""
        scale = self.scale[:, None]
        factored, found = self.pattern.matrix.eliminate(entries * self.weight, right * scale)
        return Elimination(self, factored), found * scale


class Elimination(NamedTuple):
    """Factorised matrix of (4)."""

    scaling: Scaling
    factored: FactoredBlocks  #: scaled

    def solve(self, right: Array) -> Array:
        """
        Return the changes (u, p) of all unknowns due to p right-hand sides (u, p) of (4).

        Entries of displacements that supports fix are ignored; the result is zero there.
        """
        scale = self.scaling.scale[:, None]
        return self.factored.solve(right * scale) * scale
