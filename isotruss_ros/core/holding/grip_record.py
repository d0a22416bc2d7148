# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers that describe a held grip, from which another process restores its equilibrium."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.build_statics import statics_of
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.pressed_contacts import Places, POSE, PressedContacts
from isotruss_ros.core.holding.rolling_invariants import sticking
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.bent_updates import describe_state
from isotruss_ros.core.statics.section import tube_pressures
from isotruss_ros.core.statics.structure import structure_of
import numpy as np


class GripEstimate(NamedTuple):
    """Estimated state of a held object, with loads and sensor errors."""

    pose: Array  #: (3,) x, y [m], angle [rad]
    pose_covariance: Array  #: (3, 3) covariance of the pose [m^2, m rad, rad^2]
    squeeze: float  #: mean normal force of the members [N]
    squeeze_deviation: float  #: standard deviation of the squeeze [N]
    delay: float  #: time by which the measured poses are older than their stamps say [s]
    displacements: Array  #: (2j,) displacements of the joints by the contact forces [m]
    displacement_rates: Array  #: (2j, r) derivatives of the displacements by the roller offsets


class GripRecord(NamedTuple):
    """Numbers from which a held grip is restored if robot and object are known."""

    travel: Array  #: (r,) roller travel since home [m]
    contacts: PressedContacts  #: the k contacts
    unknowns: Array  #: (3 + 4k,) unknowns, see `ContactForces`
    bent: Array  #: (s,) state of the bent tubes, see `BentTubes.values`
    responses: Array  #: (k, 3, 4k + 1) responses at the contacts, see `BentTubes.at_points`
    #: (t,) gauge pressure of each tube [Pa]; None: as in the robot file
    pressures: tuple[float, ...] | None = None
    estimate: GripEstimate | None = None  #: estimate of the control loop that holds the object
    is_assumed: bool = False  #: whether the equilibrium is assumed, so that the squeeze is unknown

    @classmethod
    def of(
        cls, grip: HeldGrip, estimate: GripEstimate | None = None, is_assumed: bool = False
    ) -> GripRecord:
        """Return the record of a grip whose tubes are bent."""
        bent, responses = describe_state(grip.statics.bent, grip.state.loads, grip.state.feet)
        measured = grip.pressures != tube_pressures(grip.config.robot.description)
        return cls(
            grip.config.roller_positions,
            grip.contacts,
            grip.state.unknowns,
            bent,
            responses,
            grip.pressures if measured else None,
            estimate,
            is_assumed,
        )

    def restore(self, config: Configuration, body: ConvexObject) -> HeldGrip:
        """
        Return the recorded grip, given a near configuration and the object at any pose.

        :raises GraspError: the object has no such corners.
        :raises StructureError: the bent tubes are those of another structure.
        """
        radius = 0.5 * config.robot.description.tube_diameter
        recorded_body = body.moved_to(self.unknowns[:POSE]).smoothed(radius)
        members = self.contacts.members
        feet = self.unknowns[Places.of(len(members)).feet]
        structure = structure_of(config.moved_to(self.travel), self.pressures)
        bent = BentTubes.of(structure, members, feet, self.bent, self.responses)
        try:
            statics = statics_of(bent, recorded_body, self.contacts)
        except IndexError as error:
            raise GraspError(
                f'held grip: corners {self.contacts.corners}: the object has no such corners'
            ) from error
        _, state = statics.equations(self.unknowns, np.zeros(3), sticking)
        # Rounding errors of the loads would count as a change of the state.
        return HeldGrip.of(statics, replace(state, loads=bent.state.loads), np.zeros(3))
