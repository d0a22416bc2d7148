"""Whether and how a robot holds an object that is free to move: `settle_grasp`."""

from __future__ import annotations

from dataclasses import dataclass, field

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.grasping.held_members import Hold, member_depths
from isotruss_ros.core.grasping.rolling_grasp import RollingGrasp
from isotruss_ros.core.grasping.slip_margin import slip_margin, wrench_response, WrenchResponse
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import as_convex_object, ConvexObject
from isotruss_ros.core.model.objects import Cylinder, Pose
from isotruss_ros.core.model.shapes import Disc
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.statics.pressures import Pressure
import numpy as np
from numpy.typing import ArrayLike

#: An object that was measured farther than this from its equilibrium, as a share of the tube's
#: diameter, is not in the grip.
MAX_DISPLACEMENT = 0.25


@dataclass(frozen=True, eq=False)
class SettledGrasp:
    """
    The equilibrium of a free object between two members, with friction loading the tubes.

    Where no equilibrium was found the pose is the given one, and there are no forces.

    :ivar hold: whether it is held, and if not, why.
    :ivar reason: the same for a message; empty when it is held.
    :ivar pose: (x, y, angle) in equilibrium, robot frame [m, rad].
    :ivar displacement: (3,) from the given pose [m, rad].
    :ivar normal_forces: by grasping member, positive where it presses [N].
    :ivar friction_forces: on the object, counter-clockwise, by grasping member [N].
    :ivar friction_used: |T| / (mu N) by grasping member [-]; infinite without friction.
    :ivar required_friction: smallest coefficient that holds it; infinite if none does.
    :ivar slip_margin: smallest extra wrench, moment over d/2, at which a member slips or lets go
        [N]; negative where one does already, zero without an equilibrium.
    :ivar stiffness: (3, 3) wrench (fx, fy, m) that a displacement (dx, dy, dtheta) of the object
        takes while the contacts stick [N/m, N, N m]; zero without an equilibrium.
    """

    hold: Hold
    reason: str
    pose: Pose
    displacement: Array
    normal_forces: dict[str, float] = field(default_factory=dict)
    friction_forces: dict[str, float] = field(default_factory=dict)
    friction_used: dict[str, float] = field(default_factory=dict)
    required_friction: float = float('inf')
    slip_margin: float = 0.0
    stiffness: Array = field(default_factory=lambda: np.zeros((3, 3)))

    @property
    def held(self) -> bool:
        """Return whether the object is held."""
        return self.hold is Hold.HELD


def settle_grasp(
    config: Configuration,
    body: Cylinder | ConvexObject,
    friction: float = 0.5,
    external_wrench: ArrayLike = (0.0, 0.0, 0.0),
    pressure: Pressure | None = None,
) -> SettledGrasp:
    """
    Find the equilibrium of a grasped object near its measured pose.

    The object is free, friction loads the tubes, and nothing is known of how it came there.
    Statics settles the place across the bisector of the two grasping members, and the friction
    forces; the place along the bisector, by which they press, is the measured one.

    :param config: where the robot is; its rollers do not turn.
    :param body: the object, where it was measured; of one that is no disc nothing is computed, and
        `SettledGrasp.hold` says so.
    :param friction: coefficient between tube and object, not negative.
    :param external_wrench: (fx, fy, m) on the object about its centre [N, N m].
    :param pressure: gauge, measured [Pa], see `tube_pressures`; that of the robot file if None.
    :raises GraspError: an argument is not usable.
    :raises StructureError: a pressure is not usable, the robot is a mechanism, or its stiffness
        laws are contradictory.
    """
    (mu,) = finite_array([friction], 1, 'friction', GraspError)
    if mu < 0.0:
        raise GraspError(f'friction {friction!r}: must not be negative')
    wrench = finite_array(external_wrench, 3, 'the external wrench (fx, fy, m)', GraspError)
    held = as_convex_object(body)
    if not isinstance(held.shape, Disc):
        return SettledGrasp(Hold.NOT_COMPUTED, Hold.NOT_COMPUTED.value, held.pose, np.zeros(3))
    cylinder = Cylinder(held.pose[:2], held.shape.diameter)
    if np.count_nonzero(member_depths(config, cylinder) > 0.0) > 2:
        return _not_settled(cylinder, Hold.OTHER_CONTACT)
    found = RollingGrasp.attach(config, cylinder, external_wrench=wrench, pressure=pressure)
    if isinstance(found, Hold):
        return _not_settled(cylinder, found)
    return _assess(cylinder, found, float(mu))


def _not_settled(cylinder: Cylinder, hold: Hold) -> SettledGrasp:
    return SettledGrasp(hold, hold.value, Pose(*cylinder.center, 0.0), np.zeros(3))


def _assess(cylinder: Cylinder, found: RollingGrasp, friction: float) -> SettledGrasp:
    """Return what an equilibrium is worth."""
    sticks = found.hold(friction)
    if sticks in (Hold.NO_CONTACT, Hold.OFF_MEMBER):
        return _not_settled(cylinder, sticks)
    state, pose = found.state, found.pose
    response = wrench_response(found.statics, state, found.wrench)
    hold, reason = _judge(cylinder, found, friction, response)
    with np.errstate(divide='ignore', invalid='ignore'):
        used = np.abs(state.friction_forces) / (friction * state.normal_forces)
    return SettledGrasp(
        hold,
        reason,
        pose,
        np.array([pose.x - cylinder.center[0], pose.y - cylinder.center[1], 0.0]),
        dict(zip(found.member_names, state.normal_forces.tolist(), strict=True)),
        dict(zip(found.member_names, (-state.friction_forces).tolist(), strict=True)),
        dict(zip(found.member_names, used.tolist(), strict=True)),
        found.required_friction,
        0.0 if response is None else slip_margin(state, response, friction),
        np.zeros((3, 3)) if response is None else response.stiffness,
    )


def _judge(
    cylinder: Cylinder, found: RollingGrasp, friction: float, response: WrenchResponse | None
) -> tuple[Hold, str]:
    """Return whether an equilibrium holds the object, and why not."""
    robot, pose = found.config.robot, found.pose
    shift = float(np.hypot(pose.x - cylinder.center[0], pose.y - cylinder.center[1]))
    if shift > MAX_DISPLACEMENT * robot.description.tube_diameter:
        return Hold.FAR, f'{Hold.FAR.value}: {1e3 * shift:.3g} mm'
    depths = member_depths(found.config, Cylinder(pose[:2], cylinder.diameter))
    depths[found.members] = -np.inf
    third = int(depths.argmax())
    if depths[third] > 0.0:
        return Hold.OTHER_CONTACT, f'{Hold.OTHER_CONTACT.value}: {robot.member_names[third]}'
    if found.required_friction > friction:
        need = f'coefficient {found.required_friction:.3g} against {friction:.3g}'
        return Hold.SLIPS, f'{Hold.SLIPS.value}: {need}'
    if response is None or not response.stable:
        return Hold.UNSTABLE, Hold.UNSTABLE.value
    return Hold.HELD, ''
