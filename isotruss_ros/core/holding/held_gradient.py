# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Derivatives of object pose, forces and joints with respect to the estimator's parameters."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.held_grip import HeldGrip, travel_rates
from isotruss_ros.core.holding.loaded_frame import held_joints
from isotruss_ros.core.holding.loaded_tubes import GraspParameters, LoadedTubes
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.statics.bent_tubes import FOLLOWED_MOTION
import numpy as np


@dataclass(frozen=True, eq=False)
class HeldGradient:
    """
    Derivatives of pose, normal forces and joint positions of a held object.

    The p = r + 4 + k columns are the parameters: travel of the r rollers [m], external wrench (fx,
    fy, m / arm) on the object [N] with the characteristic radius arm, ratio of the robot's true
    stiffness to its modelled stiffness [-], and rolling invariants of the k contacts [m], see
    `ContactStatics.anchors`.
    """

    pose: Array  #: (3, p) derivatives of the pose (x, y, angle)
    normal_forces: Array  #: (m, p) derivatives of the normal forces of the grasping members
    #: (2j, p) derivatives of the joint positions (x0, y0, x1, y1, ...), in the order of
    #: `Topology.joint_names`
    joints: Array
    places: Array  #: (2j,) joint positions [m], see `held_joints`


@single_threaded
def held_gradient(grip: HeldGrip) -> HeldGradient:
    """
    Return the derivatives of pose, forces and joints by the parameters of `HeldGradient`.

    The contacts stick. From the equilibrium equations F(y, x) = 0 follows y' = -F_y^-1 F_x, see
    `grasp_gradient`. Joint positions include the displacements due to contact forces.
    """
    if grip.response is None:
        raise GraspError(
            'the equilibrium is neutral, so it has no derivatives: it must resist every motion'
        )
    config, state, statics = grip.config, grip.state, grip.statics
    places, parameters = state.places, GraspParameters.of(config)
    rollers, count = len(config.roller_positions), len(grip.anchors)
    stiffness, anchors = rollers + 3, slice(rollers + 4, None)
    chosen = np.zeros((parameters.size, rollers + 4 + count))
    chosen[parameters.rollers, :rollers] = np.eye(rollers)
    chosen[parameters.wrench, rollers:stiffness] = np.diag([1.0, 1.0, grip.arm])
    chosen[parameters.stiffness, stiffness] = 1.0
    tubes = LoadedTubes(grip, chosen, parameters, reach=FOLLOWED_MOTION)
    left = tubes.equation_rates()
    # The rolling invariants change with the normals, which turn with the members, see `stick`.
    rolling = statics.rolling_rows(state.unknowns, state.normals)
    left[places.conditions] = rolling[:, places.inclinations] @ tubes.spins
    travel = travel_rates(config, grip.contacts.members)
    left[places.conditions, :rollers] += statics.sides[:, None] * travel
    left[places.conditions, anchors] -= np.eye(count)
    change = grip.respond(left)
    by_state = tubes.joints(tubes.respond(tubes.contact_rates(change)))
    members = np.eye(len(grip.members))[grip.contacts.owners].T
    return HeldGradient(
        change[:3],
        members @ change[places.normal],
        by_state,
        held_joints(grip).ravel(),
    )
