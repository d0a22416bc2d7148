# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of `settle_grasp` and `settle_grasps`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
import math
from typing import Any

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.holding.friction_range import find_friction_range, FrictionRange
from isotruss_ros.core.holding.grip_response import slip_planes
from isotruss_ros.core.holding.held_grip import GraspInputs, HeldGrip, HoldStatus, scaled_wrench
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.model.parameter_deviations import Chance
from isotruss_ros.core.model.parameter_deviations import ParameterDeviations as Uncertainty
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, Flags
from isotruss_ros.core.numerics.records import as_plain, Record
import numpy as np

# Result of `settle_grasp`, with an equilibrium or without.
#
# Without equilibrium the slip margin is continued to negative values, so that its gradient leads
# an optimiser back to contact. Its absolute value is the norm of the unbalanced external wrench
# plus p R g, for tubes of radius R and pressure p at the gap g to the object. A tube that is
# pressed in by g exerts about the force p R g.


@dataclass(frozen=True, eq=False)
class LostContact:
    """Grasping members that do not hold an object, with the members' gaps to the object."""

    inputs: GraspInputs  #: grasp without an equilibrium, or with members that do not press
    stiffness: float  #: p R, the tubes' mean pressure times their radius [N/m]
    distances: Array  #: (k,) gaps of the members [m]
    by_nodes: Array  #: derivatives of the gaps by the nodes' coordinates
    by_pose: Array  #: (k, 3) derivatives of the gaps by the object's pose

    @classmethod
    def of(cls, inputs: GraspInputs) -> LostContact:
        """Return the gaps of given members, or of the two members nearest to the object."""
        config, body, members = inputs.config, inputs.body, inputs.members
        if members is None:
            members = np.argsort(member_depths(config, body), kind='stable')[-2:]
        diameter = config.robot.description.tube_diameter
        stiffness = 0.5 * diameter * np.mean(inputs.pressures)
        distances = collision_model(config.robot).body_distances(config, body, members)
        return cls(inputs, float(stiffness), *distances)

    @property
    def gap(self) -> float:
        """Return the root mean square of the members' gaps [m]."""
        return float(np.sqrt(np.mean(self.distances**2)))

    @property
    def slip_margin(self) -> float:
        """Return the negative slip margin of lost contact, see this module [N]."""
        wrench = scaled_wrench(self.inputs.wrench, self.inputs.body.arm)
        return -float(np.linalg.norm(wrench)) - self.stiffness * self.gap

    def slip_margin_rates(self) -> tuple[Array, Array]:
        """Return the derivatives of `slip_margin` by roller travel (r,) and object pose (3,)."""
        by_gaps = -self.stiffness * self.distances
        by_gaps /= max(self.gap * len(self.distances), np.finfo(float).tiny)
        by_nodes = by_gaps @ self.by_nodes
        return by_nodes @ self.inputs.config.node_jacobian, by_gaps @ self.by_pose


