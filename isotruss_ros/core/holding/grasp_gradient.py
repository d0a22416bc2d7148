# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Derivatives of a settled grasp with respect to the parameters of an optimiser.

They are central differences of fourth order of equilibria beside the grasp. The equilibria for all
parameters are samples with the same contacts, which start at the grasp and are found together, in
two steps of Newton's method. So no formula of a derivative is needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from isotruss_ros.core.contact.dents import Dents
from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.holding.equations import Grasps
from isotruss_ros.core.holding.grip_response import find_slip_planes, slip_planes
from isotruss_ros.core.holding.held_gradient import GraspParameters
from isotruss_ros.core.holding.held_grip import Equilibria, HeldGrip
from isotruss_ros.core.holding.newton import by_layout, Iterate, linearize_at, step
from isotruss_ros.core.holding.pressed_contacts import POSE
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.model.parameter_deviations import ParameterDeviations as Uncertainty
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.numerics.samples import take
from isotruss_ros.core.statics.inclinations import RING_HALF_WIDTH
from isotruss_ros.core.statics.structure import ConfigurationSamples, Structure
from isotruss_ros.core.statics.wrinkling import utilise_at
import numpy as np

#: Steps of the differences: roller travel [m], given pose [m, rad], pressures relative to their
#: values, coefficient of friction, wrench [N], and stiffness relative to its value.
STEPS = {
    'rollers': 1e-4,
    'place': 1e-4,
    'pressures': 1e-3,
    'friction': 1e-3,
    'wrench': 1e-2,
    'stiffness': 1e-3,
}
#: Multiples of the steps.
MULTIPLES = np.array([2.0, 1.0, -1.0, -2.0])
#: Largest sliding of a contact in a step, relative to its distance from the nearest guide ring or
#: pinch point, and largest change of its normal force, relative to the force [-]. At a ring and at
#: zero force there is a kink.
KINK_SHARE = 0.02
#: Steps in which pressures' effects on dents are differentiated by force (relative) and angle.
RATE_STEP = 1e-4
#: Smallest force whose share is such a step [N].
LEAST_FORCE = 1e-9
#: Steps of Newton's method from the grasp to an equilibrium beside it.
NEWTON_STEPS = 2


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
    slip_margin: Array
    stiffness: Array  #: (3, 3, p) derivatives of `SettledGrasp.stiffness`

    @property
    def squeeze(self) -> Array:
        """Return the derivatives (p,) of the members' mean normal force by the parameters."""
        return self.normal_forces.mean(axis=0)

    @check_kinds
    def chance(self, uncertainty: Uncertainty) -> Array:
        """Return the derivatives (p + 1,) of the chance, see `Uncertainty.chance_gradient`."""
        return uncertainty.chance_gradient(self)


@check_kinds
@single_threaded
def grasp_gradient(settled: SettledGrasp) -> GraspGradient:
    """
    Return the derivatives of a settled grasp with respect to the parameters of an optimiser.

    :param settled: the settled grasp.
    :raises GraspError: the equilibrium is neutral, so that it has no derivatives, or there is none
        beside it: a contact is at a kink.
    """
    grip = settled.equilibrium
    if grip is None:  # only pose and slip margin change
        return _differentiate_gaps(settled)
    if grip.response is None:
        raise GraspError(
            'the equilibrium is neutral, so it has no derivatives: it must resist every motion'
        )
    parameters, inputs = GraspParameters.of(grip.config), grip.inputs
    steps = np.empty(parameters.size)
    for name, size in STEPS.items():
        steps[getattr(parameters, name)] = size
    steps[parameters.pressures] *= inputs.pressures
    steps[parameters.wrench] *= 1.0, 1.0, grip.arm
    steps[parameters.stiffness] *= inputs.stiffness
    every = np.eye(parameters.size)
    rates = _differentiate(settled, grip, steps[:, None] * every, parameters)
    # Shorter steps where a contact would come too near to a kink.
    to_kinks, rows = _distances_to_kinks(grip)
    shares = np.abs(rates['unknowns'][:, rows]) * steps[:, None] / to_kinks
    shares = shares.max(axis=1) / KINK_SHARE
    is_near = shares > 1.0
    if is_near.any():
        shorter = (steps / np.maximum(shares, 1.0))[:, None] * every
        for name, values in _differentiate(settled, grip, shorter[is_near], parameters).items():
            rates[name][is_near] = values
    columns = {name: np.moveaxis(values, 0, -1) for name, values in rates.items()}
    ratios = grip.friction_forces / grip.normal_forces
    slipping = int(np.abs(ratios).argmax())  # member
    return GraspGradient(
        parameters=parameters,
        settled=settled,
        pose=columns['unknowns'][:POSE],
        normal_forces=columns['normal_forces'],
        friction_forces=columns['friction_forces'],
        required_friction=np.sign(ratios[slipping]) * columns['ratios'][slipping],
        utilisation=columns['utilisation'],
        slip_margin=columns['slip_margin'],
        stiffness=columns['stiffness'],
    )


