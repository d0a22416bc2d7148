# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Contact of flattening tubes, solved with points that are refined in the contact regions.

Contact forces and lengths converge fast with the spacing of the points. Closure by friction
depends on the pressure distribution within each region; its error is inversely proportional to the
square of the number of points in the smallest region. Therefore the regions are first found with
few points. The final points have a sufficiently small spacing and are inside the regions only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

from isotruss_ros.core.contact.contact import estimate_contact
from isotruss_ros.core.contact.contact_points import (
    ContactPoints,
    ContactState,
    find_contact_points,
)
from isotruss_ros.core.contact.flattening import Flattening
from isotruss_ros.core.contact.grasp_analysis import SolvedContact
from isotruss_ros.core.contact.surfaces import Surface
from isotruss_ros.core.errors import IsotrussError, SolverError, StructureError
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.numerics.arrays import Array, Flags, Points
from isotruss_ros.core.numerics.tolerances import COINCIDENCE, MAX_SEARCH_STEPS, ROUNDING
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.structure import Structure
from isotruss_ros.core.statics.tangent import TUBE_CURVATURE
import numpy as np

#: Spacing of the points with which regions are searched, and extent of points to both sides of a
#: region, relative to the final spacing [-].
SEARCH_SPACING = 2.0
#: Number of points that a contact region should have, and divisors of the spacing for this [-].
REGION_POINTS = 10
DIVISIONS = (1, 2, 4)
#: Largest relative change of a region's length by halving the spacing [-].
LENGTH_SPREAD = 0.02
ALL_PLACES = np.array([-np.inf, np.inf])
#: The iteration for the bent tubes ends if the next motion is expected below this bound, relative
#: to the displacements of the skin [-]. For different initial guesses, the forces then differ by
#: at most 3e-6, since the gaps of contacts are closed to `ROUNDING`.
SETTLED_SHARE = 5e-8
#: Fractions of the tubes' bending by the contact forces, tried one after another [-].
BENT_SHARES = (1.0, 0.5, 0.2, 0.0)

#: Solver of (8) for points and a surface, with optional initial forces and normals.
ContactSolver = Callable[..., ContactState]
Found = TypeVar('Found')


def refine_contact(
    structure: Structure,
    surface: Surface,
    spacing: float,
    flattening: Flattening,
    solver: ContactSolver,
    previous: SolvedContact | None = None,
    budget: int | None = None,
) -> SolvedContact:
    """
    Solve the contact of flattening tubes with points refined in the contact regions.

    :param structure: structural model of the robot.
    :param surface: surface of the object.
    :param spacing: largest spacing of the points along the tubes [m].
    :param flattening: local compliance of the tubes.
    :param solver: `solve_contact`, `solve_sliding_contact` or `relax_contact`.
    :param previous: contact of a similar grasp, whose regions are the first estimate; None: the
        regions are searched.
    :param budget: largest number of points, which limits how far the spacing is divided; None: the
        shortest region alone determines the division.
    :return: the contact, with points from one spacing before to one spacing behind each contact
        region. Without contact, the points are on all tubes that the object can touch.
    :raises SolverError: the contact problem was not solved.
    """
    search = _Search(structure, surface, spacing, flattening, solver, budget)
    try:
        return search.refine(previous)
    except (SolverError, StructureError) as error:
        return _press_in(search, error, 0.5 if previous is None else 1.0)


