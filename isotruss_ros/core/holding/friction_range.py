# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Range of the coefficient of friction in which the contact history decides whether an object slips.

The contacts of an equilibrium are in their friction cones, |T_i| <= mu N_i, after any history. To
first order the contact forces are f = f_0 + R a, where a (k,) are changes of the rolling
invariants, that is slips of the contacts; they keep what is measured of the pose. The history
decides a. The smallest coefficient of all histories is

    necessary = min_a max_i |T_i| / N_i

When friction falls, the contacts of some members slip by d, and all others stick. The first
member to slip was outside of its cone. The object slides once all contacts have reached the edges
of their cones, s_i T_i = mu N_i with s_i = +1 or -1, equal at all contacts of a member, and
s_i d_i >= 0. The largest coefficient at which this can happen, after a history a at a coefficient
mu_0, is

    sufficient = max_(a, d, s) min_i s_i T_i / N_i  with  |T_i(a)| <= mu_0 N_i(a)

The forces of slipping contacts are those at a + d. When friction falls suddenly, the contacts that
stick are loaded suddenly: without damping their load overshoots to that at a + 2 d.

Both are quasilinear: linear programs in a and d for a given coefficient, whose feasibility is
monotone in the coefficient.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import itertools
import math
from typing import Literal, NamedTuple

from isotruss_ros.core.holding.contacts import ANGLE, POSE
from isotruss_ros.core.holding.grip_response import idle_contacts
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.overlaps import MAX_DISPLACEMENT
from isotruss_ros.core.numerics.arrays import Array, Flags
from isotruss_ros.core.numerics.qp import QuadraticProgram, solve_qp
import numpy as np

#: Load of a suddenly loaded, undamped contact relative to the same load at rest [-].
DYNAMIC_LOAD_FACTOR = 2.0
#: Resolution of the coefficients [-].
RESOLUTION = 1e-5


class FrictionRange(NamedTuple):
    """Coefficients of friction between which the contact history decides [-]."""

    necessary: float  #: least coefficient at which the object is in equilibrium after some history
    sufficient: float  #: least coefficient at which it does not slide after any history

    def verdict(self, friction: float | tuple[float, float]) -> Literal['held', 'unknown', 'lost']:
        """
        Return whether friction holds the object: after every history, some, or none.

        :param friction: coefficient of friction, or its smallest and largest measured value [-].
        """
        smallest, largest = friction if isinstance(friction, tuple) else (friction, friction)
        if largest < self.necessary:
            return 'lost'
        return 'held' if smallest >= self.sufficient else 'unknown'


def find_friction_range(grip: HeldGrip, friction: float) -> FrictionRange:
    """
    Return the friction range of an equilibrium.

    :param grip: the equilibrium.
    :param friction: coefficient of friction mu_0 of the contact histories [-].
    """
    required = grip.required_friction
    program = _SlipProgram.of(grip)
    if program is None:
        return FrictionRange(required, math.inf)
    necessary = required
    if program.is_balanced(required - RESOLUTION):
        necessary = _bisect(lambda mu: not program.is_balanced(mu), 0.0, required)
    sufficient, largest = necessary, max(friction, necessary)
    for slides in program.modes(largest):
        if slides(sufficient + RESOLUTION):
            sufficient = _bisect(slides, sufficient, largest)
    return FrictionRange(necessary, sufficient)


def _bisect(is_below: Callable[[float], bool], low: float, high: float) -> float:
    """Return the smallest coefficient that is not below a limit, at most `high`."""
    while high - low > RESOLUTION:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_below(middle) else (low, middle)
    return high


