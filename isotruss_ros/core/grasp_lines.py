"""The lines by which a grasp is drawn: tubes as they were and bent, forces, contact regions."""

from __future__ import annotations

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.frame import Frame
from isotruss_ros.core.grasp_analysis import Cylinder, GraspAnalysis
from isotruss_ros.core.interior import InteriorPoints
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Points = NDArray[np.complex128]

#: Points on each of the three pieces of a member: B to D, D to E', E' to C'.
SAMPLES = (2, 13, 2)


def member_lines(config: Configuration) -> Points:
    """Return the undeformed centre lines (m, 2) of the members, pinch to pinch [m]."""
    layout, points = config.robot.layout, config.points
    return np.stack([points[layout.b], points[layout.c[layout.following]]], axis=1)


def deformed_lines(config: Configuration, analysis: GraspAnalysis) -> Points:
    """
    Return the centre lines (m, s) of the members under the contact forces, pinch to pinch [m].

    The forces are put where the contact points, which are deformed, are nearest to the undeformed
    tubes. From where they were computed this is as far as the tube moves along itself: little
    enough for a picture.

    :param analysis: of a grasp in this configuration.
    :raises StructureError: the robot is a mechanism.
    """
    layout, frame = config.robot.layout, config.structure.frame
    m = layout.n_modules
    # The tube pieces are the last three of the eight kinds of members: BD, CE, DE'.
    first, last, middle = 5 * m + np.arange(3 * m).reshape(3, m)
    touching = analysis.normal_forces > 0.0
    at = analysis.points[touching] @ np.array([1.0, 1.0j])
    forces = analysis.normals[touching] @ np.array([1.0, 1.0j]) * analysis.normal_forces[touching]
    names = config.robot.member_names
    touched = [names.index(name) for name in analysis.contact_lengths]
    pieces = np.concatenate([first[touched], last[layout.following[touched]], middle[touched]])
    loaded, places = _nearest(frame, pieces, at)
    ends = _end_displacements(frame, loaded, places, forces)
    # C' is where the last piece starts, E' where it ends.
    parts = [(first, False), (middle, False), (last[layout.following], True)]
    lines = []
    for (piece, backward), count in zip(parts, SAMPLES, strict=True):
        line = _line(frame, piece, count, ends, (loaded, places, forces))
        lines.append(line[:, ::-1] if backward else line)
    # Where a piece ends the next begins.
    return np.concatenate([lines[0], lines[1][:, 1:], lines[2][:, 1:]], axis=1)


def force_lines(cylinder: Cylinder, analysis: GraspAnalysis, scale: float) -> Points:
    """
    Return (k, 2) tails and tips [m] of the forces on the object, which push at its surface.

    :param scale: length for a force [m/N].
    """
    touching = analysis.normal_forces > 0.0
    normals = analysis.normals[touching] @ np.array([1.0, 1.0j])
    forces = 1j * analysis.friction_forces[touching] - analysis.normal_forces[touching]
    tips = complex(*cylinder.center) + 0.5 * cylinder.diameter * normals
    return np.stack([tips - scale * forces * normals, tips], axis=1)


def region_lines(analysis: GraspAnalysis, spacing: float) -> Points:
    """
    Return (k, 2) ends [m] of the pieces of centre line that are in contact, one for each point.

    :param spacing: of the points along the tubes, as in the analysis [m].
    """
    touching = analysis.normal_forces > 0.0
    points = analysis.points[touching] @ np.array([1.0, 1.0j])
    half = 0.5j * spacing * (analysis.normals[touching] @ np.array([1.0, 1.0j]))
    return np.stack([points - half, points + half], axis=1)


def _spans(frame: Frame, pieces: Indices) -> tuple[Points, Points]:
    """Return starts and spans of pieces [m]."""
    start = frame.points[frame.members.start[pieces]]
    return start, frame.points[frame.members.end[pieces]] - start


def _nearest(frame: Frame, pieces: Indices, points: Points) -> tuple[Indices, Array]:
    """Return the nearest piece of each point, and where along it that is [m]."""
    start, span = _spans(frame, pieces)
    length = np.abs(span)
    along = ((points[:, None] - start) * (span / length).conj()).real
    along = np.clip(along, 0.0, length)
    away = np.abs(points[:, None] - start - along * span / length)
    nearest = away.argmin(axis=1) if len(points) else np.zeros(0, dtype=int)
    return pieces[nearest], along[np.arange(len(points)), nearest]


def _inside(frame: Frame, pieces: Indices, member: Indices, place: Array) -> InteriorPoints:
    members = frame.members
    return InteriorPoints(
        member,
        place,
        np.abs(_spans(frame, pieces)[1]),
        members.axial[pieces],
        members.flexural[pieces],
        members.shear[pieces],
        np.stack([members.pinned_start[pieces], members.pinned_end[pieces]], axis=1),
    )


def _end_displacements(frame: Frame, loaded: Indices, places: Array, forces: Points) -> Array:
    """Return (n, 3) how the nodes move under forces (c,) inside members."""
    inside = _inside(frame, loaded, np.arange(len(loaded)), places)
    _, span = _spans(frame, loaded)
    local = forces * (span / np.abs(span)).conj()
    shapes = inside.shapes() @ frame.turned(loaded)
    carried = np.einsum('ci,cie->ce', np.stack([local.real, local.imag], axis=1), shapes)
    loads = np.zeros((len(frame.points), 3))
    np.add.at(loads, frame.members.start[loaded], carried[:, :3])
    np.add.at(loads, frame.members.end[loaded], carried[:, 3:])
    return frame.solve(loads).displacements


def _line(
    frame: Frame, pieces: Indices, count: int, ends: Array, load: tuple[Indices, Array, Points]
) -> Points:
    """Return points (p, count) of bent pieces [m]."""
    start, span = _spans(frame, pieces)
    axis, part = span / np.abs(span), np.linspace(0.0, 1.0, count)
    place = np.abs(span)[:, None] * part
    member = np.repeat(np.arange(len(pieces)), count)
    shapes = _inside(frame, pieces, member, place.ravel()).shapes() @ frame.turned(pieces)[member]
    moved = np.concatenate(
        [ends[frame.members.start[pieces]], ends[frame.members.end[pieces]]], axis=1
    )
    local = np.einsum('cie,ce->ci', shapes, moved[member]) @ np.array([1.0, 1.0j])
    local = local.reshape(place.shape)
    loaded, places, forces = load
    for i in np.flatnonzero(np.isin(pieces, loaded)):
        here = loaded == pieces[i]
        both = np.concatenate([place[i], places[here]])
        alone = np.zeros(len(both), dtype=int)
        along, across = _inside(frame, pieces[[i]], alone, both).compliance()
        pull = forces[here] / axis[i]
        bent = along[:count, count:] @ pull.real + 1j * (across[:count, count:] @ pull.imag)
        local[i] += bent
    return start[:, None] + axis[:, None] * (place + local)
