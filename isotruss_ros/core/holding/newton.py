# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Newton's method for the equilibria of objects with given contacts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeVar

from isotruss_ros.core.holding.contact_loads import Pushes
from isotruss_ros.core.holding.contact_statics import ContactConditions, ContactStatics
from isotruss_ros.core.holding.pressed_contacts import ANGLE, ContactForces
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, MAX_LOAD
from isotruss_ros.core.numerics.factorization import solve_each
from isotruss_ros.core.numerics.samples import join, take
from isotruss_ros.core.numerics.tolerances import MAX_NEWTON_ITERATIONS, ROUNDING
from isotruss_ros.core.numerics.work_limit import count_work
from isotruss_ros.core.statics.bent_tubes import FOLLOWED_MOTION, Prediction, SETTLED_MOTION
from isotruss_ros.core.statics.bent_updates import group_key, update_samples
import numpy as np

#: Tolerances of the balance, relative to the sum of normal forces [-], and of the gaps [m].
FORCE_TOLERANCE, LENGTH_TOLERANCE = 1e-10, 1e-11
#: Error of rounding, after which no step follows, in tolerances [-].
ROUNDING_ERROR = 1e-3
#: Largest rotation in a Newton step [rad], and largest translation in a Newton step, divided by
#: the characteristic radius [-].
MAX_TURN = 0.2
#: The same for a repeated iteration, where none with longer steps has found an equilibrium. Of two
#: families of 114 soft grasps, the longer steps find 71, these find all; with 0.05 they find 101.
#: They alone would take half as many steps again in 300 random grasps.
FINE_TURN = 0.03
#: Largest inclination of a tube in equilibrium [rad]; a tube with a larger inclination folds.
MAX_INCLINATION = 0.5
#: Largest motion of a contact across a guide ring, for which the tubes may be linearised at the
#: ring, in tube radii [-]. With a third of it, 400 random grasps have the same equilibria; with
#: three times of it, one that is far from the start is not found.
RING_REACH = 0.1
#: Largest number of steps after which the tubes are linearised again or the iteration ends [-].
#: In 7000 equilibria of random grasps and of samples of chances, one takes 14 of them, the others
#: at most 5; half of the iterations without an equilibrium take more. With a third, this one
#: equilibrium is not found; with three times of it, the same ones are.
MAX_TANGENT_STEPS = 20

T = TypeVar('T')


class Accuracy(NamedTuple):
    """Accuracy of an equilibrium."""

    reach: float  #: motion of a node beyond which the tubes are linearised again [m]
    last_step_error: float  #: largest error before the last step, in tolerances [-]


#: Accuracy of a single equilibrium. In 217 random equilibria, forces err by up to 7e-13 of their
#: mean; without the last step by up to 4e-10, with a hundred times of `ROUNDING_ERROR` by up to
#: 7e-11. A hundredth of the error before the last step takes 2 % more iterations, a hundred times
#: of it as many.
SETTLED = Accuracy(SETTLED_MOTION, 1e2)
#: Accuracy of the equilibria of random samples, of which only forces and pose are used. At this
#: motion, displacements err by up to 2e-11 m, stiffnesses by up to 2e-5 of their values.
SAMPLED = Accuracy(1e-6, 1e2)
#: Accuracy of the equilibria of a robot in motion.
FOLLOWED = Accuracy(FOLLOWED_MOTION, 1e2)