def _differentiate_gaps(settled: SettledGrasp) -> GraspGradient:
    """Return the derivatives of a grasp without an equilibrium, see `LostContact`."""
    lost: Any = settled.lost
    parameters = GraspParameters.of(lost.inputs.config)
    none = np.zeros(parameters.size)
    margin = none.copy()
    margin[parameters.rollers], margin[parameters.place] = lost.slip_margin_rates()
    return GraspGradient(
        parameters=parameters,
        settled=settled,
        pose=np.eye(3, parameters.size, parameters.place.start),
        normal_forces=np.zeros((0, parameters.size)),
        friction_forces=np.zeros((0, parameters.size)),
        required_friction=none,
        utilisation=np.zeros((len(settled.utilisation), parameters.size)),
        slip_margin=margin,
        stiffness=np.zeros((3, 3, parameters.size)),
    )


def _distances_to_kinks(grip: HeldGrip) -> tuple[Array, Array]:
    """Return distances of contacts from kinks, and the indices of the unknowns that reach them."""
    state, structure = grip.state, grip.samples.g.structure
    pieces, within, _ = structure.locate(grip.contacts.members, state.feet)
    lengths = structure.frame.length.take(grip.number, axis=0)[pieces[grip.number]]
    within = within[grip.number]
    to_piece_ends = np.minimum(within, lengths - within)
    to_width_ends = np.abs(to_piece_ends - RING_HALF_WIDTH)
    to_kinks = np.concatenate([to_piece_ends, to_width_ends, state.normal_forces])
    places = np.arange(len(state.unknowns))
    rows = np.concatenate([places[state.places.feet]] * 2 + [places[state.places.normal]])
    # In the kink itself no step is short enough.
    is_beside = to_kinks > 0.0
    return to_kinks[is_beside], rows[is_beside]


def _differentiate(
    settled: SettledGrasp, grip: HeldGrip, steps: Array, parameters: GraspParameters
) -> dict[str, Array]:
    """Return the derivatives (q, ...) of values of the grasp along steps (q, p)."""
    changes = (MULTIPLES[:, None, None] * steps).reshape(-1, parameters.size)
    one, count = grip.alone, len(changes)
    tubes, unknowns = one.linear.tubes, one.iterate.unknowns
    bent = tubes.activate(one.iterate.bent)
    # The grasp itself on tubes that are all deformable, whose most loaded places are compared.
    usage = take(Equilibria(one.g, Iterate(unknowns, bent)).sections, 0)
    planes = slip_planes(grip.response, settled.friction)
    nearest = int((planes.reserve / planes.size).argmin())
    friction = settled.friction + changes[:, parameters.friction]
    g = _change(grip, changes, parameters)
    at = Iterate(*_repeat((unknowns, bent), count))
    for _ in range(NEWTON_STEPS):
        at = _step_each(g, at)
    values: dict[str, Array] = {}
    for numbers, of_g, of_at in by_layout(g, at):
        beside = Equilibria(of_g, of_at, linearize_at(of_g, of_at))
        slip = find_slip_planes(beside.response, friction[numbers])
        frame = beside.linear.tubes.tangent.frame
        found = {
            'unknowns': of_at.unknowns,
            'normal_forces': beside.normal_forces,
            'friction_forces': -beside.friction_forces,  # on the object
            'ratios': beside.friction_forces / beside.normal_forces,
            'utilisation': utilise_at(of_g.structure, frame, *beside.end_forces, usage),
            'slip_margin': slip.reserve[:, nearest] / slip.size[:, nearest],
            'stiffness': beside.response.stiffness,
        }
        for name, of_group in found.items():
            known = values.setdefault(name, np.empty((count, *of_group.shape[1:])))
            known[numbers] = of_group
    if not np.isfinite(values['unknowns']).all():
        raise GraspError('there is no equilibrium beside the grasp: it has no derivatives')
    # A tube without loads has a kink at zero.
    values['utilisation'][:, grip.sections.sections[0] == 0.0] = 0.0
    rates = {}
    for name, of_samples in values.items():
        far, near, behind, farther = of_samples.reshape(4, len(steps), *of_samples.shape[1:])
        size = steps.sum(axis=1).reshape(-1, *(1,) * (of_samples.ndim - 1))
        rates[name] = (8.0 * (near - behind) - (far - farther)) / (12.0 * size)
    return rates


