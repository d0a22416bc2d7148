# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
MuJoCo model (MJCF) of the robot, with hinged modules and tubes as chains of capsules.

A module is hinged at its joint. At its point B a rigid guide arm BD is hinged. A chain of rigid
capsules with elastic joints (see `springs`) leads from D to the ring E' of the next module and
ends in the guide arm E'C'. An equality constraint connects C' to this module. The bisection of the
angle between two members, equation (3), is a fixed tendon at each module, whose length is linear
in the joint angles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
import xml.etree.ElementTree as ET

from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.description import DEFAULT_MODULE_MASS
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.mujoco_plant.actuation import add_actuation
from isotruss_ros.mujoco_plant.object_geoms import object_geoms, obstacle_geoms
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.scenery import (
    add_look,
    add_scenery,
    BALL_RADIUS,
    COLLISION_GROUP,
    MODULE_COLOR,
    OBJECT_COLOR,
    TUBE_COLOR,
)
from isotruss_ros.mujoco_plant.springs import Springs, springs_of
import numpy as np

#: Assumed masses of a joint, and of a tube segment or guide arm [kg].
JOINT_MASS, PIECE_MASS = 0.1, 0.05
#: Moment of inertia of light bodies [kg m^2], and viscous drag of hinges without a spring [N m s].
INERTIA, HINGE_DRAG = 1e-3, 0.05
#: Ratio of the armature of an elastic joint to its stiffness times the squared time step [-]. The
#: joint then oscillates slowly enough for the integrator, and fast compared with the robot's
#: motion.
ARMATURE_FACTOR = 10.0
#: Damping ratio of contacts [-]; at a ratio of 1, held objects crept by 0.7 mm/s.
CONTACT_DAMPING_RATIO = 2.0
#: MuJoCo's `solimpfriction` for the ground friction of modules, with which modules hardly creep.
FLOOR_SOLIMP = '0.9999 0.9999'
#: Lever arm of friction under a disc with uniform pressure, relative to its radius [-].
DISC_FRICTION_ARM = 2.0 / 3.0


def spring_damping(stiffness: Array, along: Array, options: PlantOptions) -> Array:
    """
    Return the damping (k,) of elastic joints [N s/m or N m s].

    :param stiffness: (k,) stiffness of the joints [N/m or N m].
    :param along: (k,) mask of the slide joints along the tube. Their damping only keeps the
        integration stable, because material losses would resist the rollers.
    :param options: options, which contain the material losses of the tubes and the time step.
    """
    losses = np.where(along, 0.0, options.tube_relaxation)
    return stiffness * (losses + np.sqrt(ARMATURE_FACTOR) * options.time_step)


def export_mjcf(
    robot: Robot,
    objects: Sequence[ConvexObject] = (),
    options: PlantOptions | None = None,
    segments: Indices | None = None,
    actuated: bool = False,
    obstacles: Sequence[Obstacle] = (),
) -> str:
    """
    Return the robot at home as a self-contained MuJoCo model (MJCF text).

    :param robot: the robot.
    :param objects: discs or convex objects at their poses.
    :param options: masses, mesh and contact parameters; None: defaults.
    :param segments: (m,) number of segments of each member; None: `options.segments`.
    :param actuated: whether the model has actuators for the rollers, and sensors. `MujocoPlant`
        needs neither, because it changes the lengths of the tubes itself.
    :param obstacles: obstacles, which tubes and objects touch.
    :raises StructureError: the stiffness model is invalid for the length of a member.
    """
    options = options or PlantOptions()
    counts = np.full(len(robot.member_names), options.segments) if segments is None else segments
    springs = springs_of(robot, robot.home.member_lengths, counts)
    root = ET.Element('mujoco', model=robot.name)
    ET.SubElement(root, 'compiler', angle='radian', autolimits='true')
    _add_options(root, options)
    world = ET.SubElement(root, 'worldbody')
    add_scenery(root, world, robot)
    equality, tendon = ET.Element('equality'), ET.Element('tendon')
    modules = _add_joints(world, robot, options)
    for i in range(robot.topology.n_modules):
        _add_member(modules[i], robot, i, int(counts[i]), springs, options)
        _add_constraints(equality, tendon, robot, i, counts)
    for number, held in enumerate(objects):
        body = _add_object(world, equality, number, held, options)
        add_look(root, body, held, robot.description.tube_diameter)
    for number, obstacle in enumerate(obstacles):
        _add_obstacle(world, number, obstacle)
    root.extend([tendon, equality])
    if actuated:
        add_actuation(root, robot, len(objects), counts)
    ET.indent(root)
    return ET.tostring(root, encoding='unicode') + '\n'


