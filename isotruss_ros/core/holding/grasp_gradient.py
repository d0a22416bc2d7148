# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Derivatives of held objects by travel and parameters, and of settled grasps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from isotruss_ros.core.contact.dents import Dents
from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.holding.contacts import ANGLE, POSE
from isotruss_ros.core.holding.equations import Grasps, Linear
from isotruss_ros.core.holding.grip_response import find_slip_planes, slip_planes
from isotruss_ros.core.holding.held_grip import Equilibria, HeldGrip
from isotruss_ros.core.holding.newton import by_layout, Iterate, linearize_at, step
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.model.parameter_deviations import ParameterDeviations as Uncertainty
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.numerics.samples import take
from isotruss_ros.core.numerics.tolerances import EPSILON
from isotruss_ros.core.statics.bent_tubes import (
    BentTubes,
    find_load_changes,
    find_section_changes,
    TubeRates,
)
from isotruss_ros.core.statics.structure import (
    ConfigurationSamples,
    RING_HALF_WIDTH,
    section_rates,
    Structure,
)
from isotruss_ros.core.statics.wrinkling import evaluate_utilisation, utilise_at
import numpy as np

# Derivatives of a held object's equilibrium and the loaded robot with respect to parameters.
#
# From the equilibrium equations F(y, x) = 0 follows y' = -F_y^-1 F_x.


class GraspParameters(NamedTuple):
    """Indices of the columns that belong to each of the p parameters in a gradient."""

    rollers: slice  #: travel of the r rollers [m]
    place: slice  #: x, y and angle of the object's given pose [m, rad]
    pressures: slice  #: gauge pressures of the t tubes, in the order of the robot file [Pa]
    friction: int  #: coefficient of friction [-]
    wrench: slice  #: wrench fx, fy, m on the object [N, N m]
    stiffness: int  #: ratio of the tubes' true EA, EI and GA to the modelled ones [-]
    size: int  #: number p of the parameters

    @classmethod
    def of(cls, config: Configuration) -> GraspParameters:
        """Return the column indices of all parameters of grasps by a robot."""
        rollers = len(config.roller_positions)
        pressures_end = rollers + 3 + len(config.robot.description.pressures)
        return cls(
            rollers=slice(0, rollers),
            place=slice(rollers, rollers + 3),
            pressures=slice(rollers + 3, pressures_end),
            friction=pressures_end,
            wrench=slice(pressures_end + 1, pressures_end + 4),
            stiffness=pressures_end + 4,
            size=pressures_end + 5,
        )


class ParameterChanges(NamedTuple):
    """Derivatives of robot, wrench and given pose along p directions of parameter changes."""

    spins: Array  #: (k, p) rotations of the contacts' members [rad]
    sections: Array  #: (4, c, p) rest length, EA, EI and GA of the frame's parts
    nodes: Points  #: (n, p) positions of the undeformed robot's nodes, x + iy [m]
    pressures: Array  #: (t, p) gauge pressures of the tubes [Pa]
    place: Array  #: (3, p) given pose of the object [m, rad]
    wrench: Array  #: (3, p) wrench on the object, see `HeldGrip.wrench` [N]

    @classmethod
    def of(
        cls, grip: HeldGrip, bent: BentTubes, directions: Array, columns: GraspParameters
    ) -> ParameterChanges:
        """Return the derivatives along p `directions` (n, p) of the n parameters."""
        members, topology = grip.contacts.members, grip.config.robot.topology
        by_rollers = grip.config.node_jacobian.T.copy().view(np.complex128).T
        nodes = by_rollers @ directions[columns.rollers]
        span_rates = nodes[topology.end[members]] - nodes[topology.b[members]]
        pressures = directions[columns.pressures]
        return cls(
            spins=(span_rates / (bent.lines.length * bent.lines.axis)[:, None]).imag,
            sections=section_rates(
                bent.structure, bent.tangent.frame, nodes, pressures, directions[columns.stiffness]
            ),
            nodes=nodes,
            pressures=pressures,
            place=directions[columns.place],
            wrench=directions[columns.wrench] / np.array([[1.0], [1.0], [grip.arm]]),
        )


