# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers that describe a held grip, from which another process restores its equilibrium."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import GraspError, StructureError
from isotruss_ros.core.holding.contacts import Places, POSE, PressedContacts
from isotruss_ros.core.holding.equations import Grasps, linearize_grasps, Pushes
from isotruss_ros.core.holding.held_grip import Equilibria, HeldGrip
from isotruss_ros.core.holding.newton import Iterate
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.bent_tubes import BentState, BentTubes
from isotruss_ros.core.statics.structure import structures_under
from isotruss_ros.core.statics.tube_stiffness import tube_pressures
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
    bent: Array  #: (s,) state of the bent tubes, nodes, points and axial forces of `BentState`
    responses: Array  #: (k, 4, 4k + 1) responses at the contacts, see `BentTubes.at_points`
    #: (t,) gauge pressure of each tube [Pa]; None: as in the robot file
    pressures: tuple[float, ...] | None = None
    estimate: GripEstimate | None = None  #: estimate of the control loop that holds the object
    is_assumed: bool = False  #: whether the equilibrium is assumed, so that the squeeze is unknown

    @classmethod
    def of(
        cls, grip: HeldGrip, estimate: GripEstimate | None = None, is_assumed: bool = False
    ) -> GripRecord:
        """Return the record of a grip whose tubes are bent."""
        one, tubes = grip.alone, grip.alone.linear.tubes
        bent = tubes.activate(one.iterate.bent)
        responses = tubes.at_points[0].copy()
        # The last column has the values in this state.
        feet = one.iterate.unknowns[:, one.g.places.feet]
        responses[..., -1] = tubes.respond(one.pushes.loads, feet)[0]
        measured = grip.pressures != tube_pressures(grip.config.robot.description)
        return cls(
            grip.config.roller_positions,
            grip.contacts,
            grip.state.unknowns,
            np.concatenate([part.ravel() for part in (bent.nodes, bent.points, bent.axial)]),
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
        contacts, count, at = self.contacts, len(self.contacts.members), self.unknowns[None]
        pressures = self.pressures or tube_pressures(config.robot.description)
        structure = structures_under([config.moved_to(self.travel)], [pressures], [1.0])
        feet = at[:, Places.of(count).feet]
        straight = BentState.straight(structure, feet, deforms=True)
        sizes = [part.size for part in (straight.nodes, straight.points, straight.axial)]
        if self.bent.shape != (sum(sizes),):
            raise StructureError(f'bent tubes with {self.bent.size} values: must be {sum(sizes)}')
        parts = np.split(self.bent, np.cumsum(sizes)[:-1])
        nodes, points, axial = (
            values.reshape(part.shape) for values, part in zip(parts, straight, strict=False)
        )
        bent = straight._replace(nodes=nodes, points=points, axial=axial)
        try:
            g = Grasps.of(structure, ObjectSamples([recorded_body]), contacts, np.zeros((1, 3)))
            history = Equilibria(g, Iterate(at, bent)).history
        except IndexError as error:
            raise GraspError(
                f'held grip: corners {contacts.corners}: the object has no such corners'
            ) from error
        g, pushes = g._replace(history=history), Pushes.of(g, at)
        fields = structure, contacts.members, g.lines, bent, pushes.loads
        tubes = BentTubes.of(*fields, self.responses[None])
        linear = linearize_grasps(g, at, tubes, pushes)
        return HeldGrip(Equilibria(g, Iterate(at, bent), linear))