def _add_options(root: ET.Element, options: PlantOptions) -> None:
    step = {'timestep': f'{options.time_step:g}', 'gravity': _text([*options.gravity, 0.0])}
    solver = {'integrator': 'implicitfast', 'solver': 'Newton', 'cone': 'elliptic'}
    accuracy = {'impratio': '100', 'iterations': '50', 'tolerance': '1e-10'}
    ET.SubElement(root, 'option', {**step, **solver, **accuracy})
    default = ET.SubElement(root, 'default')
    # The stiffest equality and contact that the time step allows: the tubes give, not they. An
    # object between two pieces of a coarse mesh chatters where its contact has less damping.
    quick = f'{2.0 * options.time_step:g}'
    stiff = {'solref': f'{quick} {CONTACT_DAMPING_RATIO:g}', 'solimp': '0.99 0.999 0.0001'}
    ET.SubElement(default, 'equality', solref=f'{quick} 1', solimp='0.999 0.9999 0.0001')
    untouched = {'contype': '0', 'conaffinity': '0', 'condim': '3'}
    ET.SubElement(default, 'geom', {**untouched, **stiff}, friction=f'{options.friction:g} 0 0')


def _add_joints(world: ET.Element, robot: Robot, options: PlantOptions) -> list[ET.Element]:
    """Add joints and modules to the model, and return the XML elements of the modules."""
    topology, points = robot.topology, robot.home.points
    held = set(topology.grounded.tolist())
    bodies = []
    rubs: dict[str, Any] = {
        'damping': options.joint_drag,
        'frictionloss': options.module_friction,
        'solimpfriction': FLOOR_SOLIMP,
    }
    for node, name in enumerate(topology.joint_names):
        body = ET.SubElement(world, 'body', name=name, pos=_place(points[node]))
        _inertial(body, JOINT_MASS)
        ET.SubElement(body, 'geom', type='sphere', size=f'{BALL_RADIUS:g}', rgba=MODULE_COLOR)
        for axis, letter in enumerate('xy'):
            if 2 * node + axis not in held:
                _slide(body, f'{name}:{letter}', axis, **rubs)
        bodies.append(body)
    modules = []
    mass = robot.description.module.mass or DEFAULT_MODULE_MASS
    for i, name in enumerate(topology.module_names):
        a, b, c = points[topology.joint[i]], points[topology.b[i]], points[topology.c[i]]
        body = ET.SubElement(bodies[topology.joint[i]], 'body', name=name)
        _inertial(body, mass, 0.5 * (b + c) - a, 0.01)
        _hinge(body, f'{name}:turn', damping=HINGE_DRAG)
        ET.SubElement(body, 'site', name=f'{name}/C', pos=_place(c - a), size='0.01')
        for start, end, size in ((0.0, 0.5 * (b + c) - a, 0.012), (b - a, c - a, 0.02)):
            ends = f'{_place(start)} {_place(end)}'
            ET.SubElement(
                body, 'geom', type='capsule', fromto=ends, size=f'{size:g}', rgba=MODULE_COLOR
            )
        modules.append(body)
    return modules


