# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Exact derivatives of a settled grasp with respect to the parameters of an optimiser.

The derivatives of slip margin and stiffness need second derivatives of the equilibrium equations
F. With sticking contacts, the response y_w of the unknowns to a wrench w follows from J y_w =
-F_w, where J is the Jacobian of F with the equations of rolling. So (y_w)' = -J^-1 J' y_w. The
term J' y_w is the second derivative of F along the response and along the change of the grasp.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
import functools
from typing import Any

from isotruss_ros.core.holding.grip_response import slip_planes
from isotruss_ros.core.holding.held_gradient import GraspParameters, LoadedTubes
from isotruss_ros.core.holding.pressed_contacts import ANGLE, POSE
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
import numpy as np

#: Motion of the object in the finite differences along a response [m]. The relative error of the
#: stiffness' derivatives is then below 1e-6 in grasps of the presets, and up to 3e-6 in softer
#: robots. At a third of the step it is up to 6e-6, by rounding; at three times the step, 4e-5.
STEP = 6e-5
#: Largest sliding of a contact in these differences, relative to its distance from the nearest
#: guide ring or pinch point, and largest change of its normal force, relative to the force [-]. At
#: a ring and at zero force the stiffness has a kink. Without this bound, the derivatives err by
#: 2e-4 at 0.5 mm from a ring, and by 5e-4 at a small force; with it by 3e-6 and 9e-6, and at half
#: of it by 3e-5, by rounding.
KINK_SHARE = 0.02


@dataclass(frozen=True, eq=False, repr=False)
class GraspGradient(Record, headline=('parameters', 'slip_margin', 'required_friction')):
    """
    Derivatives of a `SettledGrasp` with respect to p parameters, while no contact opens or closes.

    Without an equilibrium, only the derivatives of pose and slip margin are not zero, see
    `LostContact`.

    Between two members, the equilibrium depends on the given position along their bisector, but
    not on the other coordinates of the given pose. Between three members it does not depend on the
    given pose.
    """

    #: parameters, with the indices of their columns in the arrays of derivatives
    parameters: GraspParameters
    settled: SettledGrasp  #: the grasp
    pose: Array  #: (3, p) derivatives of the object's pose (x, y, angle)
    #: (m, p) derivatives of the normal forces, in the order of `SettledGrasp.normal_forces`
    normal_forces: Array
    #: (m, p) derivatives of the friction forces on the object, counter-clockwise
    friction_forces: Array
    #: (p,) derivatives of the largest required friction coefficient. If several members require
    #: it, as in a symmetric grasp, they are those of the first member
    required_friction: Array
    #: (n, p) derivatives of the largest utilisation of each member, in the order of
    #: `Robot.member_names`
    utilisation: Array
    # For second derivatives: tubes with the changes of parameters, and derivatives (3 + 4k, p) of
    # the unknowns.
    _tubes: LoadedTubes | None = None
    _unknowns: Array | None = None

    @property
    def squeeze(self) -> Array:
        """Return the derivatives (p,) of the members' mean normal force by the parameters."""
        return self.normal_forces.mean(axis=0)

    @functools.cached_property
    def stiffness(self) -> Array:
        """Return the derivatives (3, 3, p) of `SettledGrasp.stiffness` by the p parameters."""
        if self._tubes is None:
            return np.zeros((3, 3, self.parameters.size))
        grip = self.settled.equilibrium
        inverse = np.linalg.inv(grip.response.pose)
        by_wrench = grip.respond(self._response_rates(grip.response.change))
        rates = -np.einsum('ia,apb,bj->ijp', inverse, by_wrench[:POSE], inverse)
        rates[2] *= grip.arm
        return rates

    @functools.cached_property
    def slip_margin(self) -> Array:
        """
        Return the slip margin's derivatives (p,) by the parameters.

        If several members slip at once, as in a symmetric grasp, the slip margin is not
        differentiable, and the derivatives are those of the first of them.
        """
        columns = self.parameters
        if self._tubes is None:
            rates = np.zeros(columns.size)
            rates[columns.rollers], rates[columns.place] = self.settled.lost.slip_margin_rates()
            return rates
        grip, response = self.settled.equilibrium, self.settled.equilibrium.response
        planes = slip_planes(response, self.settled.friction)
        nearest = int((planes.reserve / planes.size).argmin())
        row, by_friction = planes.rows[nearest], planes.friction_rates[nearest]
        slope, size = planes.slope[nearest], planes.size[nearest]
        about_middle, forces = planes.about_middle, grip.state.places.forces
        normal = slope @ about_middle / size
        wrench = about_middle @ normal
        reserve_rates = row @ self._unknowns[forces]
        response_rates = self._response_rates(response.change @ wrench[:, None])
        size_rates = row @ grip.respond(response_rates)[forces, :, 0]
        # The wrench about the object's centroid, which moves around its origin as it turns.
        swing = about_middle[2, 1] * normal[0] - about_middle[2, 0] * normal[1]
        size_rates -= slope[2] * swing * self._unknowns[ANGLE]
        # First the 2 m planes of slip of the members, then as many for each end that has opened.
        opened, plane = divmod(nearest, 2 * len(grip.members))
        if opened and np.count_nonzero(row) > 1:  # slip after an end has opened
            end = int(response.ends[opened - 1])
            by_release = planes.rows[plane] @ self._release_rates(opened - 1)
            reserve_rates += by_release * grip.state.forces[end]
            size_rates += by_release * (response.forces[end] @ wrench)
        reserve_rates[columns.friction] += by_friction @ grip.state.forces
        size_rates[columns.friction] += by_friction @ response.forces @ wrench
        return (reserve_rates - planes.margin * size_rates) / size

    def chance(self, uncertainty: Any) -> Array:
        """Return the derivatives (p + 1,) of the chance, see `Uncertainty.chance_gradient`."""
        return uncertainty.chance_gradient(self)

    def _release_rates(self, number: int) -> Array:
        """Return the derivatives (2k, p) of one row of `GripResponse.by_release`."""
        grip, response = self.settled.equilibrium, self.settled.equilibrium.response
        indices, end = grip.state.places, int(response.ends[number])
        by_gap = response.by_gap[:, number]
        right = self._response_rates(by_gap[:, None])[..., 0]
        # The unit gap is normal to the tube, and turns with the tube relative to the member.
        gap = grip.statics.bent.lines.axis[end].conj() * grip.state.normals[end]
        gap_rates = 1j * gap * self._unknowns[indices.inclinations][end]
        right[3 * end] -= gap_rates.real
        right[3 * end + 1] -= gap_rates.imag
        rates = grip.respond(right)[indices.forces]
        tension = by_gap[indices.forces][end]
        return -(rates + np.outer(response.by_release[number], rates[end])) / tension

    @single_threaded
    def _response_rates(self, response: Array) -> Array:
        """
        Return the products J' y (3 + 4k, p, n) of n responses y by p parameters (see this module).

        They are central differences of fourth order of `_displaced_rates` along the responses.
        """
        grip = self._tubes.grip
        state, structure = grip.state, grip.statics.bent.structure
        pieces, within, _ = structure.locate(grip.contacts.members, state.feet)
        room = np.minimum(within, structure.frame.length[pieces] - within)
        kinks = np.concatenate([room, state.normal_forces])
        changes = np.concatenate([response[state.places.feet], response[state.places.normal]])
        # In the kink itself no step is short enough.
        is_beside = kinks > 0.0
        approach = np.abs(changes[is_beside] / (KINK_SHARE * kinks[is_beside, None])).max(axis=0)
        moved = np.abs(response[:POSE]) * [[1.0], [1.0], [grip.arm]]
        sizes = 1.0 / np.maximum(moved.max(axis=0) / STEP, approach)
        rates = np.empty((*self._unknowns.shape, len(sizes)))
        for i, size in enumerate(sizes.tolist()):
            forward, backward, two_forward, two_backward = (
                _displaced_rates(self._tubes, self._unknowns, step * size * response[:, i])
                for step in (1.0, -1.0, 2.0, -2.0)
            )
            difference = 8.0 * (forward - backward) - (two_forward - two_backward)
            rates[..., i] = difference / (12.0 * size)
        return rates


