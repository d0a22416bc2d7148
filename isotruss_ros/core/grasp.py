"""
A cylinder held between the two sides that meet at one module: equations (14) to (19).

The grasp frame has its origin at B and its x axis along the side B -> B'; the object is at rest
in it. Points of the plane are complex numbers here, as in `constraints`.
"""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.arrays import circle, finite_array
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.robot import Robot
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Grasp:
    """
    Where the robot holds an object.

    :ivar module: the module `t/j` whose two sides hold the object.
    :ivar center: the object's centre (x, y) in the robot frame [m].
    :ivar diameter: the object's own diameter d [m].
    :raises GraspError: the centre is not two finite numbers, the diameter is not positive, or
        either is of no sensible size.
    """

    module: str
    center: tuple[float, float]
    diameter: float

    def __post_init__(self) -> None:
        """Check the numbers; the module is checked against a robot when the grasp is used."""
        center, diameter = circle(self.center, self.diameter)
        object.__setattr__(self, 'center', center)
        object.__setattr__(self, 'diameter', diameter)


@dataclass(frozen=True)
class GripSides:
    """
    The two sides that meet at a grip module, in one configuration.

    :ivar index: the number of the module.
    :ivar nodes: nodes B, B', C, C'.
    :ivar ahead: B' - B [m].
    :ivar back: C' - C [m].
    :ivar side: +1 where the space between the sides is on the left of B -> B', -1 on the right.
    """

    index: int
    nodes: tuple[int, int, int, int]
    ahead: complex
    back: complex
    side: float


@dataclass(frozen=True)
class GraspRows:
    """
    The rows of M(x) in (19) and what the rollers add to them by rolling (17).

    :ivar nodes: (4, 2n) rows vx, vy [m/s], omega [rad/s], opening rate of the grip [rad/s].
    :ivar rolling: (4,) what the speed of the grip module's roller adds to each row [1/m].
    """

    nodes: Array
    rolling: Array


def module_index(robot: Robot, name: str) -> int:
    """
    Return the number of a module.

    :raises GraspError: the robot has no such module.
    """
    try:
        return robot.module_names.index(name)
    except ValueError:
        raise GraspError(
            f'module {name!r}: robot {robot.name} has no such module; '
            f'its modules are {", ".join(robot.module_names)}'
        ) from None


def sides_at(config: Configuration, module: str) -> GripSides:
    """
    Find the two sides that meet at a module.

    :raises GraspError: no such module.
    """
    layout, points = config.robot.layout, config.points
    i = module_index(config.robot, module)
    b, c = int(layout.b[i]), int(layout.c[i])
    b_next, c_prev = int(layout.c[layout.following[i]]), int(layout.b[layout.previous[i]])
    ahead, back = complex(points[b_next] - points[b]), complex(points[c_prev] - points[c])
    side = 1.0 if (ahead.conjugate() * back).imag > 0.0 else -1.0
    return GripSides(i, (b, b_next, c, c_prev), ahead, back, side)


def grip_sides(config: Configuration, grasp: Grasp) -> GripSides:
    """
    Find the two sides that hold the object.

    :raises GraspError: no such module, or the object is not between the two sides.
    """
    sides = sides_at(config, grasp.module)
    b, _, c, _ = sides.nodes
    center = complex(*grasp.center)
    left_of_ahead = (sides.ahead.conjugate() * (center - complex(config.points[b]))).imag
    left_of_back = (sides.back.conjugate() * (center - complex(config.points[c]))).imag
    if not (left_of_ahead * sides.side > 0.0 and left_of_back * sides.side < 0.0):
        raise GraspError(
            f'the object at ({center.real:.4g}, {center.imag:.4g}) m is not between the two '
            f'sides that meet at module {grasp.module}; name the module that holds it, '
            'or give the centre in the robot frame'
        )
    return sides


def grasp_rows(config: Configuration, grasp: Grasp) -> GraspRows:
    """
    Return M(x): the object's velocity (15), its rate of turn (18) and the grip's opening (14).

    :raises GraspError: no such module, or the object is not between the two sides.
    """
    sides = grip_sides(config, grasp)
    b, b_next, c, c_prev = sides.nodes
    arm = complex(*grasp.center) - complex(config.points[b])
    turn_ahead = 1j / sides.ahead.conjugate()  # gradient of the direction angle of B -> B'
    turn_back = 1j / sides.back.conjugate()
    rows = np.zeros((4, len(config.points)), dtype=np.complex128)
    # xdot = xdot_B + omega_frame z x arm: the object is at rest in the grasp frame.
    turning = np.array([-arm.imag, arm.real, 1.0, -1.0])
    rows[:, b_next] = turning * turn_ahead
    rows[:, b] = -rows[:, b_next]
    rows[0, b] += 1.0
    rows[1, b] += 1.0j
    rows[3, c_prev] = turn_back
    rows[3, c] = -turn_back
    rolling = np.array([0.0, 0.0, 2.0 * sides.side / grasp.diameter, 0.0])
    return GraspRows(rows.view(np.float64), rolling)


def snug_center(
    config: Configuration, module: str, diameter: float, squeeze: float = 0.0
) -> tuple[float, float]:
    """
    Return the centre at which an object just touches the tubes of both sides at a module.

    :param diameter: the object's own diameter [m].
    :param squeeze: how much nearer to the corner of the two sides than that [m].
    :return: (x, y) in the robot frame [m].
    :raises GraspError: no such module, diameter not positive, squeeze not finite, or the object
        would have to be behind the module or beyond the end of a side.
    """
    (depth,) = finite_array([squeeze], 1, 'squeeze [m]', GraspError)
    sides = sides_at(config, module)
    ahead, back, side = sides.ahead, sides.back, sides.side
    b, c = config.points[sides.nodes[0]], config.points[sides.nodes[2]]
    own_radius = 0.5 * Grasp(module, (0.0, 0.0), diameter).diameter
    reach = own_radius + 0.5 * config.robot.description.tube_diameter
    normals = np.array([1j * side * ahead / abs(ahead), -1j * side * back / abs(back)])
    # Distance from both lines is `reach`: Re(conj(normal) (center - foot)) = reach.
    right = (normals.conj() * np.array([b, c])).real + reach
    x, y = np.linalg.solve(normals.view(np.float64).reshape(2, 2), right)
    center = complex(x, y) - depth * complex(normals.sum() / abs(normals.sum()))
    along = np.array(
        [
            (ahead.conjugate() * (center - b)).real / abs(ahead) ** 2,
            (back.conjugate() * (center - c)).real / abs(back) ** 2,
        ]
    )
    if along.min() < 0.0 or along.max() > 1.0:
        raise GraspError(
            f'an object of diameter {diameter} m does not fit between the sides at module '
            f'{module}: it would touch them at {along.round(3).tolist()} of their lengths; '
            'take another diameter, module or configuration'
        )
    return center.real, center.imag
