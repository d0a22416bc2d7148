# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Filter of roller offsets by markers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
import itertools
import math
from typing import Any

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.estimation.grip_belief import condition
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings, SLIP_LENGTH
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.description import DEFAULT_MODULE_MASS
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS
from isotruss_ros.core.statics.deform import sag_rates
import numpy as np
import scipy

# Rejection of wrong joint markers, and detection of slipped rollers from the markers.

#: Probability that valid measurements fail a gate or a comparison [-]. Some twenty independent
#: comparisons per second then have one false alarm in an hour.
FALSE_ALARM_PROBABILITY = 1.5e-5
#: Smallest change of an offset under slip, in standard deviations [-].
SLIP_SIGMAS = -float(scipy.special.ndtri(FALSE_ALARM_PROBABILITY))
#: Smallest change of an offset under slip [m], and as a fraction of the travel [-].
MIN_SLIP, MIN_SLIP_SHARE = 1e-3, 0.01
#: Interval in which offsets are compared [s].
SLIP_SPAN = 4.0


def passes_gate(innovation: Array, covariance: Array) -> bool:
    """Return whether an innovation (m,) with a covariance (m, m) passes the chi-square gate."""
    gate = scipy.special.chdtri(len(innovation), FALSE_ALARM_PROBABILITY)
    return _squared_distance(innovation, covariance) <= gate


def judge_markers(
    innovation: Array, covariance: Array, by_rollers: Array, reach: Array
) -> tuple[Flags, Array]:
    """
    Return the mask (k,) of consistent markers, and the slip (r,) of at most one roller [m].

    If some markers are inconsistent, there are two hypotheses. One roller has slipped by at most
    its travel `reach` (r,) [m]; this must explain all markers. Or some markers are wrong: the
    worst one is rejected repeatedly until the others are consistent; if most are wrong, all are
    rejected.
    """
    count, coordinates = len(innovation), innovation.ravel()
    all_markers = np.ones(count, dtype=bool)
    if passes_gate(coordinates, covariance):
        return all_markers, np.zeros_like(reach)
    # First hypothesis: slip of each roller by weighted least squares, (b^T S^-1 z) / (b^T S^-1 b);
    # the best roller has the smallest residual.
    weighted = np.linalg.solve(covariance, by_rollers)
    information = np.maximum(np.einsum('ij,ij->j', by_rollers, weighted), 1e-12)
    slips = np.diag(np.clip(weighted.T @ coordinates / information, -reach, reach))
    residuals = [coordinates - by_rollers @ slip for slip in slips]
    distances = [_squared_distance(residual, covariance) for residual in residuals]
    best = int(np.argmin(distances))
    is_slip = passes_gate(residuals[best], covariance)
    # Second hypothesis: wrong markers.
    consistent, mean_square = _reject_markers(coordinates, covariance)
    # A slip that explains all markers is more probable than two simultaneous wrong markers. With
    # one wrong marker, the mean squares per degree of freedom decide; the slip uses one degree.
    if count - consistent.sum() == 1:
        is_slip = is_slip and distances[best] / (2 * count - 1) < mean_square
    return (all_markers, slips[best]) if is_slip else (consistent, np.zeros_like(reach))


