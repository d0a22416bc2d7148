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
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.pressed_contacts import POSE
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
    # For second derivatives: tubes with the changes of parameters, and changes of the unknowns.
    # The last three columns of both are for unit wrenches.
    _changes: tuple[LoadedTubes, Array] | None

    @property
    def squeeze(self) -> Array:
        """Return the derivatives (p,) of the members' mean normal force by the parameters."""
        return self.normal_forces.mean(axis=0)

    @functools.cached_property
    def stiffness(self) -> Array:
        """Return the derivatives (3, 3, p) of `SettledGrasp.stiffness` by the p parameters."""
        if self._changes is None:
            return np.zeros((3, 3, self.parameters.size))
        grip = self.settled.equilibrium
        inverse = np.linalg.inv(grip.response.pose)
        changed = grip.respond(self._response_rates(self._changes[1][:, -3:]))
        rates = -np.einsum('ia,apb,bj->ijp', inverse, changed[:3], inverse)
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
        if self._changes is None:
            rates = np.zeros(columns.size)
            rates[columns.rollers], rates[columns.place] = self.settled.lost.slip_margin_rates()
            return rates
        grip, (_, change) = self.settled.equilibrium, self._changes
        response, forces = grip.response, grip.state.places.forces
        planes = slip_planes(response, self.settled.friction)
        nearest, turn = int((planes.reserve / planes.size).argmin()), planes.about_middle
        row, presses = planes.rows[nearest], planes.friction_rates[nearest]
        slope, size = planes.slope[nearest], planes.size[nearest]
        # The wrench about the object's centroid, which moves around its origin as it turns.
        way = slope @ turn / size
        along, x, y = turn @ way, turn[2, 1], -turn[2, 0]
        distance_rates = row @ change[forces, :-3]
        changed = grip.respond(self._response_rates(change[:, -3:] @ along[:, None]))
        longer = row @ changed[forces, :, 0]
        longer -= slope[2] * (x * way[0] + y * way[1]) * change[2, :-3]
        opened, plane = divmod(nearest, 2 * len(grip.members))
        if opened and np.count_nonzero(row) > 1:  # slip after an end has opened
            end = int(response.ends[opened - 1])
            more = planes.rows[plane] @ self._opening_rates(opened - 1)
            distance_rates += more * grip.state.forces[end]
            longer += more * (response.forces[end] @ along)
        distance_rates[columns.friction] += presses @ grip.state.forces
        longer[columns.friction] += presses @ response.forces @ along
        return (distance_rates - planes.margin * longer) / size

    def chance(self, uncertainty: Any) -> Array:
        """Return the derivatives (p + 1,) of the chance, see `Uncertainty.chance_gradient`."""
        return uncertainty.chance_gradient(self)

    def _opening_rates(self, number: int) -> Array:
        """Return the derivatives (2k, p) of one row of `GripResponse.opening`."""
        grip, change = self.settled.equilibrium, self._changes[1]
        response, indices = grip.response, grip.state.places
        end, parted = int(response.ends[number]), response.parted[:, number]
        right = self._response_rates(parted[:, None])[..., 0]
        # The unit gap is normal to the tube, and turns with the tube relative to the member.
        turned = grip.statics.bent.lines.axis[end].conj() * grip.state.normals[end] * 1j
        turning = turned * change[indices.inclinations][end, :-3]
        right[3 * end] -= turning.real
        right[3 * end + 1] -= turning.imag
        rates = grip.respond(right)[indices.forces]
        tension = parted[indices.forces][end]
        return -(rates + np.outer(response.opening[number], rates[end])) / tension

    @single_threaded
    def _response_rates(self, response: Array) -> Array:
        """
        Return the products J' y (3 + 4k, p, n) of n responses y by p parameters (see this module).

        They are central differences of fourth order of `_equation_changes` along the responses.
        """
        grip, (tubes, change) = self.settled.equilibrium, self._changes
        moved = np.abs(response[:POSE]) * [[1.0], [1.0], [grip.arm]]
        grip = replace(grip, statics=replace(grip.statics, bent=grip.statics.bent.activated()))
        state, structure = grip.state, grip.statics.bent.structure
        pieces, within, _ = structure.locate(grip.contacts.members, state.feet)
        room = np.minimum(within, structure.frame.length[pieces] - within)
        near = np.concatenate([room, state.normal_forces])
        changes = np.concatenate([response[state.places.feet], response[state.places.normal]])
        # In the kink itself no step is short enough.
        beside = near > 0.0
        fastest = np.abs(changes[beside] / (KINK_SHARE * near[beside, None])).max(axis=0)
        sizes = 1.0 / np.maximum(moved.max(axis=0) / STEP, fastest)
        rates = np.empty((len(change), change.shape[1] - 3, len(sizes)))
        for i, size in enumerate(sizes.tolist()):
            ahead, behind, far_ahead, far_behind = (
                _equation_changes(grip, tubes, change, step * size * response[:, i])[:, :-3]
                for step in (1.0, -1.0, 2.0, -2.0)
            )
            rates[..., i] = (8.0 * (ahead - behind) - (far_ahead - far_behind)) / (12.0 * size)
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
        used = np.zeros((len(settled.utilisation), parameters.size))
        return GraspGradient(parameters, settled, pose, none, none, zero, used, None)
    parameters = GraspParameters.of(grip.config)
    chosen = np.eye(parameters.size, parameters.size + 3)
    tubes = LoadedTubes.of(grip, chosen, parameters)
    state, indices = grip.state, grip.state.places
    change = -np.linalg.solve(state.jacobian, tubes.equation_rates())
    change[:, -3:] = grip.response.change
    _, utilisation = tubes.utilisation(tubes.respond(change))
    sum_by_member, by_parameters = grip.contacts.sum_by_member, change[:, :-3]
    presses = sum_by_member(by_parameters[indices.normal])
    rubs = sum_by_member(by_parameters[indices.friction])
    needs = grip.friction_forces / grip.normal_forces
    most = int(np.abs(needs).argmax())
    slips = np.sign(needs[most]) * (rubs[most] - needs[most] * presses[most])
    return GraspGradient(
        parameters=parameters,
        settled=settled,
        pose=by_parameters[:3],
        normal_forces=presses,
        friction_forces=-rubs,
        required_friction=slips / grip.normal_forces[most],
        utilisation=utilisation[:, :-3],
        _changes=(tubes, change),
    )


def _equation_changes(grip: HeldGrip, tubes: LoadedTubes, change: Array, moved: Array) -> Array:
    """Return the derivatives of the equilibrium equations by parameters in a displaced state."""
    state, unknowns = grip.state, grip.state.unknowns + moved
    dents = grip.statics.dents.smooth_near(state.normal_forces, grip.angles)
    statics = replace(grip.statics, dents=dents)
    bent = statics.bent.update(statics.loads(unknowns), unknowns[state.places.feet])
    statics = replace(statics, bent=bent)
    _, state = statics.equations(unknowns, grip.wrench, statics.sticking)
    displaced = LoadedTubes.at(replace(grip, statics=statics, state=state), bent, tubes.changes)
    return state.jacobian @ change + displaced.equation_rates(sticks=True)
