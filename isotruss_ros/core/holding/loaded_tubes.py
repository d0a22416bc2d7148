# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Derivatives by parameters of the equations of a held object, and of the loaded robot."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.statics.cut_frame import CutFrame, FrameRates, structure_rates
from isotruss_ros.core.statics.frame import FrameState
from isotruss_ros.core.statics.wrinkling import find_most_used
import numpy as np


class GraspParameters(NamedTuple):
    """
    Columns of the p parameters in a gradient.

    :ivar rollers: travel of the r rollers [m].
    :ivar place: x, y, angle of the pose at which the object is set down [m, rad].
    :ivar pressures: gauge, of the t tubes in the order of the robot file [Pa].
    :ivar friction: coefficient.
    :ivar wrench: fx, fy, m on the object [N, N m].
    :ivar stiffness: that of robot and tubes against the model's [-].
    :ivar size: p.
    """

    rollers: slice
    place: slice
    pressures: slice
    friction: int
    wrench: slice
    stiffness: int
    size: int

    @classmethod
    def of(cls, config: Configuration) -> GraspParameters:
        """
        Return the columns for grasps by a robot.

        :param config: configuration of the robot.
        """
        rollers = len(config.roller_positions)
        tubes = rollers + 3 + len(config.robot.description.pressures)
        return cls(
            rollers=slice(0, rollers),
            place=slice(rollers, rollers + 3),
            pressures=slice(rollers + 3, tubes),
            friction=tubes,
            wrench=slice(tubes + 1, tubes + 4),
            stiffness=tubes + 4,
            size=tubes + 5,
        )


class ContactRates(NamedTuple):
    """
    Derivatives of k contacts by p parameters.

    :ivar feet: (k, p) along the members [m].
    :ivar normals: (k, p) turn of the normals of the bent tubes [rad].
    :ivar forces: (k, p) N + iT [N].
    :ivar dents: (k, p) depths of the dents [m].
    """

    feet: Array
    normals: Array
    forces: Points
    dents: Array


class TubeRates(NamedTuple):
    """
    Derivatives of the tubes of a robot by p parameters.

    :ivar give: (k, p) displacements of the contacts, along + i across the members [m].
    :ivar slope: (k, p) of the bent centre lines there [-].
    :ivar displacements: (n, 3, p) of the nodes of the cut frame [m, rad].
    :ivar ends: (c, 6, p) end forces of its members [N], [N m].
    :ivar multipliers: (e, p) of its constraints.
    :ivar frame: how the frame itself changes.
    """

    give: Points
    slope: Array
    displacements: Array
    ends: Array
    multipliers: Array
    frame: FrameRates


