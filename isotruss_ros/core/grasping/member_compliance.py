"""
How members give where an object presses on them, at places that may move along them.

A Timoshenko beam between its ends deforms as a cantilever from the start whose far end is brought
to where it is held. Displacement, slope and rotation of the section are polynomials of the place;
with their coefficients at hand, values and derivatives at a place take two products.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import itertools

from isotruss_ros.core.grasping.beam_between import beam_between, BeamPiece
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.statics.structure import Structure, tube_pieces
import numpy as np

#: What beams with clamped ends do under loads inside of them is of this degree.
DEGREE = 6
#: Where polynomials are taken, from -1 to 1, and what turns values there into coefficients.
NODES = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
TO_COEFFICIENTS = np.linalg.inv(np.vander(NODES, increasing=True))
POWERS = np.arange(DEGREE + 1)
#: Rows of shape functions that are responses (displacement, slope), and loads (force, moment).
ROWS = [0, 1, 2, 0, 1, 3]


@dataclass(frozen=True, eq=False)
class ContactCompliance:
    """
    How k members give under loads at one place on each.

    Loads are forces along and across the member and a moment (f_along, f_across, m) [N, N m],
    responses are the displacement along and across and the slope of the bent centre line, the
    mean of both sides where a force puts a kink into it (u_along, u_across, w') [m, -].

    :ivar matrix: (k, 3, k, 3) responses for unit loads.
    """

    matrix: Array
    _rows_rate: Array  # (3 k, 6 k) responses by the ends
    _loads_rate: Array
    _by_ends: Array  # (3 k, 6 k) responses to forces on the ends
    _to_ends: Array  # (6 k, 3 k) displacements of the ends under loads
    _inside_rate: Array  # (k, 3, 3)
    #: Places i, j on one piece: derivatives of what loads at j do at i, by both places.
    _between_rates: tuple[tuple[int, int, Array, Array], ...] = ()

    def respond(self, loads: Array) -> Array:
        """
        Return the responses (k, 3) to loads (k, 3).

        :param loads: (k, 3) forces along and across the member [N] and moment [N m].
        """
        size = loads.size
        return (self.matrix.reshape(size, size) @ loads.ravel()).reshape(-1, 3)

    def respond_each(self, forces: Points, moments: Array) -> Array:
        """
        Return the responses of all members to each of some loads, (k, 3, n k).

        :param forces: (n k,) on one member after the other, n times, along and across it [N].
        :param moments: (n k,) with them [N m].
        """
        count = len(self.matrix)
        loads = np.stack([forces.real, forces.imag, moments]).reshape(3, -1, count)
        found = self.matrix.transpose(2, 0, 1, 3).reshape(count, -1, 3) @ loads.transpose(2, 0, 1)
        return found.transpose(1, 2, 0).reshape(count, 3, -1)

    def rates(self, loads: Array) -> Array:
        """
        Return how the responses change with the places (k,) of contact: (k, 3, k) [1/m].

        :param loads: (k, 3) forces along and across the member [N] and moment [N m].
        """
        count = len(loads)
        flat = loads.ravel()
        moved = (self._loads_rate * flat[:, None]).reshape(count, 3, -1).sum(axis=1)
        rates = (self._by_ends @ moved.T).reshape(count, 3, count)
        own = np.arange(count)
        rates[own, :, own] += (self._rows_rate @ (self._to_ends @ flat)).reshape(count, 3)
        rates[own, :, own] += (self._inside_rate @ loads[:, :, None])[:, :, 0]
        for i, j, by_own, by_other in self._between_rates:
            rates[i, :, i] += by_own @ loads[j]
            rates[i, :, j] += by_other @ loads[j]
        return rates


class MemberCompliance:
    """
    The compliance of a structure at places on some of its members.

    :ivar start: (k,) pinch points at which the members begin, x + iy [m].
    :ivar axis: (k,) directions of the members, from the start.
    :ivar length: (k,) pinch to pinch [m].
    :param structure: the robot's frame.
    :param members: the k members, numbered as in `Robot.member_names`; one that has two places of
        contact is there twice.
    :param scale: the stiffness of the structure against that of the model.
    """

    def __init__(self, structure: Structure, members: Sequence[int], scale: float = 1.0) -> None:
        frame, topology = structure.frame, structure.config.robot.topology
        used = np.asarray(members, dtype=np.intp)
        count = len(used)
        # Pieces of a member in their order: B to D, D to E', C' to E', which runs backward.
        first, last, middle = tube_pieces(topology.n_modules)
        pieces = np.stack([first[used], middle[used], last[topology.following[used]]], axis=1)
        self._pieces = pieces
        begin, end = (
            frame.points[frame.members.start[pieces]],
            frame.points[frame.members.end[pieces]],
        )
        self.start = begin[:, 0]
        self.length = np.abs(begin[:, 2] - self.start)
        self.axis = (begin[:, 2] - self.start) / self.length
        length = np.abs(end - begin)
        # Where one piece ends and the next one begins, by the place on the member.
        self._joints = np.stack([length[:, 0], length[:, 0] + length[:, 1]], axis=1)
        sense = np.array([1.0, 1.0, -1.0])
        middle = ((0.5 * (begin + end) - self.start[:, None]) * self.axis.conj()[:, None]).real
        self._middle, self._zoom = middle, 2.0 * sense / length
        of_beams = (frame.members.axial, frame.members.flexural, frame.members.shear)
        self._beams = (length, *(values[pieces] for values in of_beams))
        self._pinned, self._sense = frame.members.pinned_start[pieces], sense
        self._scale = scale
        self._pairs = [
            (i, j) for i, j in itertools.permutations(range(count), 2) if used[i] == used[j]
        ]
        shapes, inside = _clamped_beams(
            0.5 * length[..., None] * (1.0 + NODES),
            length[..., None],
            frame.members.axial[pieces][..., None],
            frame.members.flexural[pieces][..., None],
            frame.members.shear[pieces][..., None],
            frame.members.pinned_start[pieces],
        )
        # Along and across are turned around on a piece that runs backward.
        turn = np.ones((3, 4))
        turn[2, :2] = -1.0
        shapes *= turn[:, None, :, None]
        inside *= (turn[:, :3, None] * turn[:, None, :3])[:, None] / scale
        # Of shape functions those that are responses, then those that are loads, then inside.
        values = np.concatenate(
            [shapes[..., ROWS, :].reshape(count, 3, -1, 36), inside.reshape(count, 3, -1, 9)],
            axis=3,
        )
        coefficients = values.swapaxes(2, 3) @ TO_COEFFICIENTS.T
        self._coefficients = np.zeros((count, 3, 2, 45, DEGREE + 1))
        self._coefficients[:, :, 0] = coefficients
        # Their derivatives by the place on the member.
        zoom = self._zoom[:, :, None, None]
        self._coefficients[:, :, 1, :, :-1] = zoom * POWERS[1:] * coefficients[..., 1:]
        self._own = np.arange(count)
        ends = frame.compliance(pieces.ravel()).reshape(count, 3, 6, count, 3, 6)
        self._ends = ends.transpose(0, 1, 3, 4, 2, 5) / scale

    def locate(self, places: Array) -> tuple[Indices, Array]:
        """
        Return the pieces (k,) of the frame that places are on, and where, from their starts [m].

        :param places: (k,) distances from the members' starts [m].
        """
        own, piece = np.arange(len(places)), (places[:, None] >= self._joints).sum(axis=1)
        begins = np.column_stack([np.zeros(len(places)), self._joints[:, 0], self.length])
        return self._pieces[own, piece], np.abs(places - begins[own, piece])

    def at(self, places: Array) -> ContactCompliance:
        """
        Return the compliance at one place on each member.

        :param places: (k,) distances from the members' starts [m].
        """
        count, own = len(places), self._own
        piece = (places[:, None] >= self._joints).sum(axis=1)
        x = self._zoom[own, piece] * (places - self._middle[own, piece])
        powers = (x[:, None] ** POWERS)[:, None, :, None]
        both = (self._coefficients[own, piece] @ powers)[..., 0]
        shapes = np.zeros((4, count, 3, count, 6))
        shapes[:, own, :, own] = both[..., :36].reshape(count, 4, 3, 6)
        by_ends, loads, rows_rate, loads_rate = shapes.reshape(4, 3 * count, 6 * count)
        inside = both[..., 36:].reshape(count, 2, 3, 3)
        ends = self._ends[own[:, None], piece[:, None], own, piece]
        ends = ends.transpose(0, 2, 1, 3).reshape(6 * count, 6 * count)
        to_ends = ends @ loads.T
        matrix = (by_ends @ to_ends).reshape(count, 3, count, 3)
        matrix[own, :, own] += inside[:, 0]
        between = tuple(self._between(places, piece))
        for (i, j, _, _), found in between:
            matrix[i, :, j] += found
        return ContactCompliance(
            matrix,
            rows_rate,
            loads_rate,
            by_ends @ ends,
            to_ends,
            inside[:, 1],
            tuple(rates for rates, _ in between),
        )

    def _between(
        self, places: Array, piece: Indices
    ) -> Iterator[tuple[tuple[int, int, Array, Array], Array]]:
        """Yield what loads at other places of the same piece do, with its derivatives."""
        for i, j in self._pairs:
            if piece[i] != piece[j]:
                continue
            number = piece[i]
            sense = float(self._sense[number])
            beam = BeamPiece(
                *(float(values[i, number]) for values in self._beams),
                bool(self._pinned[i, number]),
            )
            x, y = (
                sense * (float(places[k]) - float(self._middle[k, number])) + 0.5 * beam.length
                for k in (i, j)
            )
            turn = np.array([sense, sense, 1.0])
            turned = np.outer(turn, turn) / self._scale
            found, by_own, by_other = (turned * matrix for matrix in beam_between(beam, x, y))
            yield (i, j, sense * by_own, sense * by_other), found


def _clamped_beams(
    x: Array, length: Array, axial: Array, flexural: Array, shear: Array, pinned: Flags
) -> tuple[Array, Array]:
    """
    Return shape functions, and responses to loads at the place while the ends stand still.

    :param x: (..., n) places on beams [m].
    :param pinned: (...) whether the start transmits no moment.
    :return: (..., n, 4, 6) displacement along and across, slope of the line and rotation of the
        section, by the ends; and (..., n, 3, 3) displacements and slope by forces and moment.
    """
    ei, ga = 1.0 / flexural, 1.0 / shear
    # By force and moment at the tip of a cantilever: deflection, slope, rotation of the section.
    # By reciprocity also what force (deflection) and moment (rotation) at x do to the tip.
    turn, bow = (length * x - 0.5 * x**2) * ei, x * ei
    zero, one = np.zeros_like(x), np.ones_like(x)
    sink = x**2 * (3.0 * length - x) * ei / 6.0 + x * ga
    basis = _matrices([[sink, 0.5 * x * bow], [turn + ga, bow], [turn, bow]])
    tip = _matrices(
        [
            [length**3 * ei / 3.0 + length * ga, 0.5 * length**2 * ei],
            [0.5 * length**2 * ei, length * ei],
        ]
    )
    stiffness = np.linalg.inv(tip)
    bend = basis @ stiffness  # by deflection and rotation of the tip
    relative = _matrices([[-one, -length * one, one, zero], [zero, -one, zero, one]])
    shapes = bend @ relative
    shapes[..., 0, 0] += 1.0
    shapes[..., 0, 1] += x
    shapes[..., 1:, 1] += 1.0
    own = _matrices(
        [
            [x**3 * ei / 3.0 + x * ga, 0.5 * x * bow],
            [0.5 * (x * bow + ga), bow],  # half of the derivative of what is above: the mean slope
        ]
    )
    own = own - bend[..., :2, :] @ basis[..., ::2, :].swapaxes(-1, -2)
    # The rotation of a pinned start follows from no moment there.
    pin = (relative.swapaxes(-1, -2) @ stiffness @ relative)[..., 1, :]
    free = pinned[..., None, None, None]
    start = shapes[..., 1:2].copy()
    shapes -= np.where(free, start * (pin / pin[..., 1:2])[..., None, :], 0.0)
    freed = start[..., :2, :] * start[..., ::2, :].swapaxes(-1, -2) / pin[..., 1, None, None]
    own += np.where(free, freed, 0.0)

    full = np.zeros((*x.shape, 4, 6))
    full[..., 0, 0], full[..., 0, 3] = one - x / length, x / length
    full[..., 1:, [1, 2, 4, 5]] = shapes
    inside = np.zeros((*x.shape, 3, 3))
    inside[..., 0, 0] = x * (length - x) / (axial * length)
    inside[..., 1:, 1:] = own
    return full, inside


def _matrices(rows: Sequence[Sequence[Array]]) -> Array:
    """Return matrices of entries that are arrays of one shape."""
    matrices = np.empty((*rows[0][0].shape, len(rows), len(rows[0])))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            matrices[..., i, j] = entry
    return matrices
