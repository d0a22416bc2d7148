# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Block elimination of the matrix of (4): tubes are condensed to the hinges between them."""

from __future__ import annotations

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

    :ivar pattern: numbering of the unknowns.
    :ivar scale: (u,) scale of each unknown; 0 for displacements that are fixed.
    :ivar weight: scale of each of `FramePattern.entries`.
    """

    pattern: FramePattern
    scale: Array
    weight: Array

    @classmethod
    def of(cls, pattern: FramePattern, entries: Array) -> Scaling:
        """
        Return the scaling that makes the diagonal of displacements and the constraints' norms 1.

        :param entries: `FramePattern.entries` of the unloaded frame.
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

    def eliminate(self, entries: Array) -> Elimination:
        """
        Eliminate the blocks of a frame.

        :param entries: `FramePattern.entries` of the frame.
        :raises numpy.linalg.LinAlgError: a block or the joints' matrix is exactly singular.
        """
        pattern = self.pattern
        values = np.bincount(pattern.slots, entries * self.weight, pattern.size)
        values[pattern.units] = 1.0
        stiffness, inverses, spreads, fill = [], [], [], []
        for inner, outer, part in pattern.blocks:
            (count, size), width = inner.shape, outer.shape[1]
            whole = values[part].reshape(count, size, size + width)
            stiff, coupling = whole[..., :size], whole[..., size:]
            # The product of inverse and coupling would have a larger rounding error.
            right = np.broadcast_to(np.eye(size), stiff.shape)
            both = np.linalg.solve(stiff, np.concatenate([coupling, right], axis=2))
            spread, inverse = both[..., :width], both[..., width:]
            stiffness.append(stiff)
            inverses.append(inverse)
            spreads.append(spread)
            fill.append((coupling.swapaxes(1, 2) @ spread).ravel())
        begin = pattern.blocks[-1].part.stop if fill else 0
        joints = values[begin:-1]
        if fill:
            joints = joints - np.bincount(pattern.fill, np.concatenate(fill), len(joints) + 1)[:-1]
        size = len(pattern.joints)
        if pattern.sparse is None:
            matrix = joints.reshape(size, size)
        else:
            matrix = csc_matrix((joints, *pattern.sparse), shape=(size, size))
        return Elimination(self, stiffness, inverses, spreads, matrix, factorize(matrix.copy()))


class Elimination(NamedTuple):
    """
    Matrix of (4), scaled, with eliminated blocks; see `FramePattern.blocks` for the groups.

    :ivar scaling: numbering and scaling of the unknowns.
    :ivar stiffness: for each group, (b, s, s) matrix of the blocks.
    :ivar inverses: for each group, (b, s, s) inverse.
    :ivar spreads: for each group, (b, s, t) inverse times coupling to the joints.
    :ivar matrix: (j, j) Schur complement, the matrix of the joints.
    :ivar joints: its factorisation.
    """

    scaling: Scaling
    stiffness: list[Array]
    inverses: list[Array]
    spreads: list[Array]
    matrix: Array | csc_matrix
    joints: Factor

    def solve(self, right: Array) -> Array:
        """
        Return the changes (u, p) of all unknowns due to p right-hand sides (u, p) of (4).

        Entries of displacements that supports fix are ignored; the result is zero there.
        """
        pattern, scale = self.scaling.pattern, self.scaling.scale[:, None]
        right, columns = right * scale, right.shape[1]
        found = np.zeros_like(right)
        insides, pushed = [], []
        for (inner, outer, _), inverse, spread in zip(
            pattern.blocks, self.inverses, self.spreads, strict=True
        ):
            push = right[inner]
            insides.append(inverse @ push)
            pushed.append((spread.swapaxes(1, 2) @ push).reshape(outer.size, columns))
        loads = right[pattern.joints]
        if pushed:
            none = np.zeros((1, columns))
            loads -= np.concatenate([*pushed, none])[pattern.sources].sum(axis=1)
        moved = np.zeros((len(pattern.joints) + 1, columns))
        moved[:-1] = self.joints.solve(loads)
        for (inner, outer, _), inside, spread in zip(
            pattern.blocks, insides, self.spreads, strict=True
        ):
            found[inner] = inside - spread @ moved[outer]
        found[pattern.joints] = moved[:-1]
        found *= scale
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