def _press_in(search: _Search, refused: IsotrussError, step: float) -> SolvedContact:
    """
    Solve a deep contact by pressing the object into the tubes in steps.

    The skin of the tubes is first moved away from the object, and then back in steps. Objects
    deeper than a tube's diameter are refused at once.

    :param refused: error of the solution without steps.
    :param step: first step as a fraction of the object's depth in the tubes [-].
    """
    flattening = search.flattening
    config = search.structure.config
    depths = member_depths(config, search.surface.body)
    depth, deepest = float(depths.max()), config.robot.member_names[int(depths.argmax())]
    reached, before = 0.0, None
    for _ in range(MAX_SEARCH_STEPS if 0.0 < depth <= 2.0 * flattening.radius else 0):
        thinner = replace(flattening, radius=flattening.radius - (1.0 - reached - step) * depth)
        pressed = replace(search, flattening=thinner, steady=True)
        try:
            before = pressed.refine(before)
        except (SolverError, StructureError):
            step *= 0.5
            continue
        reached += step
        if reached == 1.0:
            return before
        step = min(2.0 * step, 1.0 - reached)
    if reached == 0.0:
        raise refused
    raise SolverError(
        f'{deepest}: the structure becomes unstable under the object before it is '
        f'{1e3 * depth:.3g} mm deep in the tubes; place it farther out'
    ) from refused


def measure_contact(
    contact_points: ContactPoints, contact: ContactState, count: int
) -> SolvedContact:
    """
    Return a solved contact together with the extent of the contact on each member.

    :param contact_points: candidate contact points.
    :param contact: contact with its forces.
    :param count: number of members.
    """
    spacing = contact_points.spacing
    member, place = contact_points.member, contact_points.place
    # The depth of the dent by each point's own load, minus its gap, is zero where contact ends and
    # is interpolated linearly between the points. In the paper's model there are no dents, and a
    # point in contact represents half a spacing to both sides.
    depth = contact_points.dents.diagonal() * contact.forces - contact.gaps
    touching = contact.forces > 0.0
    joined = member[1:] == member[:-1]
    share = np.full(len(joined), 0.5)
    if contact_points.dents.any():
        crossing = joined & (touching[1:] != touching[:-1])
        inner = np.where(touching[1:], depth[1:], depth[:-1])[crossing]
        outer = np.where(touching[1:], depth[:-1], depth[1:])[crossing]
        share[crossing] = inner / (inner - outer)
    before, after = np.append(0.5, share), np.append(share, 0.5)
    length = np.bincount(member, spacing * touching * (before + after), count)
    spans = np.tile([np.inf, -np.inf], (count, 1))
    np.minimum.at(spans[:, 0], member[touching], (place - spacing * before)[touching])
    np.maximum.at(spans[:, 1], member[touching], (place + spacing * after)[touching])
    return SolvedContact(contact_points, contact, length, spans, np.arange(len(place)))


