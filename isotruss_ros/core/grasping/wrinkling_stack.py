# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How near the tubes of many grasps are to wrinkling: `find_wrinkling` for round sections."""

from __future__ import annotations

from isotruss_ros.core.grasping.point_stack import PointStack, Touches
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.statics.frame_stack import LoadedStack
from isotruss_ros.core.statics.structure import tube_pieces
import numpy as np


def find_wrinkling_stack(
    loaded: LoadedStack,
    points: PointStack,
    touches: Touches,
    local: Points,
    pressure: Array,
) -> tuple[Array, Array]:
    """
    Return the largest |M| / M_w of each member, and where on it that is, (n, m) and (n, m) [m].

    :param loaded: the frames, and how they give.
    :param points: that the objects could touch.
    :param touches: the points at which they do.
    :param local: (n, a) forces along + i across the tube there [N].
    :param pressure: (m,) p in each member, gauge [Pa].
    """
    stack = loaded.stack
    topology, file = stack.robot.topology, stack.robot.description
    m, radius, n = topology.n_modules, 0.5 * file.tube_diameter, len(local)
    push = np.concatenate([local.real, local.imag], axis=1)
    loads = (touches.levers.transpose(0, 2, 1) @ push[:, :, None])[:, :, 0]
    forces = loaded.tube_forces(loads)
    # What moves the ends of the pieces as the forces inside do, which the pieces carry besides.
    own = loads.reshape(n, -1, 6)[points.owner, points.slot]
    piece = points.pieces - tube_pieces(m)[0, 0]
    turn = stack.beams.direction[points.pieces, points.owner].conj()
    for at in (0, 3):
        moved = (own[:, at] + 1j * own[:, at + 1]) * turn
        forces[at, piece, points.owner] -= moved.real
        forces[at + 1, piece, points.owner] -= moved.imag
        forces[at + 2, piece, points.owner] -= own[:, at + 2]

    pull = pressure * np.pi * radius**2
    used, where = np.full((n, m), -1.0), np.zeros((n, m))
    rows = np.arange(n)
    # At each force: all that acts on the piece between its start and there.
    there = touches.used
    of_piece, place = points.piece[touches.place], points.interior.place[touches.place]
    before = of_piece[:, :, None] == of_piece[:, None, :]
    before &= (place[:, :, None] > place[:, None, :]) & there[:, None, :]
    lever = np.where(before, place[:, :, None] - place[:, None, :], 0.0)
    start = forces[:, piece[of_piece], rows[:, None]]
    moment = start[1] * place - start[2] + (lever @ local.imag[:, :, None])[:, :, 0]
    compression = start[0] + (before @ local.real[:, :, None])[:, :, 0]
    compression = np.maximum(compression, compression + local.real)
    member = points.member[touches.place]
    share = _utilisation(moment, pull[member] - compression, radius)
    along = points.place[touches.place]
    for a in range(share.shape[1]):
        chosen = np.flatnonzero(there[:, a])
        chosen = chosen[share[chosen, a] >= used[chosen, member[chosen, a]]]
        used[chosen, member[chosen, a]] = share[chosen, a]
        where[chosen, member[chosen, a]] = along[chosen, a]
    # At the ends of the pieces: BD and DE' of a member are numbered as it is, CE as what follows.
    ring, whole = file.module.guide_ring_distance, stack.lengths
    length = stack.beams.length[tube_pieces(m)]
    last = topology.following
    begin = [np.zeros_like(whole), whole, np.full_like(whole, ring)]
    spans = [length[0], -length[1][last], length[2]]
    ends = forces.reshape(6, 3, m, n)
    ends[:, 1] = ends[:, 1][:, last]
    for moment, compression, far in ((ends[2], ends[0], 0.0), (ends[5], -ends[3], 1.0)):
        share = _utilisation(moment, pull[:, None] - compression, radius)
        for value, first, span in zip(share, begin, spans, strict=True):
            better = used <= value.T
            used = np.where(better, value.T, used)
            where = np.where(better, (first + far * span).T, where)
    return used, where


def _utilisation(moment: Array, left: Array, radius: float) -> Array:
    """Return |M| / M_w where a pull is left to the wall [N]; infinite where none is."""
    used = np.full(moment.shape, np.inf)
    np.divide(np.abs(moment), 0.5 * radius * left, out=used, where=left > 0.0)
    return used
