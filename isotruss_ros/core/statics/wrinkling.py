# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Utilisation of inflated tubes, which is the bending moment divided by the wrinkling moment.

Under the gauge pressure p and a compression N the wall carries the tension p pi R^2 - N. At the
bending moment M_w = (p pi R^2 - N) R / 2 one side of the wall is slack and begins to wrinkle; at 2
M_w the tube folds (Comer and Levy, AIAA Journal 1 (1963) 1652-1655). Beyond M_w the beam model is
not valid.
"""

from __future__ import annotations

import functools
from typing import NamedTuple, TYPE_CHECKING

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.samples import pick
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np

if TYPE_CHECKING:
    from isotruss_ros.core.statics.frame import Frame
    from isotruss_ros.core.statics.structure import Structure

#: Largest recommended utilisation of a tube [-].
MAX_UTILISATION = 0.8


class Utilisation(NamedTuple):
    """Utilisation of the m members of a robot under loads; zero for members out of the frame."""

    used: Array  #: (m,) largest |M| / M_w on each member; infinite if the wall has no tension
    place: Array  #: (m,) distance of this maximum from the member's start [m]
    piece: Indices  #: (m,) index of the frame's part in which the maximum is
    kind: Indices  #: (m,) 0 if the maximum is at this part's start, 1 at its end, 2 inside
    loads: Array  #: (4, m) loads of this part, see `evaluate_utilisation`
    sections: Array  #: (3, m) sections of this part, see `evaluate_utilisation`


def find_utilisation(
    structure: Structure, frame: Frame, end_forces: Array, pulls: Array
) -> Utilisation:
    """Return the utilisation of members; for `end_forces` and `pulls` see `FrameState`."""
    config, topology = structure.config, structure.config.robot.topology
    parts, member = structure.tube_parts(frame)
    inputs = _loads_and_sections(structure, frame, end_forces, pulls, parts, member)
    used, inner_positions = evaluate_utilisation(inputs[:4], inputs[4:], structure.tube_radius)
    length = inputs[4]
    # Positions (3, ..., p) of the points along their members: at start, end and inner maximum.
    start = config.points.take(topology.b[member], axis=-1)
    to_member = config.member_axes.take(member, axis=-1).conj()
    starts = frame.points.take(frame.layout.start[parts], axis=-1)
    directions = (frame.axis.take(parts, axis=-1) * to_member).real
    within = np.array([np.zeros(length.shape), length, inner_positions])
    positions = ((starts - start) * to_member).real + directions * within
    # The last point of each member in this order is the most used one. Last axis: points.
    of_points, (members, owner, last) = np.concatenate(used, axis=-1), _sort(member.tobytes())
    order = np.lexsort((of_points, np.broadcast_to(owner, of_points.shape)), axis=-1)
    most_used = order[..., last]
    kind, number = np.divmod(most_used, len(parts))
    # Rows: utilisation and position; then the part, its kind of place, loads and sections.
    of_maxima = pick(np.array([of_points, np.concatenate(positions, axis=-1)]), most_used)
    of_parts = pick(inputs, number)
    values = np.concatenate([of_maxima, [parts[number], kind], of_parts])
    filled = np.zeros((*values.shape[:-1], structure.owners.shape[1]))
    filled[..., members] = values
    used, place, piece, kind = filled[:4]
    loads, sections = filled[4:8].swapaxes(0, -2), filled[8:].swapaxes(0, -2)
    indices = piece.astype(np.intp), kind.astype(np.intp)
    return Utilisation(used, place, *indices, loads, sections)


def utilise_at(
    structure: Structure, frame: Frame, end_forces: Array, pulls: Array, at: Utilisation
) -> Array:
    """
    Return the utilisations (n, m) of n samples at the places of those of one sample.

    They are negative where the moment at the start or end of a part has the other sign, so that
    they have no kink at zero.
    """
    parts, member = structure.tube_parts(frame)
    inputs = _loads_and_sections(structure, frame, end_forces, pulls, parts, member)
    inputs = inputs[..., np.searchsorted(parts, at.piece)]
    used, _ = evaluate_utilisation(inputs[:4], inputs[4:], structure.tube_radius)
    used[:2] *= np.sign(inputs[:2]) * np.sign(at.loads[:2, None])
    return used[at.kind, :, np.arange(len(at.kind))].T


def _loads_and_sections(
    structure: Structure,
    frame: Frame,
    end_forces: Array,
    pulls: Array,
    parts: Indices,
    member: Indices,
) -> Array:
    """Return loads and then sections (7, ..., p) of parts, see `evaluate_utilisation`."""
    tube, area = structure.config.robot.topology.tube[member], np.pi * structure.tube_radius**2
    ends, pull = end_forces.take(parts, axis=-2), pulls.take(parts, axis=-1)
    length, section = frame.length.take(parts, axis=-1), frame.section.take(parts, axis=-1)
    wall = area * np.asarray(structure.pressures)[..., tube] + ends[..., 3]
    flexural, shear = section[..., 1, :], section[..., 2, :]
    return np.array([-ends[..., 2], ends[..., 5], wall, pull, length, flexural, shear])


@functools.lru_cache(maxsize=64)
def _sort(member: bytes) -> tuple[Indices, Indices, Indices]:
    """
    Return the members (m,) of parts, sorted, and those (3 p,) of three points on each part.

    The third value (m,) are the last points of the members, if the points are sorted by them. The
    argument are the bytes of the members (p,) of the parts. Cached.
    """
    of_parts = np.frombuffer(member, dtype=np.intp)
    of_points = np.tile(of_parts, 3)
    last = np.flatnonzero(np.diff(np.sort(of_points), append=-1))
    return np.unique(of_parts), of_points, last


def evaluate_utilisation(loads: Array, sections: Array, radius: float) -> tuple[Array, Array]:
    """
    Return |M| / M_w (3, ...) at start, end and inner maximum (or zero), and its position [m].

    The loads (4, ...) are bending moments at start and end [N m], tension of the wall, and the
    axial force that amplifies moments [N]. The sections (3, ...) are length [m], EI [N m^2] and GA
    [N]. All of them may be complex, for derivatives by complex steps.
    """
    begin, end, wall, pull = loads
    length, flexural, shear = sections
    # M = begin cos(k x) + amplitude sin(k x), whose maximum may be inside a piece; without
    # compression the largest moment is at an end.
    wave_number = np.sqrt(np.maximum(-pull, 0.0) / flexural / (1.0 + pull / shear))
    end_phase = np.maximum(wave_number * length, ROUNDING)
    amplitude = (end - begin * np.cos(end_phase)) / np.sin(end_phase)
    crest_phase = np.arctan2(amplitude.real, begin.real) % np.pi
    is_inside = (wave_number.real > 0.0) & (crest_phase < end_phase.real)
    crest = np.where(is_inside, np.sqrt(begin * begin + amplitude * amplitude), 0.0)
    moments = np.stack([begin, end, crest])
    magnitudes = np.where(moments.real < 0.0, -moments, moments)
    used = np.full(moments.shape, np.inf, dtype=moments.dtype)
    np.divide(2.0 * magnitudes, radius * wall, out=used, where=wall.real > 0.0)
    return used, np.where(is_inside, crest_phase / end_phase * length, 0.0)