class LoadedTubes(NamedTuple):
    """Bent tubes of a robot with a held object, with derivatives along p parameter changes."""

    grip: HeldGrip  #: the held object
    linear: Linear  #: its linearised equations
    tubes: BentTubes  #: the tubes of this sample
    changes: ParameterChanges  #: the parameter changes
    depth_rates: Array  #: (k, p) derivatives of the dents' depths at constant unknowns [m]
    by_sections: TubeRates  #: derivatives at constant loads

    @classmethod
    def of(
        cls, grip: HeldGrip, directions: Array, columns: GraspParameters, exact: bool = False
    ) -> LoadedTubes:
        """
        Return the tubes with derivatives along p `directions` (n, p) of the n parameters.

        If they must be exact, the equations are linearised at the equilibrium; otherwise those of
        the last step of Newton's method are taken.
        """
        if grip.response is None:
            raise GraspError(
                'the equilibrium is neutral, so it has no derivatives: it must resist every motion'
            )
        one = grip.alone
        linear = linearize_at(one.g, one.iterate) if exact else one.linear
        tubes = take(linear.tubes, 0)
        changes = ParameterChanges.of(grip, tubes, directions, columns)
        state, dents = grip.state, one.g.dents.take_samples(0)
        angles = np.angle(state.normals * np.exp(-1j * state.unknowns[ANGLE]))
        tube = grip.config.robot.topology.tube[grip.contacts.members]
        depth_rates = linear.pushes.depth_by_angle[0][:, None] * changes.spins
        if changes.pressures.any():
            by_pressure = dents.pressure_rates(state.normal_forces, angles)
            depth_rates += by_pressure[:, None] * changes.pressures[tube]
        by_sections = find_section_changes(tubes, changes.sections, changes.nodes)
        return cls(grip, linear, tubes, changes, depth_rates, by_sections)

    def equation_rates(self, sticks: bool = False) -> Array:
        """Return the equations' derivatives (3 + 4k, p), for `sticks` those without slip."""
        grip, g, state, body = self.grip, self.grip.samples.g, self.grip.state, self.grip.body
        indices, normals, lines = state.places, state.normals[:, None], self.tubes.lines
        layout = self.tubes.tangent.frame.layout
        spins, axis = self.changes.spins, lines.axis[:, None]
        at_constant_unknowns = self.respond(np.zeros((indices.size, spins.shape[1])))
        # Touch: gaps from the object's surface to the tubes, in axes that turn with the members.
        node_rates = at_constant_unknowns.nodes[layout.nodes]
        displaced = self.tubes.tangent.displacements[layout.nodes]
        points, radii = body.shape.surface_at(g.contacts.corners, state.normals / body.turn)
        to_contacts = (body.turn * points)[:, None]
        # The contact points move on the surface, because the normals turn with the members.
        contact_rates = 1j * radii[:, None] * spins * normals
        feet = lines.start + lines.axis * state.feet + displaced[:, 0] + 1j * displaced[:, 1]
        gaps = feet[:, None] - body.center - to_contacts
        # The last term is the rotation of the members' axes, in which the gaps are.
        foot_rates = node_rates[:, 0] + 1j * node_rates[:, 1] - 1j * spins * gaps
        gap_rates = (foot_rates - contact_rates + self.depth_rates * normals) / axis
        slope_rates = at_constant_unknowns.inclinations - spins
        touch = np.stack([gap_rates.real, gap_rates.imag, slope_rates], axis=1)
        # Balance: the forces on the tubes, x + iy, turn with the members.
        forces = self.linear.pushes.forces[0][:, None] * axis
        force_rates = 1j * spins * forces
        torques = contact_rates.conj() * forces + to_contacts.conj() * force_rates
        torque = torques.imag.sum(axis=0)
        total = force_rates.sum(axis=0)
        balance = self.changes.wrench - np.stack([total.real, total.imag, torque / grip.arm])
        # The conditions depend on the normals, which turn with the members.
        rows = self.linear.jacobian[0, indices.conditions]
        if sticks:
            rows = grip.alone.g.rolling_rows(radii[None])[0]
        conditions = rows[:, indices.inclinations] @ spins
        if not sticks:
            # Other conditions depend on the pose relative to the measured pose, of which x and y
            # are those of the centroid. If the measured angle changes, both centroids turn about
            # their origins; `turning` is the difference.
            measured = grip.measured
            shift = measured.middle - measured.center - (body.middle - body.center)
            turning = np.outer([-shift.imag, shift.real, 0.0], self.changes.place[ANGLE])
            conditions -= rows[:, :POSE] @ (self.changes.place + turning)
        return np.concatenate([touch.reshape(3 * len(gaps), -1), balance, conditions])

    def respond(self, change: Array) -> TubeRates:
        """Return the tubes' derivatives, given those (3 + 4k, p) of the equilibrium's unknowns."""
        state, changes = self.grip.state, self.changes
        force_rates = 1j * changes.spins * self.linear.pushes.forces[0][:, None]
        # Friction acts at the skin, so its moment depends on the depths of the dents.
        moment_rates = self.depth_rates * state.friction_forces[:, None]
        loads = np.stack([force_rates.real, force_rates.imag, moment_rates], axis=1)
        loads += self.linear.load_rates(change[None])[0].reshape(loads.shape)
        by_loads = find_load_changes(self.tubes, loads, change[state.places.feet])
        return TubeRates(*map(np.add, self.by_sections, by_loads))

    def utilisation(self, rates: TubeRates) -> tuple[Array, Array]:
        """
        Return the members' utilisations (m,), and their derivatives (m, p).

        That of a tube without loads has a kink at zero; its derivatives are zero.
        """
        robot, changes, usage = self.grip.config.robot, self.changes, self.grip.sections
        tube, loaded = robot.topology.tube, np.flatnonzero(usage.sections[0])
        radius, piece = 0.5 * robot.description.tube_diameter, usage.piece[loaded]
        # Loads of `evaluate_utilisation`: the bending moments are -M1 and M2 of `EndForces`, of
        # which the sum M1 + M2 and the difference M1 - M2 are given; wall tension, axial force.
        by_nodes, _ = self.tubes.tangent.force_changes(rates.nodes)
        force_rates = (rates.forces + by_nodes)[piece]
        by_end_forces = np.array([[0.0, -0.5, -0.5], [0.0, 0.5, -0.5], [1.0, 0.0, 0.0]])
        load_rates = np.tensordot(by_end_forces, force_rates, (1, 1))
        load_rates[2] += np.pi * radius**2 * changes.pressures[tube[loaded]]
        load_rates = np.concatenate([load_rates, force_rates[None, :, 0]])
        length_and_section_rates = changes.sections[[0, 2, 3]][:, piece]
        # Complex step at the same kind of place. The utilisation of a tube without wall tension is
        # infinite and has no derivative.
        varied_loads = usage.loads[:, loaded, None] + 1j * EPSILON * load_rates
        varied_sections = usage.sections[:, loaded, None] + 1j * EPSILON * length_and_section_rates
        used, _ = evaluate_utilisation(varied_loads, varied_sections, radius)
        used_rates = np.zeros((len(tube), used.shape[2]))
        used_rates[loaded] = used[usage.kind[loaded], np.arange(len(loaded))].imag / EPSILON
        return usage.used, used_rates