@dataclass(frozen=True, eq=False, repr=False)
class SettledGrasp(
    Record,
    headline=('hold', 'normal_forces', 'friction_forces', 'required_friction', 'slip_margin'),
):
    """
    Equilibrium of a free object between two or three members, with friction on the tubes.

    Without an equilibrium the pose is the given pose, the forces are zero, and the slip margin is
    negative and computed from the gaps between members and object, see `LostContact`.

    For an unknown contact history, the distribution of forces with the least friction is assumed.
    The friction that a contact uses may be larger, but when friction or loads change slowly, it is
    redistributed before the object is lost. So `held`, `required_friction` and `slip_margin` are
    best cases for sudden changes, see `friction_range`.
    """

    hold: HoldStatus  #: hold status
    reason: str  #: hold status in words; empty if the object is held
    given: Pose  #: given pose of the object, robot frame [m, rad]
    friction: float  #: coefficient of friction between tube and object
    #: equilibrium of the object; None if none was found
    equilibrium: HeldGrip | None = field(default=None, repr=False)
    #: gaps of the members to the object; None with an equilibrium
    lost: LostContact | None = field(default=None, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for pickling, with the equilibrium of this grasp only."""
        state = {name: getattr(self, name) for name in self.__dataclass_fields__}
        if self.equilibrium is not None:
            state['equilibrium'] = HeldGrip(self.equilibrium.alone.judged(True))
        return state

    @property
    def held(self) -> bool:
        """Return whether the object is held; if not, `hold` names the violated condition."""
        return self.hold is HoldStatus.HELD

    @property
    def force_closure(self) -> bool:
        """
        Return whether contact forces within the friction cones balance the free object.

        The forces follow from the statics of the robot near the given pose. The result may be true
        although a tube wrinkles, another member is in contact, or the equilibrium is unstable.
        """
        return self.required_friction <= self.friction

    @property
    def pose(self) -> Pose:
        """Return the object's pose in equilibrium, (x, y, angle) in the robot frame [m, rad]."""
        return self.given if self.equilibrium is None else self.equilibrium.pose

    @property
    def displacement(self) -> Array:
        """Return the object's displacement from given pose to equilibrium, (3,) [m, rad]."""
        x, y, angle = np.subtract(self.pose, self.given).tolist()
        return np.array([x, y, math.remainder(angle, 2.0 * math.pi)])

    @property
    def normal_forces(self) -> dict[str, float]:
        """Return the normal force at each grasping member, positive in compression [N]."""
        return self._named(lambda grip: grip.normal_forces)

    @property
    def friction_forces(self) -> dict[str, float]:
        """Return the friction on the object at each grasping member, counter-clockwise [N]."""
        return self._named(lambda grip: -grip.friction_forces)

    @property
    def friction_used(self) -> dict[str, float]:
        """Return the utilised friction |T| / (mu N) at each member [-]; infinite for mu = 0."""
        with np.errstate(divide='ignore', invalid='ignore'):
            return self._named(
                lambda grip: np.abs(grip.friction_forces) / (self.friction * grip.normal_forces)
            )

    @property
    def required_friction(self) -> float:
        """Return the smallest friction coefficient without slip; infinite without equilibrium."""
        return math.inf if self.equilibrium is None else self.equilibrium.required_friction

    @cached_property
    def friction_range(self) -> FrictionRange:
        """
        Return the coefficients of friction between which the contact history decides [-].

        Below the first one the object is lost, from the second one it is held also after a sudden
        fall from `friction`. Both are infinite without an equilibrium. See `FrictionRange`.
        """
        if self.equilibrium is None:
            return FrictionRange(math.inf, math.inf)
        return find_friction_range(self.equilibrium, self.friction)

    @cached_property
    def slip_margin(self) -> float:
        """
        Return the smallest additional wrench at which a member slips or loses contact [N].

        Moments are divided by the characteristic radius, d/2 of a disc. One end of a face may lose
        contact at a smaller wrench, which is not counted as slip. The margin is negative after
        slip; without an equilibrium see `LostContact`.
        """
        if self.lost is not None:
            return self.lost.slip_margin
        return 0.0 if self.equilibrium is None else self.equilibrium.slip_margin(self.friction)

    @check_kinds
    def chance(
        self,
        uncertainty: Uncertainty,
        samples: int | None = None,
        seed: int = 0,
        on_progress: Callable[[float], None] | None = None,
    ) -> Chance:
        """
        Return the probability that the object is held, see `Uncertainty.chance`.

        :param uncertainty: standard deviations of the parameters.
        :param samples: number of equilibria with random parameters; 0: to first order; None: 200
            where first order is not proved good.
        :param seed: seed of the random parameters.
        :param on_progress: function that is called with the completed fraction of the samples, 0
            to 1.
        :raises GraspError: an integer is invalid, the equilibrium is neutral, or there is none to
            linearise about to first order.
        """
        return uncertainty.chance(self, samples, seed, on_progress)

    @property
    def slip_direction(self) -> Array:
        """
        Return the direction (3,) of the smallest wrench that causes slip, (fx, fy, m / arm).

        Its norm is 1 if the moment is taken about the centroid. The direction is zero if there is
        no equilibrium, or a neutral one. `arm` is the characteristic radius.
        """
        if self.equilibrium is None or self.equilibrium.response is None:
            return np.zeros(3)
        return slip_planes(self.equilibrium.response, self.friction).direction

    @property
    def utilisation(self) -> dict[str, float]:
        """
        Return the largest ratio of bending moment to wrinkling moment of each member [-].

        Above 1 the tube wrinkles, and the model no longer holds.
        """
        return self._named(lambda grip: grip.sections.used, every=True)

    @property
    def utilisation_places(self) -> dict[str, float]:
        """Return the distance of the largest utilisation from each member's start [m]."""
        return self._named(lambda grip: grip.sections.place, every=True)

    @property
    def contact_lengths(self) -> dict[str, float]:
        """
        Return the length of tube in contact at each grasping member [m].

        These six properties have one value for each grasping member. They are empty without an
        equilibrium.
        """
        return self._named(lambda grip: grip.patches.lengths)

    @property
    def contact_widths(self) -> dict[str, float]:
        """Return the largest width of the contact around each tube [m]."""
        return self._named(lambda grip: grip.patches.widths)

    @property
    def contact_areas(self) -> dict[str, float]:
        """Return the area of contact at each grasping member [m^2]."""
        return self._named(lambda grip: grip.patches.areas)

    @property
    def contact_pressures(self) -> dict[str, float]:
        """Return the mean contact pressure at each grasping member [Pa]."""
        return self._named(lambda grip: grip.patches.pressures)

    @property
    def peak_pressures(self) -> dict[str, float]:
        """Return the largest contact pressure at each grasping member [Pa]."""
        return self._named(lambda grip: grip.patches.peaks)

    @property
    def flattened(self) -> tuple[str, ...]:
        """
        Return the names of the members whose contact is as wide as half of the circumference.

        Their section is flat there, and the model is not valid for depth and force.
        """
        flat = self._named(lambda grip: grip.patches.flattened)
        return tuple(name for name, is_flat in flat.items() if is_flat)

    @property
    def nonlinearity(self) -> float:
        """Return the relative increase of contact forces due to geometric nonlinearity [-]."""
        return 0.0 if self.equilibrium is None else self.equilibrium.nonlinearity

    @property
    def stiffness(self) -> Array:
        """
        Return the robot's stiffness against motion of the object, (3, 3) [N/m, N, N m].

        The stiffness is the derivative of the wrench (fx, fy, m) by the displacement (dx, dy,
        dtheta), without slip at the contacts. Without an equilibrium, zero is returned.
        """
        response = None if self.equilibrium is None else self.equilibrium.response
        return np.zeros((3, 3)) if response is None else response.stiffness

    def _named(self, find: Callable[[HeldGrip], Array], every: bool = False) -> dict[str, Any]:
        """Return values by the names of the grasping members, or of all members."""
        if self.lost is not None and every:
            return dict.fromkeys(self.lost.inputs.config.robot.member_names, 0.0)
        grip = self.equilibrium
        if grip is None:
            return {}
        names = grip.config.robot.member_names if every else grip.member_names
        return dict(zip(names, find(grip).tolist(), strict=True))


# Result of `settle_grasps`: arrays over many grasps.


@dataclass(frozen=True, eq=False, repr=False)
class SettledGrasps(
    Record,
    headline=('counts', 'slip_margin', 'squeeze', 'required_friction'),
    data=(
        *('held', 'hold', 'reason', 'friction', 'slip_margin', 'squeeze', 'required_friction'),
        *('pose', 'displacement', 'normal_forces', 'friction_forces', 'utilisation'),
    ),
):
    """
    Equilibria of n free objects, each in a grasp of its own, as arrays over the grasps.

    `grasps[i]` is the `SettledGrasp` of grasp i, with the equilibrium that was found. The arrays
    have the values of its properties of the same names. Without an equilibrium, the pose is the
    given pose, forces and squeeze are zero, the required friction is infinite, and the slip margin
    is negative, see `LostContact`.
    """

    #: (n,) hold statuses; None for a grasp without a structural model, such as a mechanism
    hold: tuple[HoldStatus | None, ...]
    reason: tuple[str, ...]  #: (n,) hold statuses or errors in words; empty if the object is held
    friction: Array  #: (n,) coefficients of friction between tube and object [-]
    #: (n,) slip margins [N]; NaN without a structural model, as all other values
    slip_margin: Array
    squeeze: Array  #: (n,) mean normal forces of the grasping members [N]
    required_friction: Array  #: (n,) smallest friction coefficients without slip [-]
    pose: Array  #: (n, 3) poses of the objects in equilibrium (x, y, angle) [m, rad]
    displacement: Array  #: (n, 3) displacements from the given poses [m, rad]
    #: (n,) normal forces for the name of each member, zero if it does not grasp [N]
    normal_forces: dict[str, Array]
    #: (n,) friction on the objects, counter-clockwise, for the name of each member [N]
    friction_forces: dict[str, Array]
    #: (n,) ratios of bending moment to wrinkling moment for the name of each member [-]
    utilisation: dict[str, Array]
    inputs: Sequence[GraspInputs] = field(repr=False)  #: (n,) inputs of the grasps
    #: (n,) equilibria, or the gaps of the members to an object without equilibrium; None without a
    #: structural model
    equilibria: Sequence[HeldGrip | LostContact | None] = field(repr=False)

    @property
    def held(self) -> Flags:
        """Return whether each object is held, (n,)."""
        return np.array([hold is HoldStatus.HELD for hold in self.hold], dtype=bool)

    @property
    def counts(self) -> dict[str, int]:
        """Return the number of grasps with each hold status, in words."""
        words = ['no structural model' if hold is None else hold.value for hold in self.hold]
        return {word: words.count(word) for word in dict.fromkeys(words)}

    def to_dict(self) -> dict[str, list[Any]]:
        """
        Return columns of n values, as for a data frame.

        The columns are the arrays by their names; `x`, `y` and `angle` for `pose`, `dx`, `dy` and
        `dangle` for `displacement`; and the quantity and the member, such as `utilisation
        north/P-Z`. Numbers that are not finite become None.
        """
        columns: dict[str, Any] = {}
        for name in self.data:
            value = getattr(self, name)
            if isinstance(value, dict):
                columns |= {f'{name} {member}': of_member for member, of_member in value.items()}
            elif name in ('pose', 'displacement'):
                prefix = 'd' if name == 'displacement' else ''
                names = (f'{prefix}{component}' for component in ('x', 'y', 'angle'))
                columns |= dict(zip(names, value.T, strict=True))
            else:
                columns[name] = value
        return {name: as_plain(values) for name, values in columns.items()}

    def __len__(self) -> int:
        """Return the number n of grasps."""
        return len(self.hold)

    def __iter__(self) -> Iterator[SettledGrasp]:
        """Yield the settled grasps."""
        return (self[i] for i in range(len(self)))

    def __getitem__(self, number: int) -> SettledGrasp:
        """
        Return a settled grasp.

        :param number: number of the grasp; negative from the end.
        :raises IndexError: there is no such grasp.
        :raises StructureError: the grasp has no structural model.
        """
        found, hold = self.equilibria[number], self.hold[number]
        if found is None or hold is None:
            raise StructureError(self.reason[number])
        given, friction = self.inputs[number].body.pose, float(self.friction[number])
        grasp = hold, self.reason[number], given, friction
        if isinstance(found, LostContact):
            return SettledGrasp(*grasp, lost=found)
        return SettledGrasp(*grasp, found)
