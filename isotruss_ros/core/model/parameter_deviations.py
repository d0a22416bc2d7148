# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records of uncertain parameters of a grasp, and of the probability that the object is held."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence, Sized
from dataclasses import dataclass, fields
import math
from typing import Any

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.robot_schema import find_faults
from isotruss_ros.core.numerics.arrays import Array, covariance_matrix
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.numerics.tolerances import EPSILON
import numpy as np
import scipy

COVARIANCE = 'offset_covariance [m^2]'


@dataclass(frozen=True, eq=False, repr=False)
class Chance(Record, headline=('probability', 'method', 'limit', 'shares', 'standard_error')):
    """Probability that an object is held although parameters are uncertain."""

    probability: float  #: probability that the object is held
    method: str  #: `first order` or `samples`
    #: most probable violation, for example `slip at south/P-Q`; the nominal hold status in words
    #: without a nominal equilibrium
    limit: str
    #: shares of the quantities in the variance of this criterion to first order, largest first;
    #: zeros without any deviation, empty without a nominal equilibrium [-]
    shares: dict[str, float]
    #: standard error of a probability from samples, positive also if all agree; to first order its
    #: error as estimated by `first_order_error`, NaN if not estimated [-]
    standard_error: float = math.nan
    reliability: float = 0.0  #: standard normal quantile of the probability; larger is better [-]


@dataclass(frozen=True, eq=False, repr=False)
class ParameterDeviations(Record):
    """Standard deviations of the parameters of a grasp; see `core.Uncertainty`."""

    friction: float | tuple[float, float] = 0.1
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
        """Raise GraspError if a value is out of range."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        offsets = values.pop('offset_covariance')
        if isinstance(self.friction, Sequence):
            values['friction'] = list(self.friction)  # as in a file
        for fault in find_faults(values, 'uncertainty'):
            raise GraspError(f'uncertainty: {fault}')
        if isinstance(self.friction, Sequence):
            smallest, largest = self.friction
            if smallest > largest:
                raise GraspError(
                    f'uncertainty: friction: {self.friction}: must be the smallest coefficient, '
                    'then the largest'
                )
            object.__setattr__(self, 'friction', (float(smallest), float(largest)))
        if offsets is not None:
            count = len(offsets) if isinstance(offsets, Sized) else 0
            covariance_matrix(offsets, count, COVARIANCE, GraspError)

    @property
    def friction_deviation(self) -> float:
        """Return the standard deviation of the coefficient of friction [-]."""
        if isinstance(self.friction, tuple):
            return (self.friction[1] - self.friction[0]) / math.sqrt(12.0)
        return self.friction

    def mean_friction(self, friction: float) -> float:
        """
        Return the mean coefficient of friction [-].

        :param friction: coefficient of friction of the grasp, if none was measured [-].
        """
        return 0.5 * sum(self.friction) if isinstance(self.friction, tuple) else friction

    def _friction_suffices(self, friction: float, required: Array) -> Array:
        """Return the probabilities (s,) that friction is at least the required friction."""
        if not isinstance(self.friction, tuple):
            return scipy.special.ndtr((friction - required) / max(self.friction, EPSILON))
        smallest, largest = self.friction
        if smallest == largest:
            return (required <= largest).astype(float)
        return np.clip((largest - required) / (largest - smallest), 0.0, 1.0)

    @abstractmethod
    def chance(
        self,
        settled: Any,
        samples: int | None = None,
        seed: int = 0,
        on_progress: Callable[[float], None] | None = None,
    ) -> Chance:
        """Return the probability that the object of a settled grasp is held."""

    @abstractmethod
    def chance_gradient(self, gradient: Any) -> Array:
        """Return the derivatives (p + 1,) of the chance to first order."""