@dataclass(frozen=True)
class _Search:
    """Iterative solution for the contact of one object; see `refine_contact`."""

    structure: Structure
    surface: Surface
    spacing: float
    flattening: Flattening
    solver: ContactSolver
    budget: int | None
    #: Whether only the previous contact is followed; then the iteration for the bent tubes fails
    #: as soon as a motion is larger than the one before.
    steady: bool = False

    def refine(self, previous: SolvedContact | None) -> SolvedContact:
        """Find the contact regions, refine the points in these regions, and bend the tubes."""
        found, settled, clear = previous, False, True
        if found is not None and not _touched(found.spans).any():
            found = None
        if found is not None:
            found, settled = self.solve(found, limited=True)
            clear = self.budget is not None or _is_division_clear(found.spans, self.spacing)
        if found is None or not (self.steady or (settled and clear)):
            found, settled = self.search(), False
            if not _touched(found.spans).any():
                return self.solve_everywhere()
        for step in range(MAX_SEARCH_STEPS):
            if settled:
                break
            found, settled = self.solve(found, limited=step < MAX_SEARCH_STEPS - 1)
            # The search uses tangents; a tube may touch a tangent without touching the surface.
            touches = self.budget is None or _touched(found.spans).any()
            if not len(found.points.points) or not touches:
                return self.solve_everywhere()
        found = self.bend(found)
        # The points in the result do not depend on the initial guess.
        within = _within(found.points, found.spans + self.room)
        return found._replace(region_points=np.flatnonzero(within))

    def search(self) -> SolvedContact:
        """Solve the contact with few points on all tubes that the object can touch."""
        found = self.find(SEARCH_SPACING * self.spacing, None, estimate_contact)
        if self.budget is None:
            return found
        if _touched(found.spans).any():
            # Tubes do not slide in the estimate, so its forces at corners are far too large.
            found = self.find(SEARCH_SPACING * self.spacing, None, self.solver)
        depths = member_depths(self.structure.config, self.surface.body)
        if (depths[~_touched(found.spans)[:, 0]] > 0.0).any():
            # A corner in contact may be between two points.
            found = self.find(self.spacing / DIVISIONS[-1], None, self.solver)
        return found

    @property
    def room(self) -> Array:
        """Return the offsets (2,) of the first and last point from the ends of a region [m]."""
        return self.spacing * np.array([-1.0, 1.0])

    def solve(self, before: SolvedContact, limited: bool) -> tuple[SolvedContact, bool]:
        """Solve the contact with points around contact regions; return whether they suffice."""
        regions = before.spans

        def begin(points: ContactPoints, surface: Surface) -> ContactState:
            forces = _within(points, regions).astype(float)
            return self.solver(points, surface, forces, _carry_over(before, points))

        division = _division(regions, self.spacing, self.budget)
        windows = self.windows(before, limited, self.spacing / division)
        solved = self._solve_bent(
            before.points,
            before.contact.push,
            lambda bent: self.find(self.spacing / division, windows, begin, bent, before),
        )
        found = solved.spans
        # If a contact has left its window, its member may be in contact elsewhere.
        inside = ((found + self.room - windows) * self.room <= 0.0).all()
        fits = inside and (_touched(found) >= (limited & _touched(regions))).all()
        divided = self.budget is not None or division == _division(found, self.spacing)
        return solved, bool(fits) and divided

    def windows(self, before: SolvedContact, limited: bool, spacing: float) -> Array:
        """Return the intervals (m, 2) of the members in which new points are placed."""
        points, regions = before.points, before.spans
        touched = limited & _touched(regions)
        found = np.where(touched, regions + SEARCH_SPACING * self.room, ALL_PLACES)
        if spacing == points.spacing:
            # If the object moves a little, the number of points remains equal in this window.
            outer = spacing * np.array([-0.5, 0.5])
            for member in np.flatnonzero(touched).tolist():
                places = points.place[points.member == member]
                own = places[[0, -1]] + outer
                if ((regions[member] + self.room - own) * self.room <= 0.0).all():
                    found[member] = own
        return found

    def solve_everywhere(self) -> SolvedContact:
        """Solve the contact with points on all tubes near the object, and bend the tubes."""
        found = self.find(self.spacing, None, self.solver)
        return self.bend(found) if _touched(found.spans).any() else found

    def find(
        self,
        distance: float,
        windows: Array | None,
        solve: ContactSolver,
        bent: BentTubes | None = None,
        before: SolvedContact | None = None,
    ) -> SolvedContact:
        """Place points at the spacing `distance`, see `find_contact_points`; solve the contact."""
        points = find_contact_points(
            self.structure, self.surface, distance, self.flattening, windows, bent
        )
        return self._measure(points, solve(points, self.surface.resolved(distance)))

    def _measure(self, points: ContactPoints, contact: ContactState) -> SolvedContact:
        count = len(self.structure.config.robot.member_names)
        return measure_contact(points, contact, count)

    def _solve_bent(
        self, points: ContactPoints, push: Points, solve: Callable[[BentTubes], Found]
    ) -> Found:
        """Solve the contact with tubes bent by its forces, or by a fraction of them on failure."""
        # Without forces, all fractions are one problem.
        shares = BENT_SHARES[:1] if self.steady or not push.any() else BENT_SHARES
        for share in shares:
            try:
                return solve(points.bend_on(push, share))
            except (SolverError, StructureError):
                if share == shares[-1]:
                    raise
        raise AssertionError

    def bend(self, found: SolvedContact) -> SolvedContact:
        """Solve the contact repeatedly, each time linearised about the last solution."""
        surface, last, quick = self.surface.resolved(found.points.spacing), np.inf, True
        points, contact = found.points, found.contact
        # Sliding tubes turn with the contact, so each step reduces the error only to a tenth.
        least = 1e-3 if self.budget is None else 0.1
        for _ in range(MAX_SEARCH_STEPS):
            distance = points.distance(contact.push)
            ratio = max(TUBE_CURVATURE * distance, least, distance / last)
            reach = np.abs(contact.displacements).max(initial=0.0)
            settled = ratio * distance <= max(SETTLED_SHARE * reach, COINCIDENCE)
            shorter = ratio <= 0.5
            # Very soft structures (1 m/N) move by more than ROUNDING, due to rounding errors of
            # forces.
            rounding = distance <= 1e3 * ROUNDING and not (shorter or quick)
            if settled or rounding:
                return found if points is found.points else self._measure(points, contact)
            if self.steady and distance > last:
                break
            quick, last = shorter, distance

            def solve(
                bent: BentTubes,
                points: ContactPoints = points,
                contact: ContactState = contact,
                quick: bool = quick,
            ) -> tuple[ContactPoints, ContactState]:
                there = points.about(bent)
                found = contact.forces, contact.normals, contact.push
                return there, self.solver(there, surface, *found)

            points, contact = self._solve_bent(points, contact.push, solve)
        raise SolverError(
            f'{self.touching(found)}: no equilibrium of the tubes in {MAX_SEARCH_STEPS} steps '
            f'(the last moved a node by {1e3 * last:.3g} mm); the object is pressed in too '
            'deeply, or the structure becomes unstable under it'
        )

    def touching(self, found: SolvedContact) -> str:
        """Return the names of the members in contact with the object."""
        names = self.structure.config.robot.member_names
        return ', '.join(names[i] for i in np.flatnonzero(_touched(found.spans)))


