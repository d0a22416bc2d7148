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
the chord, and that tension stiffens the member as in a string. The rotation of a pinned start is
eliminated by static condensation. In a short member Ks is much smaller than Ka, so their sum and
difference, the stiffness with respect to t1 and t2, would lose Ks by rounding.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Flags, Points
import numpy as np


class EndForces(NamedTuple):
    """Forces of k bent members, and the derivatives of these forces with respect to (l, s, b)."""

    #: (k, 3) axial force N [N], and sum M1 + M2 and difference M1 - M2 of the moments at start and
    #: end [N m]
    values: Array
    stiffness: Array  #: (k, 3, 3) derivatives of `values` with respect to (l, s, b)
    #: (k, 3) `values` before the step of Newton's method that makes the energy stationary in N;
    #: from these values the geometric stiffness is computed
    stressed: Array


class BeamColumns(NamedTuple):
    """Members that bend under loads and are straight without loads; complex for complex steps."""

    #: (11, k) rest lengths l0 [m]; axial compliances l0 / EA [m/N]; and derivatives of (M1 + M2,
    #: M1 - M2) with respect to (s, b): those of the sum by s and by b, and that of the difference
    #: by b, first their constant terms, then their factors of N and of N^2
    values: Array

    @classmethod
    def of(cls, length: Array, section: Array, pinned: Flags) -> BeamColumns:
        """Return members (k,) of given rest lengths and sections; `pinned` at the start or not."""
        axial, flexural, shear = section
        slide, arm = 1.0 / shear, 0.25 * length * length / flexural
        stiff = arm / (arm + 3.0 * slide)  # 1 / (1 + phi)
        ratio = length * stiff * stiff
        values = np.zeros((11, len(length)), dtype=length.dtype)
        values[0], values[1] = length, length / axial
        sway, across, bow = values[2::3], values[3::3], values[4::3]
        bow[0] = length / arm  # 4 EI / l0
        sway[0], sway[1] = 3.0 * bow[0] * stiff, 0.2 * ratio
        sway[2] = ratio * (arm * (0.04 / 3.0 * stiff - 2.0 / 105.0) - 0.2 * slide)
        bow[1], bow[2] = length / 3.0, length * (slide / -3.0 - arm / 45.0)
        if pinned.any():  # the rotation of a pinned start is eliminated
            one_pin = _reciprocal(_reciprocal(sway) + _reciprocal(bow))
            across[:] = np.where(pinned, -one_pin, 0.0)
            sway[:], bow[:] = np.where(pinned, one_pin, sway), np.where(pinned, one_pin, bow)
        return cls(values)

    def evaluate(self, longer: Array, turns: Array, given: Array | None = None) -> EndForces:
        """Return the end forces of bent members; `given` (k,) are axial forces near theirs."""
        stretch, rotary = self.values[1], self.values[2:].reshape(3, 3, -1)
        straight, first, second = by_power = rotary[:, :2] * turns[0] + rotary[:, 1:] * turns[1]
        _, bowed, hardened = (by_power * turns).sum(axis=1)
        soft = 1.0 / (stretch - hardened)
        nearest = (longer + 0.5 * bowed) * soft
        pull = nearest if given is None else np.where(np.isnan(given), nearest, given)
        bent = pull * second
        slope = first + 2.0 * bent
        steep = slope * soft
        stiffness = np.empty((3, 3, len(pull)), dtype=soft.dtype)
        stiffness[0, 0] = soft
        stiffness[0, 1:] = stiffness[1:, 0] = steep
        turning = rotary[0] + pull * (rotary[1] + pull * rotary[2])
        stiffness[1, 1:], stiffness[2, 1:] = turning[:2], turning[1:]
        stiffness[1:, 1:] += slope[:, None] * steep
        stressed = np.empty((3, len(pull)), dtype=soft.dtype)
        stressed[0], stressed[1:] = pull, straight + pull * (first + bent)
        shift = 0.0 if given is None else stiffness[:, 0] * (nearest - pull) / soft
        return EndForces((stressed + shift).T, stiffness.T, stressed.T)


def _reciprocal(series: Array) -> Array:
    """Return the first three coefficients (3, ...) of the reciprocal of power series (3, ...)."""
    constant, first, second = series
    whole = 1.0 / constant
    linear = -first * whole**2
    return np.array([whole, linear, -(second * whole + first * linear) * whole])


def chord_motions(axis: Points, length: Array) -> Array:
    """Return changes (k, 4, 6) of length, s, b and rotation of chords by displaced ends."""
    motions = np.zeros((len(axis), 4, 6))
    along, turned = (
        vectors.view(np.float64).reshape(-1, 2) for vectors in (axis, -1j * axis / length)
    )
    motions[:, 0, :2], motions[:, 0, 3:5] = -along, along
    motions[:, 1, :2], motions[:, 1, 3:5] = -turned, turned
    motions[:, 3, :2], motions[:, 3, 3:5] = turned, -turned
    motions[:, 1:3, 2], motions[:, 1, 5], motions[:, 2, 5] = 0.5, 0.5, -0.5
    return motions


def chord_stiffness(length: Array, forces: EndForces) -> Array:
    """Return the stiffness (k, 4, 4) of bent members in the coordinates of `chord_motions`."""
    core = np.zeros((len(length), 4, 4))
    core[:, :3, :3] = forces.stiffness.real
    core[:, 0, 3] = core[:, 3, 0] = forces.stressed[:, 1].real / length
    core[:, 3, 3] = forces.stressed[:, 0].real * length
    return core


def end_forces(forces: Array, length: Array) -> Array:
    """Return the end forces (k, 6) of members, see `FrameState.end_forces`."""
    pull, both, apart = forces.T
    across, first, second = both / length, 0.5 * (both + apart), 0.5 * (both - apart)
    return np.stack([-pull, across, first, pull, -across, second], axis=1)


def local_stiffness(length: Array, axial: Array, flexural: Array, shear: Array) -> Array:
    """Return the stiffness matrices (2) of fixed members in their own axes (x to the end)."""
    fixed, none = np.zeros(len(length), dtype=bool), np.zeros((3, len(length)))
    columns = BeamColumns.of(length, np.stack([axial, flexural, shear]), fixed)
    core = chord_stiffness(length, columns.evaluate(none[0], none[1:]))
    motions = chord_motions(np.ones(len(length), dtype=np.complex128), length)
    return motions.swapaxes(1, 2) @ core @ motions
