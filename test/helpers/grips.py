"""Configurations of the nine-member robot with an object between two of its members."""

from isotruss_ros.core import Cylinder, Grasp, load_robot, tangent_center, task_jacobian
import numpy as np


def opening(config, module='north/Z'):
    """Return the angle between the two members that meet at a module [rad]."""
    topology = config.robot.topology
    i = config.robot.module_names.index(module)
    points = config.points
    ahead = points[topology.c[topology.following[i]]] - points[topology.b[i]]
    back = points[topology.b[topology.previous[i]]] - points[topology.c[i]]
    return abs(np.angle(ahead / back))


def closed_to(config, degrees, diameter, module='north/Z'):
    """Return a configuration whose wedge at a module has a given angle, at least roller travel."""
    for _ in range(60):
        change = np.radians(degrees) - opening(config, module)
        if abs(change) < 1e-10:
            return config
        center = tangent_center(config, module, diameter)
        row = task_jacobian(config, Grasp(module, center, diameter))[3]
        travel = row * np.clip(change, -0.05, 0.05) / (row @ row)
        lower = opening(config.moved_to(config.roller_positions + travel), module)
        if abs(lower - np.radians(degrees)) > abs(change):
            travel = -travel  # which way the row counts depends on the side of the corner
        config = config.moved_to(config.roller_positions + travel)
    raise AssertionError('the wedge did not close')


def gripped(degrees=35.0, diameter=0.3, squeeze=0.02, module='north/Z', robot='nine_member'):
    """Return a configuration and an object pressed into the wedge at a module."""
    config = closed_to(load_robot(robot).home, degrees, diameter, module)
    center = tangent_center(config, module, diameter, squeeze)
    return config, Cylinder(center, diameter)


def backed_off(config, cylinder, distance, module='north/Z', steps=10):
    """
    Return configurations in which the wedge is farther and farther back from an object.

    Its angle stays as it is, and it moves along its bisector.
    """
    where = complex(*cylinder.center)
    near = complex(*tangent_center(config, module, cylinder.diameter, 0.01))
    deep = complex(*tangent_center(config, module, cylinder.diameter, 0.02))
    back = distance / steps * (deep - near) / abs(deep - near)
    configs = [config]
    for _ in range(steps):
        grasp = Grasp(module, (where.real, where.imag), cylinder.diameter)
        rows = task_jacobian(configs[-1], grasp)
        travel = np.linalg.pinv(rows) @ [back.real, back.imag, 0.0, 0.0]
        configs.append(configs[-1].moved_to(configs[-1].roller_positions + travel))
        where += back
    return configs
