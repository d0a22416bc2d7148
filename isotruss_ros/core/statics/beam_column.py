# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Planar beam-columns: the stiffness (2) of a straight member, with terms in the axial force.

A member has the chord length l, the rest length l0, and end rotations t1 = s + b and t2 = s - b
relative to the chord: the rotation s bends it to an S, and b to a bow. Its axial force N is the
value at which the energy U is stationary,

    U = N (l - l0) - N^2 l0 / (2 EA) + Ks s^2 + Ka b^2,
    Ks = 6 EI / l0 / (1 + phi - y/15 + 2 y^2/315),   Ka = 2 EI / l0 (1 + y/3 - y^2/45),
    phi = 12 EI / (GA l0^2),   y = N l0^2 / (4 EI (1 + N/GA)):

the stability functions of a Timoshenko beam (Przemieniecki, Theory of Matrix Structural Analysis,
chapter 15), expanded to N^2. For N = 0 this is (2). The terms in N describe that bending shortens
the chord, and that tension stiffens the member as in a string. The rotation of a pinned end is
eliminated by static condensation. In a short member Ks is much smaller than Ka, so their sum and
difference, the stiffness with respect to t1 and t2, would lose Ks by rounding.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Flags, Points
import numpy as np

#: Index of each entry of `chord_motions` in the list (0, 1/2, x, y, -x, -y, x/l, y/l, -x/l, -y/l,
#: -1/2) of a chord with the direction (x, y) and the length l.
MOTION = np.array(
    [[4, 5, 0, 2, 3, 0], [9, 6, 1, 7, 8, 1], [0, 0, 1, 0, 0, 10], [7, 8, 0, 9, 6, 0]]
)


class EndForces(NamedTuple):
    """
    Forces of k bent members, and the derivatives of these forces with respect to (l, s, b).

    l is the length of the chord; s + b and s - b are the end rotations relative to the chord.

    :ivar values: (k, 3) axial force N [N], and sum M1 + M2 and difference M1 - M2 of the moments
        at start and end [N m].
    :ivar stiffness: (k, 3, 3) derivatives of `values` with respect to (l, s, b).
    :ivar stressed: (k, 3) `values` before the step of Newton's method that makes the energy
        stationary in N; from these values the geometric stiffness is computed.
    :ivar gap: (k,) elongations that followed from the ends, minus those that followed from N,
        before this step [m].
    """

    values: Array
    stiffness: Array
    stressed: Array
    gap: Array


class BeamColumns:
    """
    Members that bend under loads and are straight without loads.

    :ivar length: (k,) rest lengths l0 [m].
    :ivar stretch: (k,) axial compliances l0 / EA [m/N].
    :ivar rotary: (3, 3, k) derivatives of (M1 + M2, M1 - M2) with respect to (s, b): those of the
        sum by s and by b, and that of the difference by b; each is a polynomial of degree 2 in N.
    :param length: (k,) rest lengths l0 [m].
    :param axial: (k,) EA [N].
    :param flexural: (k,) EI [N m^2]; zero for a bar.
    :param shear: (k,) GA [N]; infinite for members without shear deformation.
    :param pinned_start: (k,) whether the start transmits no moment.
    :param pinned_end: (k,) whether the end transmits no moment.
    """

    def __init__(
        self,
        length: Array,
        axial: Array,
        flexural: Array,
        shear: Array,
        pinned_start: Flags,
        pinned_end: Flags,
    ) -> None:
        self.length, self.stretch = length, length / axial
        bar = (flexural == 0.0) | (pinned_start & pinned_end)
        bend = np.where(bar, 1.0, flexural) / length
        slide, arm = 1.0 / shear, 0.25 * length / bend
        phi = 12.0 * bend * slide / length
        third = arm / 3.0
        skew = np.array([1.0 + phi, -0.2 * third, third * (0.2 * slide + 2.0 * arm / 105.0)])
        bow = np.array([np.ones_like(arm), third, -arm * (slide / 3.0 + arm / 45.0)])
        sway, bow_back = 3.0 * _reciprocal(skew), _reciprocal(bow)
        # The rotation of a pinned end is eliminated.
        pinned = pinned_start | pinned_end
        one_pin = 2.0 * _reciprocal(skew / 6.0 + 0.5 * bow_back)
        both = np.where(pinned_end, one_pin, -one_pin)
        one_end = np.stack([one_pin, both, one_pin], axis=1)
        both_ends = np.stack([4.0 * sway, 0.0 * sway, 4.0 * bow], axis=1)
        self.rotary = np.where(bar, 0.0, bend) * np.where(pinned, one_end, both_ends)

    def evaluate(self, longer: Array, turns: Array, known: Array | None = None) -> EndForces:
        """
        Return the end forces of bent members.

        :param longer: (k,) elongations l - l0 [m].
        :param turns: (k, 2) rotations s and b, half of the sum and of the difference of the ends'
            rotations relative to the chord [rad].
        :param known: (k,) axial forces N about which the members are linearised; None: N at which
            the energy is stationary. Newton's method treats N as an unknown, because N has large
            rounding errors if it is computed from small elongations of stiff members.
        """
        rotary, turns = self.rotary, turns.T
        straight, first, second = by_power = rotary[:, :2] * turns[0] + rotary[:, 1:] * turns[1]
        _, bowed, hardened = (by_power * turns).sum(axis=1)
        soft = 1.0 / (self.stretch - hardened)
        nearest = (longer + 0.5 * bowed) * soft
        pull = nearest if known is None else known
        bent = pull * second
        moments, slope = straight + pull * (first + bent), first + 2.0 * bent
        steep = slope * soft
        stiffness = np.empty((3, 3, len(pull)), dtype=soft.dtype)
        stiffness[0, 0] = soft
        stiffness[0, 1:] = stiffness[1:, 0] = steep
        turning = rotary[0] + pull * (rotary[1] + pull * rotary[2])
        stiffness[1, 1:], stiffness[2, 1:] = turning[:2], turning[1:]
        stiffness[1:, 1:] += slope[:, None] * steep
        stressed, gap = np.array([pull, *moments]), (nearest - pull) / soft
        values = stressed if known is None else stressed + stiffness[:, 0] * gap
        return EndForces(values.T, stiffness.T, stressed.T, gap)