def _change(grip: HeldGrip, changes: Array, parameters: GraspParameters) -> Grasps:
    """Return the constants of a grasp after n changes (n, p) of the parameters."""
    inputs, one = grip.inputs, grip.alone
    config, contacts = inputs.config, one.g.contacts
    distinct, index = np.unique(changes[:, parameters.rollers], axis=0, return_inverse=True)
    moved = config.moved_together(config.roller_positions + distinct)
    for near in moved:
        if isinstance(near, ConfigurationError):
            raise GraspError(f'there is no configuration beside that of the grasp: {near}')
    configs: Any = [moved[i] for i in index.ravel().tolist()]
    gauge = changes[:, parameters.pressures]
    structure = Structure(
        ConfigurationSamples(configs),
        np.array(inputs.pressures) + gauge,
        inputs.stiffness + changes[:, parameters.stiffness],
    )
    poses = np.array(inputs.body.pose) + changes[:, parameters.place]
    bodies = ObjectSamples([inputs.body] * len(changes)).moved_to(poses)
    wrench = grip.wrench + changes[:, parameters.wrench] / (1.0, 1.0, grip.arm)
    tubes = config.robot.topology.tube[contacts.members]
    dents = _DentsBeside.of(grip, gauge[:, tubes])
    return Grasps.of(structure, bodies, contacts, wrench, one.g.grazing, dents=dents)


def _step_each(g: Grasps, at: Iterate) -> Iterate:
    """Return n samples after a step of Newton's method."""
    unknowns = np.empty(at.unknowns.shape)
    bent = type(at.bent)(*(values.copy() for values in at.bent))
    for numbers, of_g, of_at in by_layout(g, at):
        after = step(of_g, linearize_at(of_g, of_at)).iterate
        unknowns[numbers] = after.unknowns
        for values, changed in zip(bent, after.bent, strict=True):
            values[numbers] = changed
    return Iterate(unknowns, bent)


def _repeat(record: Any, count: int) -> Any:
    """Return a record of one sample as that of several samples."""
    return take(record, np.zeros(count, dtype=int))


class _DentsBeside:
    """Dents near those of a grasp, under n changes (n, k) of the pressures, to first order."""

    def __init__(self, near: Dents, changes: Array) -> None:
        self._near, self._changes = near, changes
        self._inflated = np.flatnonzero(changes.any(axis=-1))

    @classmethod
    def of(cls, grip: HeldGrip, changes: Array) -> _DentsBeside:
        """Return the dents at the contacts of a grasp, as functions without kinks near it."""
        tables = np.tile(grip.alone.g.dents.tables, (len(changes), 1))
        shape = np.ones((len(changes), 1))
        near = Dents(tables).smooth_near(shape * grip.state.normal_forces, shape * grip.angles)
        return cls(near, changes)

    def __call__(self, forces: Array, angles: Array) -> tuple[Array, Array, Array]:
        """Return depths and derivatives, see `Dents`."""
        values, rows = self._near(forces, angles), self._inflated
        if len(rows):
            sizes = RATE_STEP * np.maximum(np.abs(forces[rows]), LEAST_FORCE)
            turn = RATE_STEP * np.ones(sizes.shape)
            shifts = ((0.0, 0.0), (sizes, 0.0), (-sizes, 0.0), (0.0, turn), (0.0, -turn))
            # Rates at the forces and angles, and beside them.
            near = self._near.take_samples(np.tile(rows, len(shifts)))
            at = ([of + d[i] for d in shifts] for i, of in enumerate((forces[rows], angles[rows])))
            rates = near.pressure_rates(*map(np.concatenate, at)).reshape(5, *sizes.shape)
            here, more, less, left, right = self._changes[rows] * rates
            changes = here, (more - less) / (2.0 * sizes), (left - right) / (2.0 * turn)
            for value, change in zip(values, changes, strict=True):
                value[rows] += change
        return values

    def take_samples(self, index: Any) -> _DentsBeside:
        """Return the dents of chosen samples, see `samples.take`."""
        return _DentsBeside(self._near.take_samples(index), self._changes[index])
