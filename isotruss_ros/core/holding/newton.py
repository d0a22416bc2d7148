# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Newton's method for the equilibria of n objects with given contacts, and of the bent tubes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, TypeVar

from isotruss_ros.core.holding.contacts import ANGLE
from isotruss_ros.core.holding.equations import (
    begin_straight,
    Grasps,
    guess_forces,
    Linear,
    linearize_grasps,
    Pushes,
)
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, MAX_LOAD
from isotruss_ros.core.numerics.factorization import solve_each
from isotruss_ros.core.numerics.samples import join, take
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS
from isotruss_ros.core.numerics.work_limit import count_work
from isotruss_ros.core.statics.bent_tubes import BentState, BentTubes
from isotruss_ros.core.statics.structure import Cuts, group_samples
import numpy as np

#: Tolerances of the balance, relative to the sum of normal forces [-], and of the gaps [m].
FORCE_TOLERANCE, LENGTH_TOLERANCE = 1e-10, 1e-11
#: Share of the first error to which the error must fall within `Pace.patience` steps [-]. In 500
#: random grasps it fell to 0.13 at most where there was an equilibrium; half of the iterations
#: without one end by this bound.
HOPELESS_SHARE = 0.2
#: Largest inclination of a tube in equilibrium [rad]; a tube with a larger inclination folds.
MAX_INCLINATION = 0.5
#: Largest motion of a node in the last step with a contact beyond the end of its member [m], where
#: tubes are not modelled, and contacts converge slowly.
BEYOND_MOTION = 1e-4


#: Largest motion of a node in the last step of an equilibrium [m]. With ten times of it, slip
#: margins err by 5e-8 of the squeeze at most in 500 random grasps.
EXACT_MOTION = 2e-10


class Accuracy(NamedTuple):
    """Accuracy of an equilibrium, whose error is the square of that before the last step."""

    motion: float  #: largest motion of a node since the tubes were linearised [m]
    error: float  #: largest error before the last step, in tolerances [-]


class Pace(NamedTuple):
    """Lengths and number of the steps of Newton's method."""

    #: largest rotation in a step [rad], and largest translation in a step, divided by the
    #: characteristic radius [-]
    turn: float
    steps: int  #: largest number of steps
    patience: int  #: number of steps within which the error must fall, see `HOPELESS_SHARE`


#: Usual steps, and those that must end within a control cycle. In 600 equilibria of random grasps,
#: 27 steps were the most.
USUAL = Pace(0.2, 30, 12)
QUICK = Pace(0.2, MAX_SEARCH_STEPS, MAX_SEARCH_STEPS)
#: Short steps, which find equilibria that longer ones pass by; the most were 42.
FINE = Pace(0.03, 45, 45)

#: Accuracy of an equilibrium at which the tubes are linearised once more, see `finish`.
SETTLED = Accuracy(3e-6, 1e7)
#: Accuracy of the equilibria of a robot in motion.
FOLLOWED = Accuracy(1e-4, 1e2)


class Iterate(NamedTuple):
    """Unknowns of n samples, and their bent tubes."""

    unknowns: Array  #: (n, 3 + 4k) see `Places`
    bent: BentState

    @classmethod
    def straight(cls, g: Grasps, deforms: bool, unknowns: Array | None = None) -> Iterate:
        """Return straight tubes with objects at their measured poses, or at given unknowns."""
        unknowns = begin_straight(g) if unknowns is None else unknowns
        return cls(unknowns, BentState.straight(g.structure, unknowns[:, g.places.feet], deforms))


T = TypeVar('T')


class Found(NamedTuple):
    """Equilibria of n samples with one layout of the tubes, after a step of Newton's method."""

    samples: Indices  #: (n,) numbers of the samples
    g: Grasps
    iterate: Iterate
    linear: Linear  #: equations before the step


class Stepped(NamedTuple):
    """Result of a step of Newton's method."""

    iterate: Iterate
    error: Array  #: (n,) largest residual before the step, in tolerances [-]
    motion: Array  #: (n,) largest motion since the tubes were linearised [m]


def linearize_at(g: Grasps, at: Iterate) -> Linear:
    """
    Return the linear equations of samples with one layout of the tubes.

    Straight tubes are linearised without loads; without forces, these are guessed.
    """
    unknowns, members = at.unknowns, g.contacts.members
    if at.bent.nodes.any():
        pushes = Pushes.of(g, unknowns)
        tubes = BentTubes.of(g.structure, members, g.lines, at.bent, pushes.loads)
        return linearize_grasps(g, unknowns, tubes, pushes)
    none = np.zeros((len(unknowns), 3 * len(members)))
    tubes = BentTubes.of(g.structure, members, g.lines, at.bent, none)
    if not unknowns[:, g.places.normal].any():
        unknowns = unknowns.copy()
        guess_forces(g, unknowns, tubes)
    return linearize_grasps(g, unknowns, tubes, Pushes.of(g, unknowns))


