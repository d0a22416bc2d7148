# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Depths of the dents at the contacts of an object, or of several objects."""

from __future__ import annotations

from collections import defaultdict
import contextlib
import functools
from typing import Any

from isotruss_ros.core.contact.dent_angles import weigh_samples
from isotruss_ros.core.contact.dent_interpolation import splines_of
from isotruss_ros.core.contact.dent_table import compute_samples, DEPTH_EXPONENT, press_tables
from isotruss_ros.core.contact.pressed_skin import PressedSkin
from isotruss_ros.core.contact.splines import evaluate_splines
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.work_limit import limited_work, WorkLimitError
import numpy as np


class Dents:
    """
    Depths of the dents at k contacts with one object, or with each of n objects.

    :ivar tables: (k,) or (n, k) table of each contact.
    """

    def __init__(
        self,
        tables: Any,
        angles: Array | None = None,
        polynomials_at: tuple[Array, Array] | None = None,
    ) -> None:
        self.tables = tables
        if angles is None:
            self.tables = np.empty(np.shape(tables), dtype=object)
            self.tables[...] = tables
            angles = np.array([table.angles for table in self.tables.ravel()])
            angles = angles.reshape(*self.tables.shape, 3)
        #: (..., k, 3) `DentTable.angles` of the tables
        self._angles = angles
        #: 2/3 powers of the forces and angles (k,) whose polynomials are used; None: those of the
        #: arguments
        self._polynomials_at = polynomials_at

    def __call__(self, forces: Array, angles: Array) -> tuple[Array, Array, Array]:
        """
        Return the depths (k,) [m], and their derivatives by forces [m/N] and angles [m/rad].

        The depths are odd in the forces.
        """
        sizes = np.maximum(np.abs(forces), 1e-9)
        abscissae, signs = sizes**DEPTH_EXPONENT, forces / sizes
        rates = np.empty((3, forces.size))
        for are_round, chosen in self._kinds:
            values = self._evaluate(are_round, chosen, abscissae.ravel(), angles.ravel())
            rates[:, chosen] = values
        depths, by_abscissa, by_angle = rates.reshape(3, *forces.shape)
        by_force = DEPTH_EXPONENT * abscissae / sizes * by_abscissa
        return signs * depths, by_force, signs * by_angle

    @functools.cached_property
    def _kinds(self) -> list[tuple[bool, Indices | slice]]:
        """
        Return the contacts of discs, of smooth surfaces and of corners.

        The depths of discs, which have True, do not depend on the angle.
        """
        kinds = defaultdict[tuple[bool, bool], list[int]](list)
        for i, table in enumerate(self.tables.ravel().tolist()):
            kinds[table.is_round, table.angles[-1] > 0.0].append(i)
        if len(kinds) == 1:
            return [(are_round, slice(None)) for are_round, _ in kinds]
        return [(are_round, np.array(chosen)) for (are_round, _), chosen in kinds.items()]

    @functools.cached_property
    def _round_numbers(self) -> Array:
        """Return the numbers (c, 1, q) of the splines of the contacts that are round."""
        tables = [table for table in self.tables.ravel().tolist() if table.is_round]
        return splines_of(tables, [0] * len(tables))

    def _evaluate(
        self, are_round: bool, chosen: Indices | slice, abscissae: Array, angles: Array
    ) -> Any:
        """Return depths and derivatives (3, c) by abscissa and angle, of chosen contacts."""
        abscissae, angles = piece_abscissae, piece_angles = abscissae[chosen], angles[chosen]
        if self._polynomials_at is not None:
            piece_abscissae, piece_angles = (v.ravel()[chosen] for v in self._polynomials_at)
        if are_round:
            values = evaluate_splines(self._round_numbers, abscissae, piece_abscissae)
            return values[0][:, 0], values[1][:, 0], np.zeros(len(abscissae))
        tables = self.tables.ravel()[chosen].tolist()
        of_tables = self._angles.reshape(-1, 3)[chosen].T
        bases, (weights, by_angle) = weigh_samples(angles, piece_angles, of_tables)
        numbers = splines_of(tables, bases.tolist())
        depths, slopes = evaluate_splines(numbers, abscissae, piece_abscissae)
        products = weights * depths, weights * slopes, by_angle * depths
        return np.array(products).sum(axis=-1)

    def press(self, forces: Array, angles: Array) -> PressedSkin:
        """
        Return the pressed skins at all contacts under positive normal forces (k,) [N].

        The skin is at most as deep as the table.
        """
        depths, _, _ = self(forces, angles)
        deepest = np.array([table.depths[-1] for table in self.tables])
        clipped = np.clip(depths, 0.0, deepest)[:, None]
        skins = press_tables(self.tables.tolist(), angles.tolist(), list(clipped))
        pressed = PressedSkin(*map(np.concatenate, zip(*skins, strict=True)))
        totals = pressed.forces.sum(axis=1)
        factors = np.divide(forces, totals, out=np.zeros(len(totals)), where=totals > 0.0)
        return pressed._replace(forces=pressed.forces * factors[:, None])

    def smooth_near(self, forces: Array, angles: Array) -> Dents:
        """Return dents interpolated with the polynomials near given forces (k,) [N] and angles."""
        return Dents(self.tables, self._angles, (np.abs(forces) ** DEPTH_EXPONENT, angles))

    def pressure_rates(self, forces: Array, angles: Array) -> Array:
        """Return the derivatives of the depths by the tubes' gauge pressures [m/Pa]."""
        if forces.ndim > 1:
            near = self._polynomials_at and tuple(map(np.ravel, self._polynomials_at))
            flat = Dents(self.tables.ravel(), self._angles.reshape(-1, 3), near)
            return flat.pressure_rates(forces.ravel(), angles.ravel()).reshape(forces.shape)
        of_tables, abscissae = self._angles.T, np.abs(forces) ** DEPTH_EXPONENT
        piece_abscissae, piece_angles = self._polynomials_at or (abscissae, angles)
        bases, (weights, _) = weigh_samples(angles, piece_angles, of_tables)
        numbers, owners, factors = [], list[int](), list[float]()
        for i, (table, base) in enumerate(zip(self.tables, bases.tolist(), strict=True)):
            near = table.inflated_near(base)
            of_samples = [1.0] if table.is_round else weights[i].tolist()
            for (splines, change), weight in zip(near, of_samples, strict=True):
                numbers.append(splines)
                owners.append(i)
                factors.append(weight / change)
        depths, _ = evaluate_splines(np.array(numbers), abscissae[owners], piece_abscissae[owners])
        rates = np.bincount(owners, factors * (depths[:, 0] - depths[:, 1]), len(forces))
        return np.copysign(1.0, forces) * rates

    def sample_ahead(self, angles: Array) -> None:
        """
        Compute one sample that the tables lack and need beyond these angles (k,), if any.

        A control loop calls this in cycles with little work, because a sample takes long.
        """
        bases, _ = weigh_samples(angles, angles, self._angles.T)
        with contextlib.suppress(WorkLimitError), limited_work(0):
            for table, base in zip(self.tables, bases.tolist(), strict=True):
                compute_samples([(table, base - 1), (table, base + 1)])

    def take_samples(self, index: Any) -> Dents:
        """Return the dents of chosen objects, or of one, see `samples.take`."""
        near = self._polynomials_at and tuple(values[index] for values in self._polynomials_at)
        return Dents(self.tables[index], self._angles[index], near)