def _touched(regions: Array) -> Flags:
    """Return a mask (m, 1) that is true for members in contact."""
    return regions[:, 1:] > regions[:, :1]


def _carry_over(before: SolvedContact, points: ContactPoints) -> Points:
    """Return normals at the points, interpolated from the normals of a similar grasp."""
    # The members are placed one after the other on one axis, so far apart that none overlap.
    member, place = (
        before.points.member[before.region_points],
        before.points.place[before.region_points],
    )
    apart = 1.0 + max(place.max(initial=0.0), points.place.max(initial=0.0))
    known, wanted = place + apart * member, points.place + apart * points.member
    normals = before.contact.normals[before.region_points]
    return np.exp(1j * np.angle(np.interp(wanted, known, normals)))


def _division(regions: Array, spacing: float, budget: int | None = None) -> int:
    """Return the divisor of the spacing for the shortest region, or for the budget of points."""
    length = (regions[:, 1] - regions[:, 0])[_touched(regions)[:, 0]]
    if budget is not None:
        points = (length + 2.0 * SEARCH_SPACING * spacing).sum() / spacing
        return next((n for n in reversed(DIVISIONS) if n * points <= budget), DIVISIONS[0])
    shortest = length.min(initial=np.inf)
    enough = REGION_POINTS * spacing / shortest
    return next((n for n in DIVISIONS if n >= enough), DIVISIONS[-1])


def _is_division_clear(regions: Array, spacing: float) -> bool:
    """Return whether `_division` is the same if all regions are longer or shorter by a little."""
    shorter, longer = (
        _division((1.0 + change) * regions, spacing) for change in (-LENGTH_SPREAD, LENGTH_SPREAD)
    )
    return shorter == longer


def _within(points: ContactPoints, regions: Array) -> Flags:
    """Return a mask (c,) that is true for points within the region of their member."""
    first, last = regions[points.member].T
    return (points.place >= first) & (points.place <= last)
