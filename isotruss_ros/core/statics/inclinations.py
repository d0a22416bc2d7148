# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Inclinations of bent centre lines at k load points.

A centre line has a kink at a transverse force; at a load point, the mean of the inclinations on
both sides is used. A guide ring exerts a transverse force, too, so this mean changes by the kink
of the ring when a load point crosses it. The change is distributed over the width of the ring.
With a jump there may be no equilibrium: a contact before the ring rolls forward, behind it back.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.frame import Frame
from isotruss_ros.core.statics.structure import Structure
import numpy as np

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