def _reject_markers(coordinates: Array, covariance: Array) -> tuple[Flags, float]:
    """Return the mask (k,) of consistent markers, and their mean squared distance [-]."""

    def select(markers: Flags) -> tuple[Array, Array]:
        rows = np.flatnonzero(np.repeat(markers, 2))
        return coordinates[rows], covariance[np.ix_(rows, rows)]

    consistent = np.ones(len(coordinates) // 2, dtype=bool)
    while consistent.any() and not passes_gate(*select(consistent)):
        # Masks of the present markers without one of them; the best mask lacks the worst marker.
        masks = consistent & ~np.eye(len(consistent), dtype=bool)[consistent]
        consistent = min(masks, key=lambda markers: _squared_distance(*select(markers)))
    if 2 * consistent.sum() < len(consistent):  # most are wrong, so all are rejected
        return np.zeros_like(consistent), math.inf
    return consistent, _squared_distance(*select(consistent)) / (2 * consistent.sum())


def find_swap(measured: Array, expected: Array, covariance: Array) -> tuple[int, int] | None:
    """Return two markers whose swap makes all markers (k, 2) consistent, or None."""
    for pair in itertools.combinations(range(len(measured)), 2):
        swapped = measured.copy()
        swapped[list(pair)] = measured[list(reversed(pair))]
        if passes_gate((swapped - expected).ravel(), covariance):
            return pair
    return None


def _squared_distance(innovation: Array, covariance: Array) -> float:
    """Return the squared Mahalanobis distance of an innovation (m,) from zero."""
    return float(innovation @ np.linalg.solve(covariance, innovation))


class SlipWatch:
    """Detector of slipping rollers, which compares roller offsets with an earlier estimate."""

    def __init__(self, count: int) -> None:
        self.slipping = np.zeros(count, dtype=bool)  #: (r,) mask of the slipping rollers
        #: Arguments of `add` within `SLIP_SPAN`, in order of time.
        self._history: deque[tuple[float, Array, Array, Array]] = deque()

    def add(self, time: float, travel: Array, offsets: Array, variances: Array) -> None:
        """Update `slipping` with offsets (r,), compared with the offsets `SLIP_SPAN` earlier."""
        self._history.append((time, travel, offsets, variances))
        while time - self._history[0][0] > SLIP_SPAN:
            self._history.popleft()
        _, travel_before, offsets_before, variances_before = self._history[0]
        slip, distance = offsets - offsets_before, travel - travel_before
        is_significant = np.abs(slip) > SLIP_SIGMAS * np.sqrt(variances + variances_before)
        is_large = np.abs(slip) > np.maximum(MIN_SLIP, MIN_SLIP_SHARE * np.abs(distance))
        # A slipping tube lags behind its roller.
        self.slipping = is_significant & is_large & (slip * distance < 0.0)


# Roller offsets from joint markers: gates, iterated Kalman filter, and detection of slip.

#: Probability with which a mean without other errors counts as improbable [-]. With a fifth, an
#: upright robot with three marked joints was noticed in two of three carries.
IMPROBABLE = 0.05
#: Largest standard deviation of an offset, for unknown offsets after a restart of the encoders
#: [m].
MAX_OFFSET_DEVIATION = 0.05
#: Number of successive messages without a consistent marker after which the roller offsets are
#: regarded as unknown [-].
MAX_INCONSISTENT_MESSAGES = 5
#: Acceleration of gravity [m/s^2].
GRAVITY = 9.81
#: Measured positions (x, y) of joints by name [m].
Markers = Mapping[str, tuple[float, float]]
#: Function that returns the joint positions (2j,) [m] and their Jacobian for roller offsets (r,).
JointModel = Callable[[Array], tuple[Array, Array]]
#: Likelihood ratio of an upright to a flat robot below which the markers exclude the upright one,
#: and the largest probability with which they exclude it wrongly [-].
MIN_LIKELIHOOD_RATIO = 0.05
#: Directions of gravity in the robot's plane, (2, 36).
DIRECTIONS = np.array(
    [[math.cos(math.radians(a)), math.sin(math.radians(a))] for a in range(0, 360, 10)]
).T


class OffsetFilter:
    """
    Gaussian belief of roller offsets and constant marker errors, x = (dphi, c, m).

    dphi are the offsets of the r rollers [m]. c consists of the common shift (x, y) of all markers
    [m] and their common rotation about the origin of the robot frame [rad]. m are the mounting
    offsets of the markers from the joints [m]. Inconsistent markers are rejected.

    :ivar findings: names of joints and rollers by the fields `used`, `left_out`, `swapped` and
        `slipping` of `StateEstimate`, as far as there are any.
    """

    def __init__(self, robot: Robot, settings: EstimatorSettings) -> None:
        self._settings, self._count = settings, len(robot.roller_names)
        self._joint_names = robot.topology.joint_names
        self._roller_names = np.array(robot.roller_names)
        joints = len(self._joint_names)
        errors = settings.marker_shift, settings.marker_turn, settings.joint_error
        deviations = np.repeat([settings.zero_deviation, *errors], [self._count, 2, 1, 2 * joints])
        self.mean, self.covariance = np.zeros(len(deviations)), np.diag(deviations**2)
        self._prior = deviations**2
        self._is_measured = np.zeros(2 * joints, dtype=bool)
        self._slips, self._inconsistent = SlipWatch(self._count), 0
        #: test of the weight of an inclined robot, which the state does not contain
        self._upright = UprightTest(_find_sag(robot, settings.inclination), len(deviations))
        self.findings: dict[str, Any] = {}

    @property
    def offsets(self) -> Array:
        """Return the mean of the roller offsets, (r,) [m]."""
        return self.mean[: self._count]

    @property
    def offset_covariance(self) -> Array:
        """Return the covariance matrix of the roller offsets, (r, r) [m^2]."""
        return self._flat_covariance + self._upright.covariance[: self._count, : self._count]

    @property
    def may_be_upright(self) -> bool:
        """Return whether an admitted weight changes an offset by more than its deviation."""
        changes = np.hypot(*self._upright.by_weight[: self._count].T)
        deviations = np.sqrt(np.diag(self.covariance)[: self._count])
        return bool(self._upright.is_admitted and (changes > deviations).any())

    @property
    def _flat_covariance(self) -> Array:
        """Return the covariance (r, r) of the offsets of a robot that lies flat [m^2]."""
        unknown = MAX_OFFSET_DEVIATION if self.is_improbable else 0.0
        return self.covariance[: self._count, : self._count] + unknown**2 * np.eye(self._count)

    @property
    def is_improbable(self) -> bool:
        """
        Return whether the mean is improbable for the prior, as it may be if the robot is upright.

        Then the measured joints have errors that are not in the state.
        """
        is_free = self._prior > 0.0
        squared_distance = (self.mean[is_free] ** 2 / self._prior[is_free]).sum()
        return bool(squared_distance > scipy.special.chdtri(self._is_measured.sum(), IMPROBABLE))

    def predict(self, elapsed: float, travel: Array) -> None:
        """Propagate the covariance by drift and slip; `travel` (r,) is absolute [m]."""
        settings = self._settings
        self.inflate(settings.slip**2 * SLIP_LENGTH * travel + settings.drift**2 * elapsed)

    def inflate(self, variances: Array) -> None:
        """Increase the variances (r,) of the offsets, at most to that of unknown offsets [m^2]."""
        added, present = np.zeros(len(self._prior)), np.diag(self.covariance)[: self._count]
        largest = np.maximum(MAX_OFFSET_DEVIATION**2 - present, 0.0)
        added[: self._count] = np.minimum(variances, largest)
        self._prior, self.covariance = self._prior + added, self.covariance + np.diag(added)

    def expect(self, joints: JointModel, rows: Indices, state: Array) -> tuple[Array, Array]:
        """Return expected marker coordinates `rows` (m,) for a state, and their Jacobian."""
        offsets, shift, angle, mounting = np.split(state, self._count + np.array([0, 2, 3]))
        positions, by_offsets = joints(offsets)
        # All markers are rotated about the origin of the robot frame, wherever the robot is.
        count = len(self._joint_names)
        cosine, sine = math.cos(angle[0]), math.sin(angle[0])
        rotation = np.kron(np.eye(count), [[cosine, -sine], [sine, cosine]])
        rotated = rotation @ positions
        by_shift = np.tile(np.eye(2), (count, 1))
        by_angle = rotated.reshape(-1, 2) @ [[0.0, 1.0], [-1.0, 0.0]]  # (-y, x)
        expected = rotated + by_shift @ shift + mounting
        rates = [rotation @ by_offsets, by_shift, by_angle.ravel(), np.eye(2 * count)]
        return expected[rows], np.column_stack(rates)[rows]

    def update(self, measured: Array, noise: Array, rows: Indices, joints: JointModel) -> None:
        """Update the state with measured coordinates (m,) in `rows` by Gauss-Newton steps."""
        iterate, covariance = self.mean, self.covariance
        for _ in range(MAX_SEARCH_STEPS):
            expected, rates = self.expect(joints, rows, iterate)
            gain, _, covariance = condition(self.covariance, rates, noise)
            # Innovation at the prior mean, to first order from the iterate.
            innovation = measured - expected - rates @ (self.mean - iterate)
            previous, iterate = iterate, self.mean + gain @ innovation
            if (np.abs(iterate - previous) <= np.sqrt(np.diag(covariance))).all():
                break
        innovation_covariance = rates @ self.covariance @ rates.T + noise
        self._upright.add(rows, rates, gain, innovation, innovation_covariance)
        self.mean, self.covariance = iterate, covariance
        self._is_measured[rows] = True

    def take_markers(
        self,
        time: float,
        markers: Markers,
        deviation: float,
        readings: Array,
        reach: Array,
        joints: JointModel,
    ) -> bool:
        """
        Update the offsets with a message of markers; return whether at least one was used.

        The encoder readings (r,) are those at this time; `reach` (r,) is the range of recent
        readings, by which a roller can have slipped [m].
        """
        # Measured and expected coordinates, and the covariance of the innovation.
        names = np.array(list(markers))
        first_rows = 2 * np.array([self._joint_names.index(name) for name in markers])
        rows = np.column_stack([first_rows, first_rows + 1]).ravel()  # x and y of each marker
        measured = np.array(list(markers.values()), dtype=float)
        coordinates, rates = self.expect(joints, rows, self.mean)
        expected = coordinates.reshape(-1, 2)
        by_offsets = rates[:, : self._count]
        encoder_noise = self._settings.encoders**2 * by_offsets @ by_offsets.T
        noise = deviation**2 * np.eye(len(rows)) + encoder_noise
        covariance = rates @ self.covariance @ rates.T + noise

        # Selection of consistent markers; a slip makes the offset of its roller uncertain.
        is_used, slip = judge_markers(measured - expected, covariance, by_offsets, reach)
        self.inflate(slip**2)
        swap = None if is_used.all() else find_swap(measured, expected, covariance)
        swapped_names = () if swap is None else names[list(swap)].tolist()
        self.findings['used'] = tuple(sorted(names[is_used].tolist()))
        self.findings['left_out'] = tuple(sorted(names[~is_used].tolist()))
        self.findings['swapped'] = tuple(sorted(swapped_names))

        # After several inconsistent messages, as after a restart of the encoders, the offsets are
        # unknown.
        self._inconsistent = 0 if is_used.any() or swapped_names else self._inconsistent + 1
        if self._inconsistent >= MAX_INCONSISTENT_MESSAGES:
            self.inflate(np.full(self._count, np.inf))
            self._inconsistent = 0
        if not is_used.any():
            return False

        # Update by the consistent markers, and detection of slipping rollers.
        used = np.flatnonzero(np.repeat(is_used, 2))  # indices of coordinates
        self.update(measured.ravel()[used], noise[np.ix_(used, used)], rows[used], joints)
        variances = np.diag(self._flat_covariance) + self._settings.joint_error**2
        self._slips.add(time, readings, self.offsets, variances)
        self.findings['slipping'] = tuple(self._roller_names[self._slips.slipping].tolist())
        return True


def _find_sag(robot: Robot, inclination: float) -> Array:
    """Return the displacements (2j, 2) of the joints by weight in x and y at an inclination."""
    description, joints = robot.description, robot.topology.joint_names
    tube_mass = description.mass_per_length * robot.home.member_lengths.sum()
    module_mass = description.module.mass or DEFAULT_MODULE_MASS
    mass = module_mass + tube_mass / len(robot.module_names)
    weight = GRAVITY * mass * math.sin(inclination)
    if weight == 0.0:
        return np.zeros((2 * len(joints), 2))
    try:
        return weight * sag_rates(robot.home, joints)
    except StructureError:  # a mechanism would collapse under its weight
        return np.zeros((2 * len(joints), 2))


class UprightTest:
    """
    Sequential test of a constant bias of a Kalman filter, the weight w (2,) in the robot's plane.

    The filter neglects weight, so the offsets absorb a part of the sag of the joints. With three
    markers and offsets of 10 mm they absorb all of it: then no statistic of the markers detects an
    upright robot. So its weight increases the stated covariance of the offsets until the
    likelihood ratio of an upright and a flat robot excludes it.

    The unit of the weight is the largest possible one, that of an upright robot.

    :ivar is_admitted: whether weight changes the mean, and the markers do not exclude it.
    :ivar by_weight: (n, 2) derivatives of the filter's mean by the weight.
    :ivar covariance: (n, n) covariance of the mean's error by a weight that is not excluded.

    :param sag: (2j, 2) displacements of the joints by the weight [m].
    :param size: number n of states of the filter.
    """

    def __init__(self, sag: Array, size: int) -> None:
        self._sag = sag
        # Information and score of the weight in the innovations.
        self._information, self._score = np.zeros((2, 2)), np.zeros(2)
        self.is_admitted = False
        self.by_weight, self.covariance = np.zeros((size, 2)), np.zeros((size, size))

    def add(
        self, rows: Indices, rates: Array, gain: Array, innovation: Array, covariance: Array
    ) -> None:
        """
        Add an update of the filter by marker coordinates `rows` (m,), with the gain (n, m).

        :param rates: (m, n) Jacobian of the coordinates by the state.
        :param innovation: (m,) innovation with this `covariance` (m, m).
        """
        if not self._sag.any():
            return
        change = self._sag[rows] - rates @ self.by_weight  # of the innovation by the weight
        weighted = np.linalg.solve(covariance, change)
        self._information = self._information + change.T @ weighted
        self._score = self._score + weighted.T @ innovation
        self.by_weight = self.by_weight + gain @ change
        squares = (DIRECTIONS * (self._information @ DIRECTIONS)).sum(axis=0)
        log_ratio = (self._score @ DIRECTIONS - 0.5 * squares).max()
        is_possible = log_ratio > math.log(MIN_LIKELIHOOD_RATIO)
        self.is_admitted = bool(is_possible and self.by_weight.any())
        if not self.is_admitted:
            self.covariance = np.zeros_like(self.covariance)
            return
        # Second moment of the weight, with its largest value as prior deviation.
        spread = np.linalg.inv(self._information + np.eye(2))
        mean = spread @ self._score
        moment = spread + np.outer(mean, mean)
        self.covariance = self.by_weight @ moment @ self.by_weight.T