class HeldGradient(NamedTuple):
    """
    Derivatives of the unknowns, normal forces and joint positions of a held object.

    The p = r + k columns are the parameters: travel of the r rollers [m], and rolling invariants
    of the k contacts [m], see `Grasps.find_anchors`.
    """

    unknowns: Array  #: (3 + 4k, p) derivatives of the unknowns, first the pose (x, y, angle)
    normal_forces: Array  #: (m, p) derivatives of the normal forces of the grasping members
    #: (2j, p) derivatives of the joint positions (x0, y0, x1, y1, ...), in the order of
    #: `Topology.joint_names`
    joints: Array

    @property
    def pose(self) -> Array:
        """Return the derivatives (3, p) of x, y and angle."""
        return self.unknowns[:POSE]


@single_threaded
def held_gradient(grip: HeldGrip) -> HeldGradient:
    """Return the derivatives by roller travel and rolling invariants; the contacts stick."""
    indices, parameters = grip.state.places, GraspParameters.of(grip.config)
    rollers, count = len(grip.config.roller_positions), len(grip.contacts.members)
    # Columns: roller travel, then rolling invariants, which change no parameter of a grasp.
    directions = np.zeros((parameters.size, rollers + count))
    directions[parameters.rollers, :rollers] = np.eye(rollers)
    tubes = LoadedTubes.of(grip, directions, parameters)
    residuals = tubes.equation_rates(sticks=True)
    residuals[indices.conditions, :rollers] += grip.anchor_rates
    residuals[indices.conditions, rollers:] -= np.eye(count)
    change = grip.respond(residuals)
    forces = grip.contacts.sum_by_member(change[indices.normal])
    joints = tubes.respond(change).nodes[: len(grip.config.robot.topology.joint_names), :2]
    return HeldGradient(change, forces, joints.reshape(-1, change.shape[1]))


# Derivatives of a settled grasp with respect to the parameters of an optimiser.
#
# They are central differences of fourth order of equilibria beside the grasp. The equilibria for
# all parameters are samples with the same contacts, which start at the grasp and are found
# together, in two steps of Newton's method. So no formula of a derivative is needed.

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
