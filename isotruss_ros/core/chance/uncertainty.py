# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Uncertainty of the parameters of a grasp, and the probability that the object is held."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from isotruss_ros.core.chance.first_order_error import first_order_error
from isotruss_ros.core.chance.probability import find_chance, standard_error
from isotruss_ros.core.chance.random_inputs import changed_grip, sample_friction
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.grasp_gradient import GraspGradient, GraspParameters
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.settled_grasp import LostContact, SettledGrasp
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.parameter_deviations import Chance, COVARIANCE, ParameterDeviations
from isotruss_ros.core.model.robot_schema import find_faults
from isotruss_ros.core.model.safe_yaml import parse_yaml
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, check_count, covariance_matrix
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np
import scipy

#: Step of the differences of the probability, in standard deviations [-].
STEP = 3e-4
#: Number of samples where first order is not proved good [-], and largest estimated error of the
#: probability to first order where it is.
SAMPLES, FIRST_ORDER_ERROR = 200, 0.02


@dataclass(frozen=True, eq=False, repr=False)
class Uncertainty(ParameterDeviations):
    """
    Standard deviations of the parameters of a grasp, normally distributed.

    Friction may be given as the smallest and largest coefficient that were measured instead. Then
    it is uniformly distributed between them, whatever the coefficient of the grasp; to first order
    it is normally distributed with the same mean and variance.

    Pressures and roller offsets of different tubes and rollers are independent. The defaults are
    those of a robot that was inflated, but not calibrated (docs/chance.md).

    :ivar friction: of the coefficient of friction, or its smallest and largest value [-].
    :ivar stiffness: of the tubes' EA, EI and GA relative to their values [-].
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

    @classmethod
    @check_kinds
    def of(
        cls,
        robot: Mechanism,
        body: ConvexObject | None = None,
        block: Mapping[str, Any] | str = '',
    ) -> Uncertainty:
        """
        Return the uncertainty that files describe.

        Later values replace earlier ones: block `calibration` of the robot file, its block
        `uncertainty`, the object, the given block.

        :param robot: the robot.
        :param body: the object; None: unknown.
        :param block: keys and values, or a YAML text with them.
        :raises GraspError: a key is unknown, or a value is out of range.
        """
        calibration = robot.description.calibration
        given = block
        if isinstance(given, str):
            given = parse_yaml('uncertainty', given or '{}', 'uncertainties', GraspError)
        values = dict[str, Any](stiffness=calibration.get('stiffness_deviation', cls.stiffness))
        for source in (robot.description.uncertainty, body and body.uncertainty, given):
            for fault in find_faults(source or {}, 'uncertainty'):  # also unknown keys
                raise GraspError(f'uncertainty: {fault}')
            values.update(source or {})
        if 'zero_deviations' in calibration and 'roller_offset' not in values:
            zeros = calibration['zero_deviations']
            variances = [zeros.get(name, 0.0) ** 2 for name in robot.roller_names]
            values['offset_covariance'] = np.diag(variances)
        return cls(**values)

    @check_kinds
    def covariance(self, grip: HeldGrip | LostContact) -> Array:
        """
        Return the covariance of the p parameters of a grasp, see `core.chance.criteria`.

        :param grip: equilibrium of the grasp, or lost contact.
        """
        inputs = grip.inputs
        columns = GraspParameters.of(inputs.config)
        deviations = np.zeros(columns.size + 1)
        deviations[columns.rollers] = self.roller_offset
        deviations[columns.place] = self.position, self.position, self.angle
        deviations[columns.pressures] = self.pressure * np.array(inputs.pressures)
        deviations[columns.friction] = self.friction_deviation
        deviations[columns.stiffness] = self.stiffness * inputs.stiffness
        deviations[columns.wrench] = self.force, self.force, self.moment
        deviations[-1] = self.size
        covariance = np.diag(deviations**2)
        if self.offset_covariance is not None:
            count = columns.rollers.stop
            offsets = covariance_matrix(self.offset_covariance, count, COVARIANCE, GraspError)
            covariance[columns.rollers, columns.rollers] = offsets
        # An error of the mass scales all components of the wrench.
        by_mass = self.mass * inputs.wrench
        covariance[columns.wrench, columns.wrench] += np.outer(by_mass, by_mass)
        return covariance

    @check_kinds
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

        For objects without corners, and without an interval of friction, it is computed to first
        order if exact equilibria within two deviations prove that its error is at most
        `FIRST_ORDER_ERROR`, otherwise from samples.

        :param settled: the grasp.
        :param samples: number of equilibria with random parameters; 0: to first order without
            this proof, as a first guess; None: 200 (standard error below 0.036) where first order
            is not proved good.
        :param seed: seed of the random parameters.
        :param on_progress: function that is called with the completed fraction of the samples, 0
            to 1.
        :raises GraspError: the equilibrium is neutral, there is none to linearise about to first
            order, or an integer is invalid.
        """
        grip = settled.equilibrium
        count = None if samples is None else check_count(samples, 'samples', GraspError)
        seed = check_count(seed, 'seed', GraspError)
        if grip is None and count == 0:
            raise GraspError('samples 0: must be positive, because there is no equilibrium')
        nominal = settled.lost if grip is None else grip
        covariance = self.covariance(nominal)
        if grip is None:
            chance = Chance(0.0, 'samples', settled.hold.value, {})
        else:
            friction = self.mean_friction(settled.friction)
            chance = find_chance([grip], friction, covariance)
            # With corners the proof seldom succeeds, and takes a third of the time of the samples.
            is_provable = not (grip.shape.faces_at(0) or isinstance(self.friction, tuple))
            if count is None and is_provable:
                error = first_order_error(grip, friction, covariance)
                chance = replace(chance, standard_error=error)
                count = 0 if error <= FIRST_ORDER_ERROR else None
            if count == 0:
                return chance
        # Friction is not drawn: its distribution gives the chance of each sample.
        count = SAMPLES if count is None else count
        required = sample_friction(nominal.inputs, covariance, count, seed, on_progress)
        chances = self._friction_suffices(settled.friction, required)
        return replace(
            chance,
            probability=float(chances.mean()),
            method='samples',
            standard_error=standard_error(chances),
            reliability=float(scipy.special.ndtri(chances.mean())),
        )

    @check_kinds
    @single_threaded
    def chance_gradient(self, gradient: GraspGradient) -> Array:
        """
        Return the derivatives (p + 1,) of the chance to first order, the last by the size.

        An interval of friction replaces the coefficient of the grasp, so the derivative by this
        coefficient is zero.

        :param gradient: derivatives of the grasp.
        :raises GraspError: the grasp has no equilibrium about which the chance can be linearised.
        """
        grip, columns = gradient.settled.equilibrium, gradient.parameters
        if grip is None:
            raise GraspError(
                'no gradient of the chance: the grasp has no equilibrium; follow the gradient of '
                'the slip margin until it has'
            )
        rates = np.zeros(columns.size + 1)
        steps = STEP * np.maximum(np.sqrt(np.diag(self.covariance(grip))), 1e-3)
        for k, step in enumerate(np.diag(steps)):  # changes of one parameter
            for change in (step, -step):  # central difference
                moved = changed_grip(grip, change)
                friction = self.mean_friction(gradient.settled.friction + change[columns.friction])
                chance = find_chance([moved], friction, self.covariance(moved))
                rates[k] += chance.probability / (2.0 * change[k])
        return rates
