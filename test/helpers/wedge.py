# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Configurations with a given opening angle of the grip."""

from __future__ import annotations

from isotruss_ros.core import Configuration, ConvexObject, Grip, tangent_center
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.manipulation.grip import find_members, members_at
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Points
import numpy as np

MODULE = 'north/Z'
#: Number of steps toward the angle [-], largest step and tolerance [rad].
MAX_STEPS, MAX_STEP, TOLERANCE = 60, 0.05, 1e-10


def opening(config: Configuration, module: str = MODULE) -> float:
    """
    Return the angle between the two members that meet at a module [rad].

    :param config: configuration of the robot.
    :param module: name `t/j` of the module.
    """
    _, (ahead, back) = sides(config, module)
    return float(abs(np.angle(ahead / back)))


def sides(config: Configuration, module: str = MODULE) -> tuple[Points, Points]:
    """
    Return start and vector of the two members that meet at a module, (2,) [m].

    :param config: configuration of the robot.
    :param module: name `t/j` of the module.
    """
    nodes = find_members(config.robot.topology, members_at(config.robot, module))
    # The member ahead starts at the module's B, the one behind ends at its C.
    ahead, behind = config.points[nodes.lines]
    near, far = np.stack([ahead, behind[::-1]], axis=1)
    return near, far - near


def closed_to(
    config: Configuration, degrees: float, diameter: float, module: str = MODULE
) -> Configuration:
    """
    Return the configuration with a given opening angle at a module, by the least roller travel.

    :param config: configuration at which the search starts.
    :param degrees: opening angle [degrees].
    :param diameter: diameter of an object in the wedge, whose centre should move little [m].
    :param module: name `t/j` of the module.
    :raises ConfigurationError: the wedge cannot have this angle.
    """
    for _ in range(MAX_STEPS):
        angle = opening(config, module)
        change = np.radians(degrees) - angle
        if abs(change) < TOLERANCE:
            return config
        body = ConvexObject.disc(tangent_center(config, module, diameter), diameter)
        row = grip_jacobian(config, Grip.at_module(config.robot, module, body))[3]
        # Of the contacts' distance, not of the angle (14): the members turn about B and C.
        near, spans = sides(config, module)
        bisector = np.exp(1j * np.angle((spans / np.abs(spans)).sum()))
        arm = (bisector.conjugate() * (body.center - near.mean())).real
        arm -= body.arm * np.sin(0.5 * angle)
        travel = arm * row * np.clip(change, -MAX_STEP, MAX_STEP) / (row @ row)
        config = config.moved_to(config.roller_positions + travel)
    raise ConfigurationError(f'the wedge at {module} does not close to {degrees:g} degrees')


def pressed_into(
    config: Configuration, module: str, shape: Shape, angle: float, depth: float
) -> ConvexObject:
    """
    Return an object in the wedge at a module, at the same depth in both members.

    :param config: configuration of the robot.
    :param module: name `t/j` of the module.
    :param shape: shape of the object.
    :param angle: orientation of the object [rad].
    :param depth: indentation of each member, for straight tubes [m].
    """
    pinched, along = sides(config, module)
    side = np.sign((along[0].conjugate() * along[1]).imag)
    inward = 1j * side * np.array([1.0, -1.0]) * along / np.abs(along)
    reach = ConvexObject(shape, (0.0, 0.0, angle)).support(-inward)
    reach += 0.5 * config.robot.description.tube_diameter - depth
    rows = np.column_stack([inward.real, inward.imag])
    x, y = np.linalg.solve(rows, (inward.conj() * pinched).real + reach)
    return ConvexObject(shape, (x, y, angle))
