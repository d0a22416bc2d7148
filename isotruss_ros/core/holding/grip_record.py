# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers that describe a held grip, from which another process restores its equilibrium."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.build_statics import build_statics, facing_lines
from isotruss_ros.core.holding.contact_forces import Places, PressedContacts
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.held_grip import HeldGrip, travel_rates
from isotruss_ros.core.holding.roll_grip import NO_CONTACTS, roll_grip, stick
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


class GripRecord(NamedTuple):
    """Numbers from which a held grip is restored if robot, object and wrench are known."""

    travel: Array  #: (r,) roller travel since home [m]
    contacts: PressedContacts  #: the k contacts
    unknowns: Array  #: (3 + 4k,) unknowns, see `ContactForces`
    #: (t,) gauge pressure of each tube [Pa]; None: as in the robot file
    pressures: tuple[float, ...] | None

    @classmethod
    def of(cls, grip: HeldGrip) -> GripRecord:
        """Return the record of a grip."""
        own = grip.tubes.pressure is not None
        pressures = grip.statics.bent.structure.pressures if own else None
        return cls(grip.config.roller_positions, grip.contacts, grip.state.unknowns, pressures)

    def restore(
        self,
        config: Configuration,
        body: ConvexObject,
        external_wrench: Array | None = None,
        before: HeldGrip | None = None,
    ) -> HeldGrip | None:
        """
        Return the recorded grip after rolling to a near configuration; None without equilibrium.

        The iteration starts from the bent tubes of `before` if its members are the same.

        :param body: the object; its pose is not used.
        """
        there, body = config.moved_to(self.travel), body.moved_to(self.unknowns[:3])
        contacts, tubes = self.contacts, TubeModel(pressure=self.pressures)
        turned = np.exp(1j * self.unknowns[Places.of(len(contacts.members)).inclinations])
        try:
            normals = facing_lines(there, body, contacts.members)[1] * turned
            statics = build_statics(there, body, contacts, tubes, normals)
            angles = np.angle(normals * body.turn.conjugate())
            travel = travel_rates(there, contacts.members) @ self.travel
            anchors = statics.anchors(self.unknowns, normals, travel, angles)
        except IndexError as error:
            raise GraspError(
                f'held grip: corners {self.contacts.corners}: the object has no such corners'
            ) from error
        bent, loads = statics.bent, statics.loads(self.unknowns)
        feet = self.unknowns[statics.places.feet]
        like = before is not None and before.tubes[:2] == tubes[:2]
        if like and np.array_equal(before.contacts.members, contacts.members):
            bent = before.statics.bent.update(loads, feet, bent.structure)
        statics = replace(statics, bent=bent.bend(loads, feet))
        conditions = stick(statics, anchors, travel, angles, NO_CONTACTS)
        residual, state = statics.equations(self.unknowns, np.zeros(3), conditions)
        # The recorded dents were tabulated at other normals. `given` keeps this difference
        # constant, so the recorded forces fulfil the equations.
        statics = replace(statics, given=-residual[: 3 * len(angles)].reshape(-1, 3))
        held = HeldGrip(there, body, anchors, angles, statics, state, np.zeros(3), tubes)
        return roll_grip(held, config, external_wrench)