class Iteration(NamedTuple):
    """
    Newton's method for n samples with the same contacts and one layout of the tubes.

    The arrays of a single object may lack the axis of the samples.
    """

    samples: Indices  #: (n,) numbers of the samples
    statics: ContactStatics
    unknowns: Array  #: (n, 3 + 4k)
    pushes: Pushes
    wrench: Array  #: (n, 3) external wrenches, see `HeldGrip.wrench` [N]
    least_error: Array  #: (n,) error when the tubes were last linearised, in tolerances [-]
    moves_by_rounding: Flags  #: (n,) whether nodes moved only by rounding since then
    crossings: Array  #: (n, k) number of times that each contact crossed a guide ring
    steps: Indices  #: (n,) number of steps since the tubes were last linearised

    @classmethod
    def of(
        cls, statics: ContactStatics, samples: Indices, unknowns: Array, wrench: Array
    ) -> Iteration:
        """Return the iteration that begins at given unknowns."""
        lead = unknowns.shape[:-1]
        return cls(
            samples,
            statics,
            unknowns,
            statics.pushes(unknowns),
            wrench,
            least_error=np.full(lead, np.inf),
            moves_by_rounding=np.zeros(lead, dtype=bool),
            crossings=np.zeros(statics.sides.shape),
            steps=np.zeros(lead, dtype=int),
        )

    def relinearized(
        self, predicted: Prediction, error: Array, motion: Array, chosen: Flags
    ) -> Iterator[Iteration]:
        """Yield chosen samples in groups of one layout, with tubes linearised where they are."""
        statics, indices = self.statics, self.statics.places
        bent, feet = statics.bent, self.unknowns[..., indices.feet]
        are_near = np.abs(feet - bent.places) < RING_REACH * statics.tube_radius
        current = self._replace(
            statics=replace(statics, bent=None),  # type: ignore[arg-type]  # is replaced below
            least_error=error,
            moves_by_rounding=motion <= ROUNDING,
            steps=0 * self.steps,
        )
        for rows, tubes in update_samples(bent, predicted, chosen):
            every = current, are_near, bent.cuts.pieces
            group, near, pieces = every if rows is None else take(every, rows)
            crossings = group.crossings + (near & (tubes.cuts.pieces != pieces))
            statics = replace(group.statics, bent=tubes)
            group = group._replace(statics=statics, crossings=crossings)
            returned = (crossings > 1.0).any(axis=-1)
            for at_rings in choose(group, returned):
                yield from at_rings._at_rings()
            yield from choose(group, ~returned)

    def _at_rings(self) -> Iterator[Iteration]:
        """Yield the samples with tubes linearised with contacts that returned at the ring."""
        bent, feet = self.statics.bent, self.unknowns[..., self.statics.places.feet]
        rings = bent.structure.nearest_rings(bent.members, feet)
        positions = np.where(self.crossings > 1.0, rings, feet)
        predicted = bent.predict(self.pushes.loads, positions)
        for rows, tubes in update_samples(bent, predicted):
            group = self if rows is None else take(self, rows)
            statics = replace(group.statics, bent=tubes)
            yield group._replace(statics=statics, crossings=0.0 * group.crossings)


class Equilibria(NamedTuple):
    """Equilibria of n samples with the same contacts and one layout of the tubes."""

    samples: Indices  #: (n,) numbers of the samples
    statics: ContactStatics  #: equations of equilibrium
    state: ContactForces  #: their solutions


def find_equilibria(
    begin: Sequence[Iteration],
    conditions: ContactConditions,
    steps: int = MAX_NEWTON_ITERATIONS,
    accuracy: Accuracy = SETTLED,
    max_turn: float = MAX_TURN,
) -> list[Equilibria]:
    """
    Find equilibria by Newton's method, for samples with the same contacts.

    Tubes are linearised again if a node has moved by more than `Accuracy.reach`, and if the error
    is smaller than at the last time, so that the iteration does not alternate. If a contact
    crosses a guide ring and returns, they are linearised with this contact at the ring. An
    iteration that neither ends nor linearises them again within `MAX_TANGENT_STEPS` has none.

    :return: the equilibria found; samples without one are left out.
    """
    found: list[Equilibria] = []
    waiting = list(begin)
    for _ in range(steps):
        if len(waiting) > 1:
            groups: dict[object, list[Iteration]] = {}
            for iteration in waiting:
                groups.setdefault(group_key(iteration.statics.bent), []).append(iteration)
            waiting = list(map(join, groups.values()))
        waiting = [
            item
            for one in waiting
            for item in _iterate(one, conditions, accuracy, max_turn, found)
        ]
        if not waiting:
            break
    return found


