"""
How hard the robot squeezes: the model of the held object in the loop of the twist program.

The squeeze and the opening angle of the grip are one thing: each degree less presses by some
newtons more. The fourth row of (19), which keeps the angle, gets a right-hand side, and what the
elastic tubes do to the object's pose is predicted by the model and corrected in the same cycle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math

from isotruss_ros.core.grasping.equilibrium import FEET, INCLINATIONS
from isotruss_ros.core.grasping.held_members import Hold
from isotruss_ros.core.grasping.rolling_grasp import RollingGrasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.solve_twist import RollerCommand
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.objects import Cylinder, Pose
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Below this share of the twist the limits decide where the object goes, not the model.
MIN_SCALE = 0.05

#: Solves the program for a twist (3,) and a rate of the opening angle [rad/s].
Solve = Callable[[Array, float], RollerCommand]


@dataclass(frozen=True)
class SqueezeSettings:
    """
    What the squeeze is to be, and how quickly it gets there.

    :ivar force: mean normal force of the grasping members, positive [N].
    :ivar friction: coefficient between tube and object.
    :ivar gain: share of the missing force that is made up for in a second [1/s].
    :ivar max_force_rate: the squeeze changes no quicker than this [N/s].
    :ivar pose_gain: share of the pose error that is corrected in a second [1/s].
    :ivar min_slip_margin: below this margin a message warns [N].
    """

    force: float
    friction: float
    gain: float = 5.0
    max_force_rate: float = 10.0
    pose_gain: float = 2.0
    min_slip_margin: float = 0.0


class SqueezeControl:
    """
    Regulates squeeze and pose of an object that the robot holds.

    :ivar grasp: the model of how it is held in the configuration of the last cycle; None before
        the first one.
    :ivar reference: where the object's centre is to be, x + iy [m]: where it was at first, moved
        by the twists carried out since; None before the first one.
    :param settings: what the squeeze is to be.
    """

    def __init__(self, settings: SqueezeSettings) -> None:
        self.settings = settings
        self.grasp: RollingGrasp | None = None
        self.reference: complex | None = None
        self._velocity = 0j

    def reset(self) -> None:
        """Forget how and where the object is held: both follow from the next measured pose."""
        self.grasp = self.reference = None

    def correct(self, twist: Array, center: tuple[float, float], elapsed: float) -> Array:
        """
        Move the reference on, and return the twist with which the object comes back to it.

        :param twist: (3,) commanded [m/s, rad/s].
        :param center: where the object is, (x, y) [m].
        :param elapsed: since the cycle before, for which its command held [s].
        """
        here = complex(*center)
        if self.reference is None:
            self.reference = here
        else:
            self.reference += elapsed * self._velocity
        back = self.settings.pose_gain * (self.reference - here)
        return twist + np.array([back.real, back.imag, 0.0])

    def advance(self, twist: Array, command: RollerCommand) -> None:
        """
        Take note of what is carried out of a twist, which moves the reference from now on.

        :param twist: (3,) commanded [m/s, rad/s].
        :param command: the command of this cycle; in a direction other than the twist's it ends
            the reference.
        """
        if command.status in (Status.UNREACHABLE, Status.SLIDING):
            self.reference = None
        self._velocity = command.scale * complex(twist[0], twist[1])

    def warning(self) -> str:
        """Return what is wrong with how the object is held; empty where nothing is."""
        if self.grasp is None:
            return ''
        margin = self.grasp.slip_margin(self.settings.friction)
        least = self.settings.min_slip_margin
        if margin >= least:
            return ''
        return f'the slip margin of {margin:.3g} N is below {least:.3g} N'

    def follow(self, config: Configuration, measured: Pose, diameter: float) -> Hold:
        """
        Take the model to where the robot is.

        Contacts that stick roll with the tubes, so that the measured pose counts only when the
        model starts, or where it has lost the object.

        :param config: where the robot is.
        :param measured: pose of the object.
        :param diameter: of the object [m].
        :return: whether the object is held in the model; if not, why.
        :raises StructureError: see `structure_of`.
        """
        found = None if self.grasp is None else self.grasp.moved_to(config)
        if found is None or found.hold(self.settings.friction) is not Hold.HELD:
            cylinder = Cylinder(measured[:2], diameter)
            start = RollingGrasp.attach(config, cylinder, measured.angle)
            if isinstance(start, Hold):
                self.grasp = None
                return start
            found = start
        self.grasp = found
        return found.hold(self.settings.friction)

    def solve(self, twist: Array, period: float, solve: Solve) -> RollerCommand:
        """
        Return the command that moves the object as asked and brings the squeeze to its target.

        :param twist: (3,) vx, vy [m/s], omega [rad/s] of the object in the robot frame.
        :param period: for which the command holds, positive [s].
        :param solve: the twist program.
        :raises ConfigurationError: the robot cannot get to where the command leads.
        """
        if self.grasp is None:
            raise ValueError('follow comes before solve')
        grasp, settings = self.grasp, self.settings
        missing = settings.gain * (settings.force - grasp.squeeze)
        wanted = float(np.clip(missing, -settings.max_force_rate, settings.max_force_rate))
        slope = squeeze_by_opening(grasp)
        command = solve(twist, wanted / slope)
        if command.scale < MIN_SCALE or not command.roller_velocities.any():
            return command
        way = period * command.roller_velocities
        ahead = grasp.moved_to(grasp.config.moved_to(grasp.config.roller_positions + way))
        if ahead is None:
            return command
        share = period * command.scale
        moved = np.subtract(ahead.pose, grasp.pose)
        moved[2] = math.remainder(moved[2], 2.0 * math.pi)
        # Of the program's own twist, where the wanted one is out of reach.
        reached = command.achieved_twist / command.scale
        gained = (ahead.squeeze - grasp.squeeze) / share
        return solve(twist + reached - moved / share, (2.0 * wanted - gained) / slope)


def squeeze_by_opening(grasp: RollingGrasp) -> float:
    """
    Return by how much the squeeze changes as the angle between the members opens [N/rad].

    One member turns away from the object about its end at the grip, the object moves so that both
    press alike: the depth lost is shared by both, and by the dents in the skin.

    :param grasp: how the object is held.
    :return: negative.
    """
    statics, unknowns = grasp.statics, grasp.state.unknowns
    feet = unknowns[FEET]
    local = 1j * statics.sides * np.exp(1j * unknowns[INCLINATIONS])
    normals = np.column_stack([local.real, local.imag, np.zeros(2)]).ravel()
    compliance = normals @ statics.compliance.at(feet).matrix.reshape(6, 6) @ normals
    _, dents = statics.indentation(grasp.state.normal_forces)
    # The members meet at the module where one of them starts and the other one ends.
    following = grasp.config.robot.topology.following
    starts = grasp.members == following[grasp.members[::-1]]
    arms = np.where(starts, feet, statics.compliance.length - feet)
    return -float(arms.mean() / (compliance + dents.sum()))