@single_threaded
def grasp_gradient(settled: SettledGrasp) -> GraspGradient:
    """
    Return the derivatives of a settled grasp with respect to the parameters of an optimiser.

    From the equilibrium equations F(y, p) = 0 follows y' = -F_y^-1 F_p, with the Jacobian F_y and
    the derivatives F_p at constant unknowns y. Second derivatives are computed when slip margin or
    stiffness is read.

    :param settled: the settled grasp.
    :raises GraspError: the equilibrium is neutral (its Jacobian is singular).
    """
    grip = settled.equilibrium
    if grip is None:  # only pose and slip margin change
        parameters = GraspParameters.of(settled.lost.config)
        pose = np.eye(3, parameters.size, parameters.place.start)
        none, zero = np.zeros((0, parameters.size)), np.zeros(parameters.size)
        unused = np.zeros((len(settled.utilisation), parameters.size))
        return GraspGradient(parameters, settled, pose, none, none, zero, unused)
    parameters, indices = GraspParameters.of(grip.config), grip.state.places
    tubes = LoadedTubes.of(grip, np.eye(parameters.size), parameters)
    unknowns = -np.linalg.solve(grip.state.jacobian, tubes.equation_rates())
    _, utilisation = tubes.utilisation(tubes.respond(unknowns))
    normal_forces = grip.contacts.sum_by_member(unknowns[indices.normal])
    friction_forces = grip.contacts.sum_by_member(unknowns[indices.friction])
    ratios = grip.friction_forces / grip.normal_forces
    slipping = int(np.abs(ratios).argmax())
    ratio_rates = friction_forces[slipping] - ratios[slipping] * normal_forces[slipping]
    ratio_rates /= grip.normal_forces[slipping]
    return GraspGradient(
        parameters=parameters,
        settled=settled,
        pose=unknowns[:POSE],
        normal_forces=normal_forces,
        friction_forces=-friction_forces,
        required_friction=np.sign(ratios[slipping]) * ratio_rates,
        utilisation=utilisation,
        _tubes=tubes,
        _unknowns=unknowns,
    )


def _displaced_rates(tubes: LoadedTubes, changes: Array, shift: Array) -> Array:
    """Return the changes of the equations by parameters, with unknowns displaced by `shift`."""
    grip, unknowns = tubes.grip, tubes.grip.state.unknowns + shift
    dents = grip.statics.dents.smooth_near(grip.state.normal_forces, grip.angles)
    statics = replace(grip.statics, dents=dents)
    feet = unknowns[grip.state.places.feet]
    statics = replace(statics, bent=statics.bent.update(statics.pushes(unknowns).loads, feet))
    _, state = statics.equations(unknowns, grip.wrench, statics.sticking)
    displaced = LoadedTubes.at(replace(grip, statics=statics, state=state), tubes.changes)
    return state.jacobian @ changes + displaced.equation_rates(sticks=True)
