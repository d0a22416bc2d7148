# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Result of `settle_grasps`: arrays over many grasps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.holding.held_grip import GraspInputs, HeldGrip, HoldStatus
from isotruss_ros.core.holding.settled_grasp import LostContact, SettledGrasp
from isotruss_ros.core.numerics.arrays import Array, Flags
from isotruss_ros.core.numerics.records import as_plain, Record
import numpy as np


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