def _reciprocal(series: Array) -> Array:
    """Return the first three coefficients (3, k) of the reciprocal of k power series (3, k)."""
    constant, first, second = series
    whole = 1.0 / constant
    linear = -first * whole**2
    return np.array([whole, linear, -(second * whole + first * linear) * whole])


def chord_motions(axis: Points, length: Array) -> Array:
    """
    Return the changes of chords for unit displacements of their ends.

    :param axis: (k,) unit vectors of the chords, x + iy.
    :param length: (k,) lengths of the chords [m].
    :return: (k, 4, 6) derivatives of length, rotations s and b, and rotation of the chord with
        respect to (ux, uy, theta) at start and end.
    """
    values, x, y = np.zeros((11, len(axis))), axis.real, axis.imag
    values[1], values[10] = 0.5, -0.5
    values[2:6], values[6:8] = (x, y, -x, -y), (x / length, y / length)
    values[8:10] = -values[6:8]
    return values.T.take(MOTION, axis=1)


def chord_stiffness(length: Array, forces: EndForces) -> Array:
    """
    Return the stiffness (k, 4, 4) of bent members in the coordinates of `chord_motions`.

    These are the chord's length, the rotations s and b, and the rotation of the chord.

    :param length: (k,) lengths of the chords [m].
    :param forces: forces of the members, with the derivatives of the forces.
    """
    core = np.zeros((len(length), 4, 4))
    core[:, :3, :3] = forces.stiffness
    core[:, 0, 3] = core[:, 3, 0] = forces.stressed[:, 1] / length
    core[:, 3, 3] = forces.stressed[:, 0] * length
    return core


def local_stiffness(
    length: Array,
    axial: Array,
    flexural: Array,
    shear: Array,
    pins: tuple[Flags, Flags] | None = None,
) -> Array:
    """
    Return the stiffness matrices (2) in the members' own frames (x from start to end).

    :param length: (k,) lengths [m].
    :param axial: (k,) EA [N].
    :param flexural: (k,) EI [N m^2].
    :param shear: (k,) GA [N]; infinite for members without shear deformation.
    :param pins: two masks (k,), true for pinned starts and for pinned ends; None: all ends are
        fixed.
    :return: (k, 6, 6) stiffness against (ux, uy, theta) at start and end; zero for pinned
        rotations.
    """
    fixed = np.zeros(np.shape(length), dtype=bool)
    columns = BeamColumns(length, axial, flexural, shear, *(pins or (fixed, fixed)))
    straight = np.zeros(np.shape(length))
    core = chord_stiffness(length, columns.evaluate(straight, np.stack([straight] * 2, axis=1)))
    motions = chord_motions(np.ones_like(straight, dtype=np.complex128), length)
    return motions.swapaxes(1, 2) @ core @ motions