def step(g: Grasps, linear: Linear, max_turn: float = USUAL.turn) -> Stepped:
    """Return samples after a bounded step of Newton's method; not finite if singular."""
    indices, unknowns, residual = g.places, linear.unknowns, linear.residual
    sizes = np.abs(residual)
    squeeze = np.abs(unknowns[:, indices.normal]).sum(axis=-1, keepdims=True)
    sizes[:, indices.balance] *= LENGTH_TOLERANCE / (FORCE_TOLERANCE * squeeze)
    change = -solve_each(linear.jacobian, residual[..., None])[..., 0]
    # The motion of the centroid does not depend on the frame of the object.
    centroid = np.exp(1j * unknowns[:, ANGLE]) * g.bodies.shape.centroid
    shift = np.abs(change[:, 0] + 1j * change[:, 1] + 1j * centroid * change[:, ANGLE])
    lengths = np.maximum(shift, np.abs(change[:, indices.feet]).max(axis=-1)) / g.bodies.arm
    turns = np.abs(change[:, indices.turns]).max(axis=-1)
    change /= np.maximum(np.maximum(lengths, turns) / max_turn, 1.0)[:, None]
    unknowns = unknowns + change
    bent, motion = linear.tubes.moved(linear.loads_after(change), unknowns[:, indices.feet])
    return Stepped(Iterate(unknowns, bent), sizes.max(axis=-1) / LENGTH_TOLERANCE, motion)


@np.errstate(all='ignore')
def find_equilibria(
    g: Grasps,
    begin: Iterate,
    accuracy: Accuracy = SETTLED,
    pace: Pace = USUAL,
    tubes: BentTubes | None = None,
) -> list[Found]:
    """
    Return the equilibria of samples with the same contacts; those without one are left out.

    Each step linearises object and tubes. Tubes of a single sample that have moved by less than
    the motion of the accuracy are linearised already; so are those of the first step, if given.
    """
    found: list[Found] = []
    numbers, at = np.arange(len(begin.unknowns)), begin
    keeps_tubes = len(numbers) == 1 and accuracy.motion >= BEYOND_MOTION
    first, least = np.full((2, len(numbers)), np.inf)
    for number in range(pace.steps):
        going: list[tuple[Indices, Iterate]] = []
        for rows, of_g, start in by_layout(g, at):
            for _ in rows:
                count_work()
            if tubes is None:
                linear = linearize_at(of_g, start)
            else:
                pushes = Pushes.of(of_g, start.unknowns)
                linear = linearize_grasps(of_g, start.unknowns, tubes, pushes)
            after = step(of_g, linear, pace.turn)
            unknowns, indices = after.iterate.unknowns, of_g.places
            loads = np.abs(unknowns[:, indices.normal]).max(axis=-1)
            is_valid = np.isfinite(unknowns).all(axis=-1) & (loads <= MAX_LOAD)
            is_near = after.motion <= accuracy.motion
            is_beyond = ~are_on_members(of_g, unknowns) & (after.motion <= BEYOND_MOTION)
            ends = is_valid & (is_near & (after.error <= accuracy.error) | is_beyond)
            folds = np.abs(unknowns[:, indices.inclinations]).max(axis=-1) > MAX_INCLINATION
            found += _choose(Found(numbers[rows], of_g, after.iterate, linear), ends & ~folds)
            if number == 0:
                first[rows] = after.error
            least[rows] = np.minimum(least[rows], after.error)
            goes_on = is_valid & ~ends
            if number >= pace.patience:
                goes_on &= least[rows] <= HOPELESS_SHARE * first[rows]
            going += _choose((rows, after.iterate), goes_on)
            tubes = linear.tubes if keeps_tubes and is_near[0] else None
        if not going:
            break
        rows, at = _gather(going)
        if len(rows) < len(numbers):
            numbers, g, first, least = take((numbers, g, first, least), rows)
    return found


@np.errstate(all='ignore')
def finish(g: Grasps, at: Iterate) -> list[Found]:
    """Return equilibria after one or two more steps, so that the tubes are linearised at them."""
    finished, numbers = list[Found](), np.arange(len(at.unknowns))
    for largest in (EXACT_MOTION, np.inf):
        going: list[tuple[Indices, Iterate]] = []
        for rows, of_g, start in by_layout(g, at):
            for _ in rows:
                count_work()
            linear = linearize_at(of_g, start)
            after = step(of_g, linear)
            is_moved = after.motion > largest
            found = Found(numbers[rows], of_g, after.iterate, linear)
            finished += _choose(found, ~is_moved)
            going += _choose((rows, after.iterate), is_moved)
        if not going:
            break
        rows, at = _gather(going)
        numbers, g = (numbers, g) if len(rows) == len(numbers) else take((numbers, g), rows)
    return finished


def _gather(going: list[tuple[Indices, Iterate]]) -> tuple[Indices, Iterate]:
    """Return samples of several groups together, in ascending order of their numbers."""
    if len(going) == 1:
        return going[0]
    rows, at = join(going)
    return take((rows, at), np.argsort(rows))


def by_layout(g: Grasps, at: Iterate) -> Iterator[tuple[Indices, Grasps, Iterate]]:
    """Yield numbers, constants and iterates of the samples of each layout of the tubes."""
    numbers = np.arange(len(at.unknowns))
    if len(numbers) == 1:
        yield numbers, g, at
        return
    cuts = Cuts.of(g.structure, g.contacts.members, at.bent.places)
    for rows in group_samples(g.structure, cuts):
        group = (numbers, g, at) if rows is None else take((numbers, g, at), rows)
        bent = group[2].bent.joined(group[1].structure)
        yield group[0], group[1], group[2]._replace(bent=bent)


def are_on_members(g: Grasps, unknowns: Array) -> Flags:
    """Return whether all contacts (n,) are between the ends of their members."""
    feet = unknowns[:, g.places.feet]
    return ((feet >= 0.0) & (feet <= g.lines.length)).all(axis=-1)


def _choose(record: T, chosen: Flags) -> list[T]:
    """Return the record of chosen samples in a list, which is empty if none is chosen."""
    flags = chosen.tolist()
    if all(flags):
        return [record]
    return [take(record, np.flatnonzero(chosen))] if any(flags) else []