@dataclass(frozen=True)
class _SlipProgram:
    """Linear programs of the slips of k pressed contacts, in units of the squeeze."""

    normal: Array  #: (k,) normal forces
    friction: Array  #: (k,) friction forces
    normal_rates: Array  #: (k, k) derivatives of the normal forces by the slips
    friction_rates: Array  #: (k, k) derivatives of the friction forces by the slips
    pose_rates: Array  #: (3, k) derivatives of the pose, relative to its largest displacement
    measured: Array  #: (q, k) derivatives of what is measured of the pose
    owners: Array  #: (k,) grasping member of each contact

    @classmethod
    def of(cls, grip: HeldGrip) -> _SlipProgram | None:
        """Return the programs of an equilibrium; None if it is neutral."""
        state, indices = grip.state, grip.state.places
        count = len(state.normals)
        residuals = np.zeros((indices.size, count))
        residuals[indices.conditions] = -np.eye(count)
        change = grip.respond(residuals)
        if change is None:
            return None
        pressed = ~idle_contacts(state.normal_forces)
        change = change[:, pressed]
        normal_rates = change[indices.normal][pressed]
        friction_rates = change[indices.friction][pressed]
        stiffness = max(np.abs(normal_rates).max(), np.abs(friction_rates).max())
        unit = grip.squeeze / stiffness  # slip of the unit of the programs [m]
        largest = MAX_DISPLACEMENT * grip.config.robot.description.tube_diameter
        poses = change[:POSE] * np.array([1.0, 1.0, grip.arm])[:, None]
        return cls(
            state.normal_forces[pressed] / grip.squeeze,
            state.friction_forces[pressed] / grip.squeeze,
            normal_rates / stiffness,
            friction_rates / stiffness,
            unit / largest * poses,
            _measured_rates(grip, change),
            grip.contacts.owners[pressed],
        )

    def is_balanced(self, friction: float) -> bool:
        """Return whether some history has an equilibrium at a coefficient of friction."""
        return _is_feasible(*self._cones(friction), self.measured)

    def modes(self, friction: float) -> Iterator[Callable[[float], bool]]:
        """
        Yield, for each mode of sliding, whether it is possible at a coefficient of friction.

        The histories are those at the given coefficient `friction`.
        """
        members = range(int(self.owners[-1]) + 1)
        for first, last in itertools.permutations(members, 2):
            for signs in itertools.product((1.0, -1.0), repeat=len(members)):
                slips, sticks = self.owners == first, self.owners == last
                yield self._mode(friction, slips, sticks, np.array(signs)[self.owners])

    def _mode(
        self, largest: float, slips_first: Flags, sticks: Flags, signs: Array
    ) -> Callable[[float], bool]:
        """Return whether a mode is possible, given the contacts that slip first and that stick."""
        cones, bounds = self._cones(largest)
        # Columns: slips a of the history, and then slips d of the contacts that slip.
        moving = np.flatnonzero(~sticks)
        slips = np.zeros((len(signs), len(moving)))
        slips[moving, np.arange(len(moving))] = 1.0
        both = np.hstack([np.eye(len(signs)), slips])
        overshot = np.hstack([np.eye(len(signs)), DYNAMIC_LOAD_FACTOR * slips])
        reached = np.where(sticks[:, None, None], overshot, both)  # slips for each contact's force
        normal_rates = np.einsum('ka,kac->kc', self.normal_rates, reached)
        friction_rates = np.einsum('ka,kac->kc', self.friction_rates, reached)
        moved = self.pose_rates @ overshot
        fixed = np.vstack(
            [
                np.hstack([cones, np.zeros((len(cones), len(moving)))]),
                np.hstack([np.zeros((len(moving), len(signs))), -np.diag(signs[moving])]),
                -self.normal_rates @ overshot,
                moved,
                -moved,
            ]
        )
        room = np.concatenate([bounds, np.zeros(len(moving)), self.normal, np.ones(2 * POSE)])
        measured = np.hstack([self.measured, np.zeros((len(self.measured), len(moving)))])

        def slides(mu: float) -> bool:
            """Return whether s T >= mu N at all contacts is possible."""
            rows = mu * normal_rates - signs[:, None] * friction_rates
            limits = signs * self.friction - mu * self.normal
            before = mu * self.normal_rates - signs[:, None] * self.friction_rates
            first_row = np.concatenate([slips_first @ before, np.zeros(len(moving))])
            return _is_feasible(
                np.vstack([fixed, rows, first_row]),
                np.concatenate([room, limits, [slips_first @ limits]]),
                measured,
            )

        return slides

    def _cones(self, friction: float) -> tuple[Array, Array]:
        """Return the inequalities of friction cones and of pressing contacts."""
        rows = [
            self.friction_rates - friction * self.normal_rates,
            -self.friction_rates - friction * self.normal_rates,
            -self.normal_rates,
        ]
        bounds = [friction * self.normal - self.friction, friction * self.normal + self.friction]
        return np.vstack(rows), np.concatenate([*bounds, self.normal])


def _measured_rates(grip: HeldGrip, change: Array) -> Array:
    """
    Return the derivatives of what is measured of the pose by the slips, rows of full rank.

    These are conditions of the equilibrium that state a pose, and not how contacts roll. If the
    contacts have rolled, their history is known, and all slips are zero.
    """
    indices = grip.state.places
    conditions = grip.state.jacobian[indices.conditions]
    if conditions[:, indices.feet].any():
        return np.eye(change.shape[1])
    states_pose = conditions[:, : ANGLE + 1].any(axis=1)
    rates = conditions[states_pose] @ change
    lengths = np.linalg.norm(rates, axis=1)
    return rates[lengths > 0.0] / lengths[lengths > 0.0, None]


def _is_feasible(rows: Array, bounds: Array, equality: Array) -> bool:
    """Return whether rows x <= bounds and equality x = 0 have a solution x."""
    count = rows.shape[1]
    program = QuadraticProgram(
        np.eye(count), np.zeros(count), rows, bounds, equality, np.zeros(len(equality))
    )
    return solve_qp(program) is not None