def _iterate(
    begin: Iteration,
    conditions: ContactConditions,
    accuracy: Accuracy,
    max_turn: float,
    found: list[Equilibria],
) -> Iterator[Iteration]:
    """Yield the samples that continue after a step of Newton's method; add those that end."""
    samples, statics, unknowns, pushes, wrench, *_ = begin
    indices = statics.places
    for _ in samples:
        count_work()
    residual, state = statics.equations(unknowns, wrench, conditions, pushes)
    error = _measure_error(residual, state)
    step = _find_step(statics, state, residual, max_turn)
    is_finite = np.isfinite(step).all(axis=-1)
    step[~is_finite | (error <= ROUNDING_ERROR)] = 0.0
    unknowns = unknowns + step
    pushes = statics.pushes(unknowns)
    # Beyond these loads the iteration diverges.
    is_valid = is_finite & (np.abs(pushes.loads).max(axis=(-2, -1)) <= MAX_LOAD)

    # The end of the iteration. Tubes are not modelled beyond the ends of their members, so
    # contacts there converge slowly, and are accepted before.
    feet = unknowns[..., indices.feet]
    predicted = statics.bent.predict(pushes.loads, feet)
    motion = statics.bent.distance(predicted)
    # For NaN the comparisons are false, so NaN is not a solution.
    is_solved = error <= accuracy.last_step_error
    is_linearised = (motion <= accuracy.reach) | begin.moves_by_rounding
    is_beyond_end = (motion <= FOLLOWED_MOTION) & ~statics.are_on_members(feet)
    ends = is_valid & (is_beyond_end | (is_solved & is_linearised))
    if ends.any():
        folds = np.abs(unknowns[..., indices.inclinations]).max(axis=-1) > MAX_INCLINATION
        normals = statics.bent.lines.axis * pushes.member_normals
        state = ContactForces(unknowns, normals, pushes.loads, state.jacobian)
        found += choose(Equilibria(samples, statics, state), ends & ~folds)
        if ends.all():
            return

    # The tubes are linearised again. In soft structures, nodes then move by rounding.
    steps = begin.steps + 1
    current = begin._replace(unknowns=unknowns, pushes=pushes, steps=steps)
    continues = is_valid & ~ends & (steps < MAX_TANGENT_STEPS)
    relinearizes = continues & ~is_linearised & (is_solved | (error < begin.least_error))
    yield from choose(current, continues & ~relinearizes)
    if relinearizes.any():
        yield from current.relinearized(predicted, error, motion, relinearizes)


def choose(record: T, chosen: Flags) -> list[T]:
    """Return the record of chosen samples in a list, which is empty if none is chosen."""
    flags = chosen.ravel().tolist()  # for one sample much faster than reductions of the array
    if all(flags):
        return [record]
    return [take(record, np.flatnonzero(chosen))] if any(flags) else []


def _measure_error(residual: Array, state: ContactForces) -> Array:
    """Return the largest residual (n,) of each sample, in tolerances [-]."""
    sizes, squeeze = np.abs(residual), np.abs(state.normal_forces).sum(axis=-1, keepdims=True)
    sizes[..., state.places.balance] *= LENGTH_TOLERANCE / (FORCE_TOLERANCE * squeeze)
    return sizes.max(axis=-1) / LENGTH_TOLERANCE


def _find_step(
    statics: ContactStatics, state: ContactForces, residual: Array, max_turn: float
) -> Array:
    """Return a bounded step (n, 3 + 4k) of Newton's method; not finite if singular."""
    size = residual.shape[-1]
    jacobians, right = state.jacobian.reshape(-1, size, size), residual.reshape(-1, size, 1)
    step = -solve_each(jacobians, right).reshape(residual.shape)
    # The motion of the centroid does not depend on the frame of the object.
    centroid = np.exp(1j * state.unknowns[..., ANGLE]) * statics.body.shape.centroid
    shift = step[..., 0] + 1j * step[..., 1] + 1j * centroid * step[..., ANGLE]
    translations = np.maximum(np.abs(shift), np.abs(step[..., state.places.feet]).max(axis=-1))
    turns = np.abs(step[..., state.places.turns])
    largest = np.maximum(translations / statics.body.arm, turns.max(axis=-1))
    return step / np.maximum(largest / max_turn, 1.0)[..., None]


def settle(
    statics: ContactStatics,
    start: Array,
    wrench: Array,
    conditions: ContactConditions,
    steps: int = MAX_NEWTON_ITERATIONS,
    accuracy: Accuracy = SETTLED,
) -> tuple[ContactStatics, ContactForces] | None:
    """Find an equilibrium, see `find_equilibria`; return its equations and state, or None."""
    begin = Iteration.of(statics, np.zeros(1, dtype=int), start, wrench)
    for found in find_equilibria([begin], conditions, steps, accuracy):
        return found.statics, found.state
    return None
