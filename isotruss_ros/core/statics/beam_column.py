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
        # Of n samples, lengths are (n, k), sections (n, 3, k) and values (n, 11, k).
        axial, flexural, shear = section.swapaxes(0, -2)
        shear_compliance = 1.0 / shear
        bend_compliance = 0.25 * length * length / flexural
        values = np.zeros((11, *length.shape), dtype=length.dtype)
        values[0], values[1] = length, length / axial
        # Derivatives 2 Ks of the sum by s, of the sum by b, and 2 Ka of the difference by b: their
        # coefficients of 1, N and N^2, see this module.
        sway, coupling, bow = values[2::3], values[3::3], values[4::3]
        bow[0] = length / bend_compliance  # 4 EI / l0
        bow[1] = length / 3.0
        bow[2] = length * (shear_compliance / -3.0 - bend_compliance / 45.0)
        share = bend_compliance / (bend_compliance + 3.0 * shear_compliance)  # 1 / (1 + phi)
        sway[0] = 3.0 * bow[0] * share
        sway[1] = 0.2 * (length * share * share)
        by_bending = bend_compliance * (0.04 / 3.0 * share - 2.0 / 105.0)
        sway[2] = length * share * share * (by_bending - 0.2 * shear_compliance)
        if pinned.any():  # the rotation of a pinned start is eliminated
            one_pin = _reciprocal(_reciprocal(sway) + _reciprocal(bow))
            coupling[:] = np.where(pinned, -one_pin, 0.0)
            sway[:], bow[:] = np.where(pinned, one_pin, sway), np.where(pinned, one_pin, bow)
        return cls(values.swapaxes(0, -2))

    def evaluate(
        self, elongation: Array, rotations: Array, axial: Array | None = None
    ) -> EndForces:
        """Return the end forces of bent members, by a Newton step from `axial` forces (k,)."""
        # Axes: power of N; sum by s, coupling, difference by b; member.
        values, rotations = self.values.swapaxes(0, -2), rotations.swapaxes(0, -2)
        compliance, rotary = values[1], values[2:].reshape(3, 3, *values.shape[1:])
        # Coefficients of the moments (M1 + M2, M1 - M2) by powers of N.
        moments = rotary[:, :2] * rotations[0] + rotary[:, 1:] * rotations[1]
        constant, linear, quadratic = moments
        _, shortening, softening = (moments * rotations).sum(axis=1)
        # The energy is stationary in N, with the derivative `stretching` of N by l.
        stretching = 1.0 / (compliance - softening)
        stationary = (elongation + 0.5 * shortening) * stretching
        pull = stationary if axial is None else axial
        moments_by_pull = linear + 2.0 * (pull * quadratic)
        moments_by_elongation = moments_by_pull * stretching
        stiffness = np.empty((3, 3, *pull.shape), dtype=stretching.dtype)
        stiffness[0, 0] = stretching
        stiffness[0, 1:] = stiffness[1:, 0] = moments_by_elongation
        # By s and b: at constant N, and due to the change of N.
        at_constant_pull = rotary[0] + pull * (rotary[1] + pull * rotary[2])
        stiffness[1, 1:], stiffness[2, 1:] = at_constant_pull[:2], at_constant_pull[1:]
        stiffness[1:, 1:] += moments_by_pull[:, None] * moments_by_elongation
        stressed_moments = constant + pull * (linear + pull * quadratic)
        stressed = np.concatenate([pull[None], stressed_moments])
        step = 0.0 if axial is None else stiffness[:, 0] * (stationary - pull) / stretching
        last = (*range(1, stressed.ndim), 0)
        return EndForces(
            (stressed + step).transpose(last),
            stiffness.transpose(*range(2, stiffness.ndim), 0, 1),
            stressed.transpose(last),
        )


def _reciprocal(series: Array) -> Array:
    """Return the first three coefficients (3, ...) of the reciprocal of power series (3, ...)."""
    constant, linear, quadratic = series
    inverse = 1.0 / constant
    slope = -linear * inverse**2
    return np.array([inverse, slope, -(quadratic * inverse + linear * slope) * inverse])


def chord_motions(axis: Points, length: Array) -> Array:
    """Return the derivatives (..., k, 4, 6) of chords' length, s, b and rotation by their ends."""
    # Axes: sample, member, change, end (start and end), displacement of this end (ux, uy, theta).
    motions, axis = np.zeros((*axis.shape, 4, 2, 3)), np.ascontiguousarray(axis)
    motions[..., 0, 1, :2] = axis.view(np.float64).reshape(*axis.shape, 2)
    turning = np.ascontiguousarray(1j * axis / length)
    motions[..., 3, 1, :2] = turning.view(np.float64).reshape(*axis.shape, 2)
    motions[..., 1, 1, :] = -motions[..., 3, 1, :]  # end rotations are relative to the chord
    motions[..., 0, :] = -motions[..., 1, :]
    motions[..., 1, :, 2] = 0.5
    motions[..., 2, :, 2] = 0.5, -0.5
    return motions.reshape(*axis.shape, 4, 6)


def chord_stiffness(length: Array, forces: EndForces) -> Array:
    """Return the stiffness (..., k, 4, 4) of bent members, coordinates as in `chord_motions`."""
    stiffness = np.zeros((*length.shape, 4, 4))
    stiffness[..., :3, :3] = forces.stiffness.real
    stiffness[..., 0, 3] = stiffness[..., 3, 0] = forces.stressed[..., 1].real / length
    stiffness[..., 3, 3] = forces.stressed[..., 0].real * length
    return stiffness


def end_forces(forces: Array, length: Array) -> Array:
    """Return end forces (..., k, 6) as in `FrameState`, from values (k, 3) as in `EndForces`."""
    pull, moment_sum, moment_difference = (forces[..., i] for i in range(3))
    across = moment_sum / length
    start = 0.5 * (moment_sum + moment_difference)
    end = 0.5 * (moment_sum - moment_difference)
    return np.stack([-pull, across, start, pull, -across, end], axis=-1)


def local_stiffness(length: Array, axial: Array, flexural: Array, shear: Array) -> Array:
    """Return the members' stiffness matrices, equation (2), in axes from start to end."""
    pinned, straight = np.zeros(len(length), dtype=bool), np.zeros((3, len(length)))
    columns = BeamColumns.of(length, np.stack([axial, flexural, shear]), pinned)
    stiffness = chord_stiffness(length, columns.evaluate(straight[0], straight[1:]))
    motions = chord_motions(np.ones(len(length), dtype=np.complex128), length)
    return motions.swapaxes(1, 2) @ stiffness @ motions
