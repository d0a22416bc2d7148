# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulation of a robot with driven rollers and of an object in MuJoCo."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import math
from typing import NamedTuple

from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.convex_object import ConvexObject, EXTERNAL_WRENCH
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.arrays import Array, finite_array, Indices, MAX_LOAD
from isotruss_ros.mujoco_plant.mjcf import ARMATURE_FACTOR, export_mjcf, spring_damping
from isotruss_ros.mujoco_plant.options import load_mujoco, PlantError, PlantOptions
from isotruss_ros.mujoco_plant.springs import springs_of
import numpy as np
from numpy.typing import ArrayLike

#: Indices of the rows for end slides, middle slides and ring hinges in the table of stiffnesses.
END_ROW, MIDDLE_ROW, RING_ROW = 0, 1, 4
TRANSVERSE_ROWS = (('y', 2), ('bend', 3))
#: Number of time steps after which stiffness and geometry are adapted to the member lengths [-].
UPDATE_INTERVAL = 10


class ContactForce(NamedTuple):
    """Force of a member on an object."""

    normal: float  #: normal force of the member [N]
    friction: float  #: friction force on the object, counter-clockwise positive [N]
    point: complex  #: centre of pressure, x + iy in the robot frame [m]


class MujocoPlant:
    """
    Robot that is simulated in MuJoCo, with or without an object.

    The rollers follow the commanded speeds with a lag, and exert at most a largest force.

    :ivar travel: (r,) travel of the tube through each roller since home [m].
    :ivar text: text (MJCF) of MuJoCo's model of the robot at home.
    :ivar model: MuJoCo's model (`MjModel`).
    :ivar data: MuJoCo's state (`MjData`).
    :ivar obstacle_contacts: number of time steps in which robot or object touched an obstacle, by
        the obstacle's name.
    :param robot: the robot, initially at home.
    :param body: the object at its initial pose, free from the start; None: no object.
    :param options: masses, mesh and contact parameters; None: defaults.
    :param segments: (m,) number of segments of each member; None: `options.segments`.
    :param obstacles: obstacles, which tubes and object touch; see `move_obstacles`.
    :raises PlantError: MuJoCo is not installed.
    :raises StructureError: the stiffness model is invalid for the length of a member.
    """

    def __init__(
        self,
        robot: Robot,
        body: ConvexObject | None = None,
        options: PlantOptions | None = None,
        segments: Indices | None = None,
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        self._mj = load_mujoco()
        self.robot, self.options = robot, options or PlantOptions()
        self._body = body
        every = np.full(len(robot.member_names), self.options.segments)
        self._counts = every if segments is None else segments
        objects = () if body is None else (body,)
        self._obstacles = tuple(obstacles)
        self.obstacle_contacts: Counter[str] = Counter()
        counts, there = self._counts, self._obstacles
        self.text = export_mjcf(robot, objects, self.options, counts, obstacles=there)
        self.model = self._mj.MjModel.from_xml_string(self.text)
        self.data = self._mj.MjData(self.model)
        self.travel = np.zeros(len(robot.roller_names))
        self._speeds = np.zeros_like(self.travel)
        self._home = robot.home.member_lengths
        self._due = 0.0
        self._find_addresses()
        self._refresh()
        self._mj.mj_forward(self.model, self.data)

    @property
    def time(self) -> float:
        """Return the simulated time since the start [s]."""
        return float(self.data.time)

    @property
    def speeds(self) -> Array:
        """Return the speed of the tube through each roller in the last step, (r,) [m/s]."""
        return self._speeds

    @property
    def nodes(self) -> Array:
        """Return the node positions (n, 2), robot frame, ordered as `Robot.node_names` [m]."""
        topology = self.robot.topology
        nodes = np.empty((len(topology.node_names), 2))
        nodes[: len(topology.joint_names)] = self.data.xpos[self._joint_bodies, :2]
        nodes[topology.b] = self.data.xpos[self._b_bodies, :2]
        nodes[topology.c] = self.data.site_xpos[self._c_sites, :2]
        return nodes

    def object_pose(self) -> Pose:
        """Return the pose of the object, with an angle that is not wrapped to one turn."""
        return Pose(*(self.data.qpos[self._object_qpos] + self._body.pose).tolist())

    def hold_object(self, pose: ArrayLike) -> None:
        """
        Fix the object at a pose until it is released.

        :param pose: pose (x, y, angle) in the robot frame [m, rad].
        :raises PlantError: the pose is not three finite numbers.
        """
        place = finite_array(pose, 3, 'the pose (x, y, angle) of the object', PlantError)
        place -= self._body.pose
        self.data.qpos[self._object_qpos] = place
        self.data.qvel[self._object_dofs] = 0.0
        self.model.eq_data[self._object_holds, 0] = place
        self.data.eq_active[self._object_holds] = 1
        self._mj.mj_forward(self.model, self.data)

    def release_object(self) -> None:
        """Release the object that `hold_object` has fixed."""
        self.data.eq_active[self._object_holds] = 0

    def pull(self, wrench: ArrayLike) -> None:
        """
        Apply an external wrench to the object from now on.

        :param wrench: wrench (fx, fy, m) about the object's centre, robot frame [N, N m].
        :raises PlantError: the wrench is not three finite numbers within range.
        """
        pulling = finite_array(wrench, 3, EXTERNAL_WRENCH, PlantError, MAX_LOAD)
        self.data.qfrc_applied[self._object_dofs] = pulling

    def load_joint(self, joint: str, force: ArrayLike) -> None:
        """
        Apply an external force to a joint of the robot from now on.

        :param joint: name of the joint.
        :param force: force (fx, fy) in the robot frame [N].
        :raises PlantError: the force is not two finite numbers within range.
        """
        body, what = self._find_body(joint), f'the load (fx, fy) [N] on joint {joint}'
        self.data.xfrc_applied[body, :2] = finite_array(force, 2, what, PlantError, MAX_LOAD)

    def set_friction(self, friction: float) -> None:
        """
        Change the coefficient of friction between tubes and objects.

        :param friction: coefficient of friction, not negative [-].
        """
        self.model.geom_friction[:, 0] = friction

    def advance(self, duration: float, speeds: ArrayLike) -> None:
        """
        Simulate a duration in whole time steps; the rest is added to the next call.

        :param duration: simulated time, not negative [s].
        :param speeds: (r,) speeds of the tube through each roller [m/s].
        :raises PlantError: the simulation became unstable.
        :raises ConfigurationError: `speeds` does not have one finite number for each roller.
        :raises StructureError: the length of a member would not be positive.
        """
        commanded = self.robot.check_rollers(speeds, 'roller velocities [m/s]')
        self._due += duration
        steps = int(self._due / self.options.time_step + 1e-6)
        self._due -= steps * self.options.time_step
        for _ in range(steps):
            before, self._speeds = self._speeds, self._driven_speeds(commanded)
            if (before != self._speeds).any():
                self._move_surface()
            if self._speeds.any():
                self.travel = self.travel + self.options.time_step * self._speeds
                self._set_rest_lengths()
                if self._since_refresh >= UPDATE_INTERVAL:
                    self._refresh()
            self._since_refresh += 1
            self._mj.mj_step(self.model, self.data)
            if self._obstacles:
                self._count_contacts()
        if (
            not np.isfinite(self.data.qpos).all()
            or np.asarray(self.data.warning.number)[self._bad].any()
        ):
            raise PlantError(
                f'MuJoCo plant: the simulation became unstable at {self.data.time:.3f} s; '
                'use a smaller time step'
            )

    def move_obstacles(self, obstacles: Sequence[Obstacle]) -> None:
        """
        Move obstacles to other poses.

        :param obstacles: obstacles of the plant, in their order.
        :raises PlantError: these are not the obstacles of the plant.
        """
        if [obstacle.name for obstacle in obstacles] != [o.name for o in self._obstacles]:
            known = ', '.join(obstacle.name for obstacle in self._obstacles)
            raise PlantError(f'obstacles: must be those of the plant, {known}')
        for number, obstacle in enumerate(obstacles):
            half = 0.5 * obstacle.body.pose.angle
            self.data.mocap_pos[number, :2] = obstacle.body.pose[:2]
            self.data.mocap_quat[number] = math.cos(half), 0.0, 0.0, math.sin(half)

    def _count_contacts(self) -> None:
        """Count the obstacles that are touched in this time step."""
        touched = self._obstacle_of_geom[self.data.contact.geom.ravel()]
        for number in np.unique(touched[touched >= 0]).tolist():
            self.obstacle_contacts[self._obstacles[number].name] += 1

    def settle(self, duration: float = 2.0) -> None:
        """
        Simulate with fixed rollers for a time in which the robot comes to rest.

        :param duration: simulated time [s].
        """
        self.advance(duration, np.zeros_like(self.travel))

    def save(self) -> Array:
        """Return MuJoCo's state for `restore`, which is possible until a roller moves."""
        kind = self._mj.mjtState.mjSTATE_INTEGRATION
        state = np.empty(self._mj.mj_stateSize(self.model, kind))
        self._mj.mj_getState(self.model, self.data, state, kind)
        return state

    def restore(self, state: Array) -> None:
        """
        Restore a saved state, including external wrenches.

        :param state: result of `save`; the rollers must not have moved since the call of `save`.
        """
        kind = self._mj.mjtState.mjSTATE_INTEGRATION
        self._mj.mj_setState(self.model, self.data, state, kind)
        self._mj.mj_forward(self.model, self.data)

    def contact_forces(self) -> dict[str, ContactForce]:
        """Return the force on the object for the name of each member in contact."""
        mine = self._object_geoms
        found: dict[str, list[tuple[complex, complex, complex]]] = {}
        wrench = np.zeros(6)
        for index, contact in enumerate(self.data.contact):
            pair = contact.geom.tolist()
            second = pair[1] in mine
            member = self._member_of_geom[pair[0] if second else pair[1]]
            if member < 0 or not (second or pair[0] in mine):
                continue
            self._mj.mj_contactForce(self.model, self.data, index, wrench)
            # The rows of the frame are its axes; the first is the normal, out of the first geom.
            sign = 1.0 if second else -1.0
            axes = sign * contact.frame.reshape(3, 3)[:, :2] @ np.array([1.0, 1.0j])
            part = axes @ wrench[:3], axes[0] * wrench[0], complex(*contact.pos[:2])
            found.setdefault(self.robot.member_names[member], []).append(part)
        return {name: _resultant(parts) for name, parts in found.items()}

    def _find_addresses(self) -> None:
        """Find the indices of the members' joints, bodies and geoms in MuJoCo's arrays."""
        model, topology = self.model, self.robot.topology
        names, warning = topology.module_names, self._mj.mjtWarning
        bad = warning.mjWARN_BADQPOS, warning.mjWARN_BADQVEL, warning.mjWARN_BADQACC
        self._bad = [int(number) for number in bad]
        self._joint_bodies = [self._find_body(name) for name in topology.joint_names]
        self._b_bodies = [self._find_body(f'{name}/B') for name in names]
        self._c_sites = [model.site(f'{name}/C').id for name in names]
        # Rows (joint, member, row of the table of stiffnesses), (geom, member, length, position).
        springs, pieces = [], []
        for i, (name, count) in enumerate(zip(names, self._counts.tolist(), strict=True)):
            along = [END_ROW, *[MIDDLE_ROW] * (count - 1), END_ROW]
            kinds = [(f'x{k}', place) for k, place in enumerate(along, 1)]
            kinds += [
                (f'{kind}{k}', place)
                for k in range(1, count + 1)
                for kind, place in TRANSVERSE_ROWS
            ]
            kinds += [('ring', RING_ROW), ('end', RING_ROW)]
            springs += [(model.joint(f'{name}:{joint}').id, i, place) for joint, place in kinds]
            # The origin of a segment moves by its share of the member's change of length.
            whole = [*[1.0] * (count - 1), 0.5]
            parts = [('B', 0.0, 0.0), ('0', 0.5, 0.0), ('E', 0.0, 1.0)]
            parts += [(str(k), size, (k - 0.5) / count) for k, size in enumerate(whole, 1)]
            pieces += [(model.geom(f'{name}#{part}').id, i, *shares) for part, *shares in parts]
        self._spring_joint, self._spring_member, self._spring_kind = np.array(springs).T
        self._spring_dof = model.jnt_dofadr[self._spring_joint]
        along = self._spring_kind <= MIDDLE_ROW
        self._slide_qpos = model.jnt_qposadr[self._spring_joint[along]]
        self._slide_member = self._spring_member[along]
        self._slide_rest = np.where(self._spring_kind[along] == END_ROW, 0.5, 1.0)
        self._first_joint = np.array([model.joint(f'{name}:x1').id for name in names])
        self._first_slide = model.jnt_qposadr[self._first_joint]
        geoms, members, self._piece_whole, self._piece_share = np.array(pieces).T
        self._piece_geom, self._piece_member = geoms.astype(int), members.astype(int)
        self._member_of_geom = np.full(model.ngeom, -1)
        self._member_of_geom[self._piece_geom] = self._piece_member
        self._obstacle_of_geom = np.full(model.ngeom, -1)
        for number in range(len(self._obstacles)):
            body = self._find_body(f'obstacle{number}')
            self._obstacle_of_geom[model.geom_bodyid == body] = number
        if self._body is None:
            return
        # The three joints of the object and their equalities are consecutive.
        body, first = self._find_body('object0'), model.joint('object0:x')
        hold = model.equality('object0:hold_x').id
        self._object_geoms = set(np.flatnonzero(model.geom_bodyid == body).tolist())
        self._object_qpos = slice(first.qposadr[0], first.qposadr[0] + 3)
        self._object_dofs = slice(first.dofadr[0], first.dofadr[0] + 3)
        self._object_holds = slice(hold, hold + 3)

    def _find_body(self, name: str) -> int:
        return int(self.model.body(name).id)

    def _driven_speeds(self, commanded: Array) -> Array:
        """Return the speeds (r,) of the rollers after lag and force limit [m/s]."""
        options, speeds = self.options, commanded
        if options.roller_lag > 0.0:
            passed = -math.expm1(-options.time_step / options.roller_lag)
            speeds = self._speeds + passed * (commanded - self._speeds)
        if options.roller_force < math.inf:
            give = self.data.qpos[self._first_slide] - self.model.qpos_spring[self._first_slide]
            tension = self.model.jnt_stiffness[self._first_joint] * give
            # Force of the members' tension on the tube at a roller, in the sense of travel.
            pulled = self.robot.topology.incidence.T @ tension
            speeds = np.where(-np.sign(speeds) * pulled > options.roller_force, 0.0, speeds)
        return speeds

    def _set_rest_lengths(self) -> None:
        change = (self.robot.topology.incidence @ self.travel) / self._counts
        self.model.qpos_spring[self._slide_qpos] = self._slide_rest * change[self._slide_member]

    def _move_surface(self) -> None:
        """Set the surface speed of each segment to the speed of the tube's material along it."""
        topology = self.robot.topology
        through = np.zeros(topology.n_modules)
        through[topology.driven] = self._speeds
        stretch = through - through[topology.following]
        member = self._piece_member
        # The capsule's axis is its z.
        self.model.geom_surfacevel[self._piece_geom, 2] = (
            through[member] - self._piece_share * stretch[member]
        )

    def _refresh(self) -> None:
        """Adapt stiffness, damping and geometry to the current member lengths."""
        self._since_refresh = 0
        lengths = self._home + self.robot.topology.incidence @ self.travel
        springs = springs_of(self.robot, lengths, self._counts)
        table = np.stack(
            [springs.end_slide, springs.middle_slide, springs.shear, springs.bend, springs.ring]
        )
        stiffness = table[self._spring_kind, self._spring_member]
        self.model.jnt_stiffness[self._spring_joint] = stiffness
        armature = ARMATURE_FACTOR * stiffness * self.options.time_step**2
        self.model.dof_armature[self._spring_dof] = armature
        along = self._spring_kind <= MIDDLE_ROW
        damping = spring_damping(stiffness, along, self.options)
        self.model.dof_damping[self._spring_dof] = damping
        tube = self._piece_whole > 0.0
        half = 0.5 * self._piece_whole * springs.segment[self._piece_member]
        geoms = self._piece_geom[tube]
        self.model.geom_size[geoms, 1] = half[tube]
        self.model.geom_pos[geoms, 0] = half[tube]
        self.model.geom_rbound[geoms] = half[tube] + self.model.geom_size[geoms, 0]


def _resultant(parts: Sequence[tuple[complex, complex, complex]]) -> ContactForce:
    """Return the resultant of contact forces and its centre of pressure."""
    forces, pressing, points = np.array(parts).T
    sizes, inward = np.abs(pressing), complex(pressing.sum())
    if not sizes.any():
        return ContactForce(0.0, 0.0, complex(points[0]))
    along = (inward / abs(inward)).conjugate() * complex(forces.sum())
    return ContactForce(along.real, -along.imag, complex(sizes @ points / sizes.sum()))
