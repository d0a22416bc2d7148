# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Uncertainty of the parameters of a grasp, and the probability that the object is held."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
import math
from typing import Any

from isotruss_ros.core.chance.criteria import rest_criteria
from isotruss_ros.core.chance.drawn_grips import chance_gradient, draw_held
from isotruss_ros.core.chance.first_order import Chance, chance_of, find_failure, path_criteria
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.grasp_gradient import GraspGradient
from isotruss_ros.core.holding.held_gradient import GraspParameters
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.robot_schema import find_faults
from isotruss_ros.core.model.safe_yaml import parse_yaml
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np
import scipy


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """
    Standard deviations of the parameters of a grasp, normally distributed.

    Pressures and roller offsets of different tubes and rollers are independent. The defaults are
    those of a robot that was inflated, but not calibrated (docs/chance.md).

    :ivar friction: of the coefficient of friction [-].
    :ivar stiffness: of the robot's stiffness relative to the model [-].
    :ivar pressure: of each tube's gauge pressure relative to its value [-].
    :ivar roller_offset: of the offset of each roller [m].
    :ivar position: of x and y of the object's given pose [m].
    :ivar angle: of the object's given angle [rad].
    :ivar size: of the object's size relative to its value [-].
    :ivar mass: of the object's mass relative to its value, which scales the external wrench [-].
    :ivar force: of the external force along x and y [N].
    :ivar moment: of the external moment [N m].
    :ivar offset_covariance: (r, r) covariance of the roller offsets in the order of
        `Robot.roller_names` [m^2], which replaces `roller_offset`; None: uncorrelated.
    :raises GraspError: a value is out of range, see docs/robot_file.md.
    """

    friction: float = 0.1
    stiffness: float = 0.3
    pressure: float = 0.05
    roller_offset: float = 0.01
    position: float = 0.001
    angle: float = math.radians(0.5)
    size: float = 0.005
    mass: float = 0.1
    force: float = 0.0
    moment: float = 0.0
    offset_covariance: Array | None = None

    def __post_init__(self) -> None:
        """Check the values."""
        _check_block({name: getattr(self, name) for name in NAMES})
        if self.offset_covariance is None:
            return
        count = len(self.offset_covariance)
        what = 'offset_covariance [m^2]'
        flat = finite_array(np.ravel(self.offset_covariance), count**2, what, GraspError)
        matrix = flat.reshape(count, count)
        if np.linalg.eigvalsh(matrix)[0] < -1e-12 or not np.allclose(matrix, matrix.T):
            raise GraspError(f'{what}: must be symmetric, with eigenvalues that are not negative')
        object.__setattr__(self, 'offset_covariance', matrix)

    @classmethod
    def of(
        cls,
        robot: Mechanism,
        body: ConvexObject | None = None,
        block: Mapping[str, float] | str = '',
    ) -> Uncertainty:
        """
        Return the uncertainty that files describe.

        Values of the given block precede those of the object, of the robot file's block
        `uncertainty`, and of its block `calibration`.

        :param robot: the robot.
        :param body: the object; None: unknown.
        :param block: keys and values, or a YAML text with them.
        :raises GraspError: a key is unknown, or a value is out of range.
        """
        calibration, given = robot.description.calibration, block
        if isinstance(given, str):
            given = parse_yaml('uncertainty', given or '{}', 'uncertainties', GraspError)
        described = {} if body is None else body.uncertainty or {}
        values: dict[str, Any] = {}
        for source in (robot.description.uncertainty, described, given):
            _check_block(source)
            values.update(source)
        if 'stiffness_deviation' in calibration:
            values.setdefault('stiffness', calibration['stiffness_deviation'])
        if 'zero_deviations' in calibration and 'roller_offset' not in values:
            deviations = calibration['zero_deviations']
            offsets = [deviations.get(name, 0.0) for name in robot.roller_names]
            values['offset_covariance'] = np.diag(np.square(offsets))
        return cls(**values)

    def covariance(self, grip: HeldGrip, change: Array | float = 0.0) -> Array:
        """
        Return the covariance of the p parameters of a grasp, see `core.chance.criteria`.

        :param grip: equilibrium of the grasp.
        :param change: (p,) changes of the parameters.
        """
        columns = GraspParameters.of(grip.config)
        change = np.broadcast_to(change, columns.size + 1)
        spread = np.zeros(columns.size + 1)
        spread[columns.rollers] = self.roller_offset
        spread[columns.place] = self.position, self.position, self.angle
        pressures = grip.statics.bent.structure.pressures + change[columns.pressures]
        spread[columns.pressures] = self.pressure * pressures
        spread[columns.friction], spread[columns.stiffness] = self.friction, self.stiffness
        spread[columns.wrench] = self.force, self.force, self.moment
        spread[-1] = self.size
        covariance = np.diag(spread**2)
        if self.offset_covariance is not None:
            if self.offset_covariance.shape != 2 * (columns.rollers.stop,):
                raise GraspError(
                    f'offset_covariance {self.offset_covariance.shape}: must be a square matrix '
                    f'with a row for each of the {columns.rollers.stop} rollers'
                )
            covariance[columns.rollers, columns.rollers] = self.offset_covariance
        weight = self.mass * (grip.wrench * (1.0, 1.0, grip.arm) + change[columns.wrench])
        covariance[columns.wrench, columns.wrench] += np.outer(weight, weight)
        return covariance

    @single_threaded
    def chance(
        self,
        settled: SettledGrasp,
        samples: int | None = None,
        seed: int = 0,
        on_progress: Callable[[float], None] | None = None,
    ) -> Chance:
        """
        Return the probability that the object is held.

        :param settled: the grasp.
        :param samples: number of equilibria with random parameters; 0: to first order; None: to
            first order, or with 200 samples (standard error below 0.036) if a face is in contact
            or a corner may gain contact.
        :param seed: seed of the random parameters.
        :param on_progress: function that is called with the completed fraction, 0 to 1.
        :raises GraspError: the equilibrium is neutral, or was computed with the paper's model.
        """
        if settled.equilibrium is None:
            return Chance(0.0, 'no equilibrium', settled.hold.value, {}, reliability=-math.inf)
        criteria, _ = rest_criteria(settled.equilibrium, settled.friction)
        covariance = self.covariance(settled.equilibrium)
        failure = find_failure(criteria, covariance)
        chance = chance_of(failure, covariance, settled.equilibrium)
        if samples is None:
            # A drawn pose may be nearer to an equilibrium on another face. Of 22 boxes, first
            # order errs by 0.13 to 0.43 in the three within three deviations of a change.
            faces = settled.equilibrium.contacts.at_faces
            samples = 200 if faces.any() or failure.change_sigmas < 3.0 else 0
        if isinstance(samples, bool) or not isinstance(samples, int) or samples < 0:
            raise GraspError(f'samples {samples!r}: must be an integer, not negative')
        if not samples:
            return chance
        held = draw_held(settled, covariance, samples, seed, on_progress)
        return replace(
            chance,
            probability=float(held.mean()),
            method='samples',
            standard_error=float(held.std() / math.sqrt(len(held))),
            reliability=float(scipy.special.ndtri(held.mean())),
        )

    @single_threaded
    def path_chance(self, friction: float, grips: Sequence[HeldGrip], load: HeldGrip) -> Chance:
        """
        Return the chance to first order that the object is held along a path.

        :param friction: coefficient of friction [-].
        :param grips: equilibria along the path; the first one has an unknown contact history.
        :param load: equilibrium under the largest external wrench.
        """
        covariance = self.covariance(load)
        failure = find_failure(path_criteria(grips, friction), covariance)
        return chance_of(failure, covariance, load)

    @single_threaded
    def chance_gradient(self, gradient: GraspGradient) -> Array:
        """
        Return the derivatives (p + 1,) of the probability to first order.

        The first p are by the parameters of the gradient, the last one by the relative size of the
        object. In a symmetric grasp without load, the probability is not differentiable by the
        load.

        :param gradient: derivatives of the grasp.
        """
        grip = gradient.settled.equilibrium
        if grip is None:
            return np.zeros(gradient.parameters.size + 1)
        return chance_gradient(gradient.settled, lambda change: self.covariance(grip, change))


def _check_block(block: Mapping[str, float]) -> None:
    for fault in find_faults(block, 'uncertainty'):
        raise GraspError(f'uncertainty: {fault}')


NAMES = tuple(field.name for field in fields(Uncertainty) if field.type == 'float')
