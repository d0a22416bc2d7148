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

from isotruss_ros.core.holding.grip_response import slip_planes
from isotruss_ros.core.holding.held_gradient import (
    GraspParameters,
    LoadedTubes,
    ParameterChanges,
    with_tubes,
)
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.pressed_contacts import ANGLE, POSE
from isotruss_ros.core.holding.rolling_invariants import sticking
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.model.parameter_deviations import ParameterDeviations as Uncertainty
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.statics.bent_updates import activate_tubes
from isotruss_ros.core.statics.inclinations import RING_HALF_WIDTH
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
    #: `Robot.member_names`; zero for a tube that is kept undeformed, because it has no loads
    utilisation: Array
    # For second derivatives: derivatives (3 + 4k, p) of the equilibrium's unknowns.
    _unknown_rates: Array | None = None

    @property
    def squeeze(self) -> Array:
        """Return the derivatives (p,) of the members' mean normal force by the parameters."""
        return self.normal_forces.mean(axis=0)

    @functools.cached_property
    def stiffness(self) -> Array:
        """Return the derivatives (3, 3, p) of `SettledGrasp.stiffness` by the p parameters."""
        if self.settled.equilibrium is None:
            return np.zeros((3, 3, self.parameters.size))
        grip = self.settled.equilibrium
        inverse = np.linalg.inv(grip.response.pose)
        by_wrench = grip.respond(self._response_rates(grip.response.change))
        # (C^-1)' = -C^-1 C' C^-1 for the compliance C; p are the parameters.
        rates = -np.einsum('ia,apb,bj->ijp', inverse, by_wrench[:POSE], inverse)
        rates[2] *= grip.arm  # moments in `HeldGrip.wrench` are divided by it, angles are not
        return rates

    @functools.cached_property
    def slip_margin(self) -> Array:
        """
        Return the slip margin's derivatives (p,) by the parameters.

        If several members slip at once, as in a symmetric grasp, the slip margin is not
        differentiable, and the derivatives are those of the first of them.
        """
        columns = self.parameters
        if self.settled.equilibrium is None:
            rates = np.zeros(columns.size)
            rates[columns.rollers], rates[columns.place] = self.settled.lost.slip_margin_rates()
            return rates

        # The margin is reserve / size of the nearest plane, see `SlipPlanes`. The reserve is the
        # plane's row times the contact forces; the size is the row times their response to the
        # unit wrench normal to the plane, about the centroid and then about the origin.
        grip, response = self.settled.equilibrium, self.settled.equilibrium.response
        planes = slip_planes(response, self.settled.friction)
        nearest = int((planes.reserve / planes.size).argmin())
        row, by_friction = planes.rows[nearest], planes.friction_rates[nearest]
        slope, size = planes.slope[nearest], planes.size[nearest]
        about_middle, forces = planes.about_middle, grip.state.places.forces
        central_wrench = slope @ about_middle / size
        wrench = about_middle @ central_wrench

        # Changes of the contact forces and of their response.
        reserve_rates = row @ self._unknown_rates[forces]
        response_rates = self._response_rates(response.change @ wrench[:, None])
        size_rates = row @ grip.respond(response_rates)[forces, :, 0]

        # The moment about the origin changes, because the centroid moves around it.
        swing = about_middle[2, 1] * central_wrench[0] - about_middle[2, 0] * central_wrench[1]
        size_rates -= slope[2] * swing * self._unknown_rates[ANGLE]

        # Changes of the row itself: after an end of a face has opened, the row depends on the
        # redistribution of its force. The first 2 m planes are slip of the members; then follow as
        # many for each end. Of these, the planes of opening have a constant row: one force.
        end_number, plane = divmod(nearest - 2 * len(grip.members), 2 * len(grip.members))
        is_opening = np.count_nonzero(row) == 1
        if end_number >= 0 and not is_opening:
            end = int(response.ends[end_number])
            by_release = planes.rows[plane] @ self._release_rates(end_number)
            reserve_rates += by_release * grip.state.forces[end]
            size_rates += by_release * (response.forces[end] @ wrench)

        # The row depends on the coefficient of friction.
        reserve_rates[columns.friction] += by_friction @ grip.state.forces
        size_rates[columns.friction] += by_friction @ response.forces @ wrench
        return (reserve_rates - planes.margin * size_rates) / size

    @check_kinds
    def chance(self, uncertainty: Uncertainty) -> Array:
        """Return the derivatives (p + 1,) of the chance, see `Uncertainty.chance_gradient`."""
        return uncertainty.chance_gradient(self)

    @functools.cached_property
    def _deformable(self) -> tuple[HeldGrip, ParameterChanges]:
        """Return the grasp on tubes that are all deformable, and the changes of parameters."""
        grip, columns = self.settled.equilibrium, self.parameters
        grip = with_tubes(grip, activate_tubes(grip.statics.bent))
        return grip, ParameterChanges.of(grip, np.eye(columns.size), columns)

    def _release_rates(self, number: int) -> Array:
        """
        Return the derivatives (2k, p) of the changes of all forces by a released tension.

        :param number: row of `GripResponse.by_release`, which has these changes.
        """
        grip, response = self.settled.equilibrium, self.settled.equilibrium.response
        indices, end = grip.state.places, int(response.ends[number])
        by_gap = response.by_gap[:, number]
        residual_rates = self._response_rates(by_gap[:, None])[..., 0]
        # The unit gap is normal to the tube, and turns with the tube relative to the member.
        gap = grip.statics.bent.lines.axis[end].conj() * grip.state.normals[end]
        gap_rates = 1j * gap * self._unknown_rates[indices.inclinations][end]
        along = 3 * end
        residual_rates[[along, along + 1]] -= gap_rates.real, gap_rates.imag
        force_rates = grip.respond(residual_rates)[indices.forces]
        # A row is the quotient -(all forces) / (force of the end).
        quotient_rates = force_rates + np.outer(response.by_release[number], force_rates[end])
        return -quotient_rates / by_gap[indices.forces][end]

    @single_threaded
    def _response_rates(self, responses: Array) -> Array:
        """
        Return the derivatives (3 + 4k, p, n) of J y by p parameters, for n constant responses y.

        The Jacobian J is that of sticking contacts, see this module. The derivatives are central
        differences of fourth order of `_displaced_rates` along the responses.
        """
        grip, changes = self._deformable
        state, structure = grip.state, grip.statics.bent.structure
        # Kinks of the stiffness: a contact is at a guide ring, at an end of its half width, or at
        # a pinch point, or has no force.
        pieces, within, _ = structure.locate(grip.contacts.members, state.feet)
        to_piece_ends = np.minimum(within, structure.frame.length[pieces] - within)
        to_width_ends = np.abs(to_piece_ends - RING_HALF_WIDTH)
        to_kinks = np.concatenate([to_piece_ends, to_width_ends, state.normal_forces])
        rows = np.r_[state.places.feet, state.places.feet, state.places.normal]
        # In the kink itself no step is short enough.
        is_beside = to_kinks > 0.0
        kink_shares = np.abs(responses[rows[is_beside]] / to_kinks[is_beside, None]).max(axis=0)
        motions = np.abs(responses[:POSE]) * [[1.0], [1.0], [grip.arm]]
        # Multiples of the responses that reach one of both bounds.
        steps = 1.0 / np.maximum(motions.max(axis=0) / STEP, kink_shares / KINK_SHARE)
        rates = np.empty((*self._unknown_rates.shape, len(steps)))
        for i, step in enumerate(steps.tolist()):
            forward, backward, two_forward, two_backward = (
                _displaced_rates(
                    grip, changes, self._unknown_rates, count * step * responses[:, i]
                )
                for count in (1.0, -1.0, 2.0, -2.0)
            )
            difference = 8.0 * (forward - backward) - (two_forward - two_backward)
            rates[..., i] = difference / (12.0 * step)
        return rates