def _add_member(
    module: ET.Element, robot: Robot, i: int, count: int, springs: Springs, options: PlantOptions
) -> None:
    """Add the chain of capsules of member i, from B of module i to C of the next module."""
    topology, points, file = robot.topology, robot.home.points, robot.description
    a, b = points[topology.joint[i]], points[topology.b[i]]
    angle = float(np.angle(points[topology.c[topology.following[i]]] - b))
    ring, segment = file.module.guide_ring_distance, float(springs.segment[i])
    radius, name = 0.5 * file.tube_diameter, topology.module_names[i]

    def spring(stiffness: float, along: bool = False) -> dict[str, float]:
        return {
            'stiffness': stiffness,
            'armature': ARMATURE_FACTOR * stiffness * options.time_step**2,
            'damping': float(spring_damping(np.array(stiffness), np.array(along), options)),
        }

    body = ET.SubElement(module, 'body', name=f'{name}/B', pos=_place(b - a))
    body.set('euler', _text([0.0, 0.0, angle]))
    _inertial(body, PIECE_MASS)
    _hinge(body, f'{name}:arm', damping=HINGE_DRAG)
    _capsule(body, f'{name}#B', ring, radius)
    for piece in range(count + 1):
        before = ring if piece == 0 else segment * (0.5 if piece == 1 else 1.0)
        body = ET.SubElement(body, 'body', name=f'{name}#{piece}', pos=_text([before, 0.0, 0.0]))
        _inertial(body, PIECE_MASS)
        if piece == 0:
            _hinge(body, f'{name}:ring', **spring(springs.ring[i]))
        else:
            along = springs.end_slide[i] if piece == 1 else springs.middle_slide[i]
            _slide(body, f'{name}:x{piece}', 0, **spring(along, along=True))
            _slide(body, f'{name}:y{piece}', 1, **spring(springs.shear[i]))
            _hinge(body, f'{name}:bend{piece}', **spring(springs.bend[i]))
        whole = 0 < piece < count
        _capsule(body, f'{name}#{piece}', segment * (1.0 if whole else 0.5), radius)
    body = ET.SubElement(body, 'body', name=f'{name}/E', pos=_text([0.5 * segment, 0.0, 0.0]))
    _inertial(body, PIECE_MASS)
    _slide(body, f'{name}:x{count + 1}', 0, **spring(springs.end_slide[i], along=True))
    _hinge(body, f'{name}:end', **spring(springs.ring[i]))
    _capsule(body, f'{name}#E', ring, radius)


def _add_constraints(
    equality: ET.Element, tendon: ET.Element, robot: Robot, i: int, counts: Indices
) -> None:
    """Add the connection of member i to C of the next module, and the bisection at module i."""
    topology, names = robot.topology, robot.topology.module_names
    ring = robot.description.module.guide_ring_distance
    ET.SubElement(
        equality,
        'connect',
        name=f'{names[i]}:connect',
        body1=f'{names[i]}/E',
        body2=names[topology.following[i]],
        anchor=_text([ring, 0.0, 0.0]),
    )
    # Both arms and twice the rod: q_arm(i) + q_turn(before) + chain(before) - q_turn(i) = 0.
    before = names[topology.previous[i]]
    bends = [f'{before}:bend{k + 1}' for k in range(counts[topology.previous[i]])]
    joints = [f'{names[i]}:arm', f'{before}:turn', f'{before}:arm', f'{before}:ring', *bends]
    fixed = ET.SubElement(tendon, 'fixed', name=f'{names[i]}:bisection')
    for joint in (*joints, f'{before}:end'):
        ET.SubElement(fixed, 'joint', joint=joint, coef='1')
    ET.SubElement(fixed, 'joint', joint=f'{names[i]}:turn', coef='-1')
    ET.SubElement(equality, 'tendon', name=f'{names[i]}:bisect', tendon1=f'{names[i]}:bisection')


