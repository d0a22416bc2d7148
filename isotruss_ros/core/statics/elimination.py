# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Block elimination of the matrix of (4): tubes are condensed to the hinges between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.factorization import (
    count_negative_pivots,
    Factor,
    factorize,
    factorize_with_condition,
)
from isotruss_ros.core.statics.frame_pattern import FramePattern
import numpy as np
from scipy.sparse import csc_matrix


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
        """
        Return the scaling that makes the diagonal of displacements and the constraints' norms 1.
        """
        (first, second), size = pattern.entries, len(pattern.free)
        stiff = first == second
        diagonal = np.bincount(first[stiff], entries[stiff], size)
        count = len(pattern.free) - pattern.rows
        # Equal scales for both directions of a node: across a bar the stiffness is a rounding
        # error.
        diagonal[0:count:3] = diagonal[1:count:3] = np.maximum(
            diagonal[0:count:3], diagonal[1:count:3]
        )
        positive = (diagonal > 0.0) & pattern.free
        scale = np.where(positive, diagonal, diagonal.max(initial=0.0, where=positive) or 1.0)
        scale = pattern.free / np.sqrt(scale)
        bound = (first >= count) & (second < count)
        norms = np.bincount(first[bound], (entries[bound] * scale[second[bound]]) ** 2, size)
        norms = norms[count:]
        scale[count:] = 1.0 / np.sqrt(np.where(norms > 0.0, norms, 1.0))
        return cls(pattern, scale, scale[first] * scale[second])

    def eliminate(self, entries: Array, right: Array) -> tuple[Elimination, Array]:
        """Eliminate the blocks of a frame, and solve for the changes of all unknowns."""
        pattern, right = self.pattern, right * self.scale[:, None]
        values = np.bincount(pattern.slots, entries * self.weight, pattern.size)
        if len(pattern.units):
            values[pattern.units] = 1.0
        stiffness, spreads, fill, insides, pushed = [], [], [], [], []
        for inner, outer, part in pattern.blocks:
            (count, size), width = inner.shape, outer.shape[1]
            whole = values[part].reshape(count, size, size + width)
            stiff, coupling = whole[..., :size], whole[..., size:]
            # The product of an inverse and the coupling would have a larger rounding error.
            found = np.linalg.solve(stiff, np.concatenate([coupling, right[inner]], axis=2))
            carried = coupling.swapaxes(1, 2) @ found
            stiffness.append(stiff)
            spreads.append(found[..., :width])
            insides.append(found[..., width:])
            fill.append(carried[..., :width].ravel())
            pushed.append(carried[..., width:].reshape(outer.size, -1))
        joints = values[pattern.blocks[-1].part.stop if fill else 0 : -1]
        if fill:
            joints = joints - np.bincount(pattern.fill, np.concatenate(fill), len(joints) + 1)[:-1]
        size = len(pattern.joints)
        if pattern.sparse is None:
            matrix = joints.reshape(size, size)
        else:
            matrix = csc_matrix((joints, *pattern.sparse), shape=(size, size))
        found = Elimination(self, stiffness, spreads, matrix, factorize(matrix.copy()))
        return found, found.complete(right, insides, pushed)


@dataclass(frozen=True, eq=False)
class Elimination:
    """Matrix of (4), scaled, with eliminated blocks; see `FramePattern.blocks` for the groups."""

    scaling: Scaling  #: numbering and scaling of the unknowns
    stiffness: list[Array]  #: for each group, (b, s, s) matrix of the blocks
    spreads: list[Array]  #: for each group, (b, s, t) inverse times coupling to the joints
    matrix: Array | csc_matrix  #: (j, j) Schur complement, the matrix of the joints
    joints: Factor  #: its factorisation

    @cached_property
    def inverses(self) -> list[Array]:
        """Return for each group the inverses (b, s, s) of the blocks."""
        return [np.linalg.inv(each) for each in self.stiffness]

    def solve(self, right: Array) -> Array:
        """
        Return the changes (u, p) of all unknowns due to p right-hand sides (u, p) of (4).

        Entries of displacements that supports fix are ignored; the result is zero there.
        """
        right, insides, pushed = right * self.scaling.scale[:, None], [], []
        groups = zip(self.scaling.pattern.blocks, self.inverses, self.spreads, strict=True)
        for (inner, outer, _), inverse, spread in groups:
            push = right[inner]
            insides.append(inverse @ push)
            pushed.append((spread.swapaxes(1, 2) @ push).reshape(outer.size, -1))
        return self.complete(right, insides, pushed)

    def complete(self, right: Array, insides: list[Array], pushed: list[Array]) -> Array:
        """Return the changes (u, p) of all unknowns from those of blocks with fixed joints."""
        pattern, loads = self.scaling.pattern, right[self.scaling.pattern.joints]
        if pushed:
            loads -= pattern.sources @ (pushed[0] if len(pushed) == 1 else np.concatenate(pushed))
        found, moved = np.zeros(right.shape), np.zeros((len(loads) + 1, loads.shape[1]))
        found[pattern.joints] = moved[:-1] = self.joints.solve(loads)
        for (inner, outer, _), spread, inside in zip(
            pattern.blocks, self.spreads, insides, strict=True
        ):
            found[inner] = inside - spread @ moved[outer]
        found *= self.scaling.scale[:, None]
        return found

    @property
    def condition(self) -> float:
        """Return the largest condition number of the blocks and of the joints' matrix [-]."""
        norms = [
            np.abs(each).sum(axis=1).max(axis=1) * np.abs(other).sum(axis=1).max(axis=1)
            for each, other in zip(self.stiffness, self.inverses, strict=True)
        ]
        _, condition = factorize_with_condition(self.matrix)
        return max([condition, *(float(each.max()) for each in norms)])

    @property
    def negative_pivots(self) -> int:
        """Return the negative pivots of the whole matrix: the sum over its blocks (Haynsworth)."""
        pattern = self.scaling.pattern
        last = int(np.count_nonzero(pattern.joints >= len(pattern.free) - pattern.rows))
        return count_negative_pivots(self.matrix, last) + sum(
            count_negative_pivots(each, 0) for group in self.stiffness for each in group
        )