@check_kinds
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
        parameters = GraspParameters.of(settled.lost.inputs.config)
        pose = np.eye(3, parameters.size, parameters.place.start)
        forces, friction = np.zeros((0, parameters.size)), np.zeros(parameters.size)
        usage = np.zeros((len(settled.utilisation), parameters.size))
        return GraspGradient(parameters, settled, pose, forces, forces, friction, usage)
    parameters, indices = GraspParameters.of(grip.config), grip.state.places
    tubes = LoadedTubes.of(grip, np.eye(parameters.size), parameters)
    unknown_rates = -np.linalg.solve(grip.state.jacobian, tubes.equation_rates())
    _, utilisation_rates = tubes.utilisation(tubes.respond(unknown_rates))
    normal_rates = grip.contacts.sum_by_member(unknown_rates[indices.normal])
    friction_rates = grip.contacts.sum_by_member(unknown_rates[indices.friction])
    ratios = grip.friction_forces / grip.normal_forces
    slipping = int(np.abs(ratios).argmax())  # member
    scaled_rates = friction_rates[slipping] - ratios[slipping] * normal_rates[slipping]
    ratio_rates = scaled_rates / grip.normal_forces[slipping]
    return GraspGradient(
        parameters=parameters,
        settled=settled,
        pose=unknown_rates[:POSE],
        normal_forces=normal_rates,
        friction_forces=-friction_rates,  # on the object
        required_friction=np.sign(ratios[slipping]) * ratio_rates,
        utilisation=utilisation_rates,
        _unknown_rates=unknown_rates,
    )


def _displaced_rates(
    grip: HeldGrip, changes: ParameterChanges, unknown_rates: Array, shift: Array
) -> Array:
    """Return the equations' derivatives (3 + 4k, p) by parameters, at displaced unknowns."""
    unknowns = grip.state.unknowns + shift
    dents = grip.statics.dents.smooth_near(grip.state.normal_forces, grip.angles)
    smooth_statics = replace(grip.statics, dents=dents)
    statics = replace(smooth_statics, bent=smooth_statics.bent_under(unknowns))
    _, state = statics.equations(unknowns, grip.wrench, sticking)
    displaced = LoadedTubes.at(replace(grip, statics=statics, state=state), changes)
    return state.jacobian @ unknown_rates + displaced.equation_rates(sticks=True)