class LoadedTubes:
    """
    The frame of a robot with the contacts of a held object as nodes, as p columns change it.

    :ivar moved: (N, p) velocities of the nodes of the configuration, x + iy [m].
    :ivar spins: (k, p) turns of the members [rad].
    :ivar dents: (k, p) changes of the dents under forces that stay [m].
    :ivar softened: (k, p) the same of their derivatives by the forces [m/N].
    :ivar softer: (p,) changes of the compliance of robot and tubes, as a share.
    :param grip: how the object is held.
    :param chosen: (n, p) how the parameters change in each column.
    :param parameters: which row of these is which.
    """

    def __init__(self, grip: HeldGrip, chosen: Array, parameters: GraspParameters) -> None:
        self._grip, self._chosen, self._parameters = grip, chosen, parameters
        compliance, state, statics = grip.statics.compliance, grip.state, grip.statics
        nodes = grip.config.node_jacobian.T.copy().view(np.complex128).T
        self.moved = moved = nodes @ chosen[parameters.rollers]
        self._inflated = inflated = chosen[parameters.pressures]
        self._structure = compliance.structure
        located = self._structure.locate(grip.contacts.members, state.feet)
        self._frame = CutFrame(self._structure.frame, *located[:2])
        self._rates = structure_rates(self._structure, moved, inflated)
        topology, members = grip.config.robot.topology, grip.contacts.members
        # Velocities of the pinch points at which the members start.
        self._starts = moved[topology.b[members]]
        ahead = moved[topology.c[topology.following[members]]] - self._starts
        span = compliance.length * compliance.axis
        self.spins: Array = (ahead / span[:, None]).imag
        normal = state.normal_forces
        self._push = (normal + 1j * state.friction_forces) * state.normals
        depths, self._soft = statics.indentation(normal)
        self._skin = statics.tube_radius - depths
        couples = -self._skin * state.friction_forces
        self._state = self._frame.solve(self._loads(self._push[:, None], couples[:, None])[..., 0])
        curves, dents, softened = statics.indentation.second_rates(normal)
        blown = inflated[topology.tube[members]]
        stiffer = chosen[parameters.stiffness] / grip.tubes.stiffness_scale
        self.softer = -stiffer
        self.dents = dents[:, None] * blown - np.outer(self._soft * normal, stiffer)
        self.softened = softened[:, None] * blown
        self.softened -= np.outer(curves * normal + self._soft, stiffer)

    @property
    def displacements(self) -> Array:
        """Return those of the nodes of the cut frame, joints first, (n, 3) [m, rad]."""
        return self._state.displacements

    def contact_rates(self, change: Array) -> ContactRates:
        """
        Return the derivatives of the contacts.

        :param change: (3 + 4k, p) how the unknowns do.
        """
        places = self._grip.state.places
        normal = change[places.normal]
        return ContactRates(
            change[places.feet],
            self.spins + change[places.inclinations],
            normal + 1j * change[places.friction],
            self.dents + self._soft[:, None] * normal,
        )

    def equation_rates(self) -> Array:
        """Return the derivatives of the residual at constant unknowns, (3 + 4k, p)."""
        grip, spins = self._grip, self.spins
        statics, state, body = grip.statics, grip.state, grip.body
        places, axis = state.places, statics.compliance.axis[:, None]
        normals, scale = state.normals[:, None], grip.tubes.stiffness_scale
        zero = np.zeros_like(spins)
        give, slope, *_ = self.respond(ContactRates(zero, spins, zero + 0j, self.dents))
        own = statics.compliance.at(state.feet).respond(state.loads)
        points, radii = body.shape.surface_at(statics.contacts.corners, state.normals / body.turn)
        # Points of the surface whose normals turn with the members.
        arms, swept = (body.turn * points)[:, None], 1j * radii[:, None] * spins * normals
        away = statics.compliance.start[:, None] - state.center - arms
        gap = self._starts - swept - 1j * spins * away + self.dents * normals
        gap = gap / axis + give / scale + (own[:, 0] + 1j * own[:, 1])[:, None] * self.softer
        slope = slope / scale + own[:, 2, None] * self.softer
        forces = self._push[:, None]
        turned = 1j * spins * forces
        torque = (swept.conj() * forces + arms.conj() * turned).imag.sum(axis=0)
        total = turned.sum(axis=0)
        wrench = self._chosen[self._parameters.wrench] / np.array([[1.0], [1.0], [grip.arm]])
        # The closure depends on the normals, and on how far the pose is from where it was set; the
        # middle, which counts, has turned about the origin since.
        closing, measured = state.jacobian[places.closure], statics.body
        closure = closing[:, places.inclinations] @ spins
        place = self._chosen[self._parameters.place]
        still = measured.middle - measured.center - (body.middle - body.center)
        place = place + np.array([[-still.imag], [still.real], [0.0]]) * place[2]
        closure -= closing[:, :3] @ place
        balance = wrench - np.stack([total.real, total.imag, torque / grip.arm])
        touch = np.stack([gap.real, gap.imag, slope], axis=1).reshape(3 * len(gap), -1)
        return np.concatenate([touch, balance, closure])

    def respond(self, contacts: ContactRates) -> TubeRates:
        """
        Return the response of the tubes.

        :param contacts: how these change.
        """
        grip, frame, state = self._grip, self._frame, self._grip.state
        axis = grip.statics.compliance.axis[:, None]
        forces = contacts.forces * state.normals[:, None]
        forces += 1j * contacts.normals * self._push[:, None]
        couples = contacts.dents * state.friction_forces[:, None]
        couples -= self._skin[:, None] * contacts.forces.imag
        places = self._starts + axis * (1j * self.spins * state.feet[:, None] + contacts.feet)
        rates = FrameRates(
            np.concatenate([self._rates.points, places]),
            self._rates.flexibility[:, frame.whole],
            self._rates.rows,
        )
        changes = frame.rates(self._state, rates, self._loads(forces, couples))
        return TubeRates(*self._give(self._state, rates, *changes[:2]), *changes, rates)

    def respond_again(
        self, rates: TubeRates, place: int, forces: Points, couples: Array
    ) -> tuple[Points, Array]:
        """
        Return how much more the tubes give once one of the parameters has changed.

        That one moves contacts along their members and changes their forces, nothing else.

        :param rates: of all parameters.
        :param place: of the one among them.
        :param forces: (k, p) mixed second derivatives of the forces, x + iy [N].
        :param couples: (k, p) the same of the couples [N m].
        :return: give (k, p) and slope (k, p), mixed second derivatives, see `TubeRates`.
        """
        frame, own = self._frame, self._frame.members
        points = rates.frame.points[:, place]
        longer = ((points[own.end] - points[own.start]) / frame.axis).real
        changes = rates.displacements, rates.ends
        still = frame.mixed_rates(self._state, changes, rates.frame, longer)
        state = replace(
            self._state,
            displacements=rates.displacements[..., place],
            end_forces=rates.ends[..., place],
            multipliers=rates.multipliers[:, place],
        )
        moved, ends, _ = frame.rates(state, rates.frame, self._loads(forces, couples), still)
        return self._give(state, rates.frame, moved, ends)

    def _loads(self, forces: Points, couples: Array) -> Array:
        """Return loads (n, 3, p) on the nodes: those at the contacts."""
        loads = np.zeros((len(self._frame.points), 3, forces.shape[1]))
        loads[self._frame.nodes] = np.stack([forces.real, forces.imag, couples], axis=1)
        return loads

    def _give(
        self, state: FrameState, rates: FrameRates, moved: Array, ends: Array
    ) -> tuple[Points, Array]:
        """Return how contacts give as the frame changes from a state, see `TubeRates`."""
        frame, nodes = self._frame, self._frame.nodes
        still = state.displacements[nodes]
        give = moved[nodes, 0] + 1j * moved[nodes, 1]
        give -= 1j * self.spins * (still[:, 0] + 1j * still[:, 1])[:, None]
        # The mean slope of both sides is that of the section, sheared by the mean force across.
        sheared = 0.5 * (ends[frame.before, 4] - ends[frame.behind, 1])
        across = 0.5 * (state.end_forces[frame.before, 4] - state.end_forces[frame.behind, 1])
        slope = moved[nodes, 2] + sheared / frame.members.shear[frame.before, None]
        slope += across[:, None] * rates.flexibility[2, frame.before]
        return give / self._grip.statics.compliance.axis[:, None], slope

    def utilisation(self, ends: Array) -> tuple[Array, Array]:
        """
        Return the utilisation of each member, (m,), with derivatives (m, p).

        :param ends: (c, 6, p) changes of the end forces, see `respond`.
        """
        robot = self._grip.config.robot
        topology = robot.topology
        radius = 0.5 * robot.description.tube_diameter
        first, owners = self._structure.pieces[0, 0], self._structure.owners.ravel()
        pieces = np.flatnonzero(self._frame.whole >= first)
        member = owners[self._frame.whole[pieces] - first]
        forces, changes = self._state.end_forces[pieces], ends[pieces]
        moment = np.concatenate([forces[:, 2], forces[:, 5]])
        wall = np.pi * radius**2 * np.array(self._structure.pressures)[topology.tube[member]]
        left = np.concatenate([wall - forces[:, 0], wall + forces[:, 3]])
        bent = np.concatenate([changes[:, 2], changes[:, 5]]) * np.sign(moment)[:, None]
        blown = np.pi * radius**2 * self._inflated[topology.tube[member]]
        slack = np.concatenate([blown - changes[:, 0], blown + changes[:, 3]])
        used = np.full(len(moment), np.inf)
        np.divide(2.0 * np.abs(moment), radius * left, out=used, where=left > 0.0)
        member = np.tile(member, 2)
        last = find_most_used(used, member)
        # A tube that has lost its tension bears no moment, more or less of it.
        taut = left[last] > 0.0
        rates = np.zeros((len(last), slack.shape[1]))
        at = last[taut]
        rates[taut] = (2.0 / radius * bent[at] - used[at, None] * slack[at]) / left[at, None]
        return used[last], rates