def _add_object(
    world: ET.Element, equality: ET.Element, number: int, held: ConvexObject, options: PlantOptions
) -> ET.Element:
    """Add an object that can move in the plane or be fixed; return its XML element."""
    name, radius, shape = f'object{number}', held.arm, held.shape
    mass = options.object_mass if held.mass is None else held.mass
    own = held.center_of_mass
    middle = held.turn * (shape.centroid if own is None else complex(*own))
    body = ET.SubElement(world, 'body', name=name, pos=_place(held.center))
    _inertial(body, mass, middle, mass * shape.gyration**2)
    drag, rub = options.object_drag, options.ground_friction
    for axis, letter in enumerate('xy'):
        _slide(body, f'{name}:{letter}', axis, damping=drag, frictionloss=rub)
    turning = {'damping': drag * radius**2, 'frictionloss': rub * DISC_FRICTION_ARM * radius}
    _hinge(body, f'{name}:turn', **turning)
    for letter in ('x', 'y', 'turn'):
        hold = {'name': f'{name}:hold_{letter}', 'joint1': f'{name}:{letter}', 'active': 'false'}
        ET.SubElement(equality, 'joint', hold)
    touched = {'contype': '1', 'conaffinity': '1', 'rgba': OBJECT_COLOR, 'group': COLLISION_GROUP}
    if held.friction is not None:
        # The geom of higher priority determines the friction of a contact.
        touched |= {'friction': f'{held.friction:g} 0 0', 'priority': '1'}
    for part, geom in enumerate(object_geoms(held)):
        ET.SubElement(body, 'geom', {**touched, **geom}, name=f'{name}#{part}')
    return body


def _add_obstacle(world: ET.Element, number: int, obstacle: Obstacle) -> None:
    """Add an obstacle that moves as `MujocoPlant.move_obstacles` commands it."""
    name = f'obstacle{number}'
    body = ET.SubElement(world, 'body', name=name, pos=_place(obstacle.body.center), mocap='true')
    body.set('euler', _text([0.0, 0.0, obstacle.body.pose.angle]))
    touched = {'contype': '1', 'conaffinity': '1', 'rgba': MODULE_COLOR, 'group': COLLISION_GROUP}
    for part, geom in enumerate(obstacle_geoms(obstacle)):
        ET.SubElement(body, 'geom', {**touched, **geom}, name=f'{name}#{part}')


def _capsule(body: ET.Element, name: str, length: float, radius: float) -> None:
    ET.SubElement(
        body,
        'geom',
        name=name,
        type='capsule',
        # Given by `pos` and `size`, which the plant changes with the length of the segment.
        pos=_text([0.5 * length, 0.0, 0.0]),
        euler=_text([0.0, 0.5 * np.pi, 0.0]),
        size=_text([radius, 0.5 * length]),
        conaffinity='1',
        # Nonzero, so that the compiler treats it as a conveyor.
        surfacevel='0 0 1e-9',
        rgba=TUBE_COLOR,
    )


def _inertial(
    body: ET.Element, mass: float, place: complex = 0.0, inertia: float = INERTIA
) -> None:
    ET.SubElement(
        body, 'inertial', pos=_place(place), mass=f'{mass:g}', diaginertia=_text([inertia] * 3)
    )


def _slide(body: ET.Element, name: str, axis: int, **values: float | str) -> None:
    direction = '1 0 0' if axis == 0 else '0 1 0'
    _joint(body, name, 'slide', direction, values)


def _hinge(body: ET.Element, name: str, **values: float) -> None:
    _joint(body, name, 'hinge', '0 0 1', values)


def _joint(body: ET.Element, name: str, kind: str, axis: str, values: dict[str, Any]) -> None:
    numbers = {key: v if isinstance(v, str) else f'{v:.9g}' for key, v in values.items()}
    ET.SubElement(body, 'joint', numbers, name=name, type=kind, axis=axis)


def _place(point: complex) -> str:
    return _text([complex(point).real, complex(point).imag, 0.0])


def _text(values: Sequence[float] | Array) -> str:
    return ' '.join(f'{value:.12g}' for value in values)
