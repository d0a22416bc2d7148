# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `preflight`, which checks a robot before its first motion and prints a line per check."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from geometry_msgs.msg import PoseStamped
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core import IsotrussError, load_robot
from isotruss_ros.core.inputs import Input, InputError, require_fresh
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.deform import find_sag
from isotruss_ros.nodes.bring_up.joint_markers import JointMarkers, MAX_TOPIC_AGE
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.parameters import ROBOT, Spec
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.framework.topics import LATCHED, RELIABLE
import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

#: Smallest accepted rates of joint_states and object_pose [Hz].
MIN_JOINT_RATE, MIN_POSE_RATE = 50.0, 10.0
#: Largest accepted distance between a joint's measured position and the position computed from the
#: encoders [m].
MAX_JOINT_ERROR = 0.01
SPECS = (
    ROBOT,
    common.OBJECT,
    Spec('listen_time', 3.0, 'Time in which messages are received [s]', (0.5, 60.0)),
    Spec(
        'object_mass',
        0.0,
        'Mass of the object [kg]; 0: the mass in the description of the object',
        (0.0, 100.0),
    ),
)


class Preflight(StoppableNode):
    """
    Node that receives messages for some time and checks them, without motion.

    :ivar faults: names of the failed checks.
    """

    node_name = 'preflight'
    specs = SPECS

    def start(self) -> None:
        """Create the subscriptions, and start to record messages."""
        self._robot = load_robot(self.values.robot)
        self._markers = JointMarkers(self, self._robot)
        self._joint_states: list[JointState] = []
        self._poses: list[PoseStamped] = []
        self._stops: list[Bool] = []
        self._travel: Array | None = None
        self.faults: list[str] = []
        for kind, topic, kept, quality in (
            (JointState, 'joint_states', self._joint_states, RELIABLE),
            (PoseStamped, 'object_pose', self._poses, RELIABLE),
            (Bool, 'emergency_stop', self._stops, LATCHED),
        ):
            self.create_subscription(kind, topic, kept.append, quality)
        self._inputs = self._markers.inputs
        self._inputs.keep('pose')
        self._checks: dict[str, Callable[[], str]] = {
            'encoders': self._check_encoders,
            'roller offsets': self._check_offsets,
            'object pose': self._check_pose,
            'emergency stop': self._check_stop,
            'limits': self._check_limits,
            'rates': self._check_rates,
            'roller signs': self._check_signs,
            'masses': self._check_masses,
        }
        self.create_steady_timer(self.values.listen_time, self._report)

    def _report(self) -> None:
        """Print a line for each check, and end the node with an error if a check failed."""
        for name, check in self._checks.items():
            try:
                print(f'ok    {name}: {check()}', flush=True)
            except IsotrussError as error:
                print(f'FAULT {name}: {error}', flush=True)
                self.faults.append(name)
        if self.faults:
            raise MeasurementError(f'{len(self.faults)} faults: {", ".join(self.faults)}')
        self.done = True

    def _check_encoders(self) -> str:
        age = self._check_live('joint_states', self._inputs.rollers)
        self._travel = self._inputs.rollers.value.positions
        return age

    def _check_offsets(self) -> str:
        sure = self._robot.description.calibration.get('zero_deviations')
        if not sure:
            raise MeasurementError(
                f'{self._robot.description.source}: no home calibration: run calibrate_home'
            )
        words = f'standard deviation up to {1e3 * max(sure.values()):.1f} mm'
        try:
            posture = self._markers.measure(self.now()).posture
        except MeasurementError as error:
            return f'{words}; not compared with markers: {error}'
        config = self._robot.configuration(posture.roller_positions)
        sag = find_sag(config, posture.joints)
        if sag is not None and sag.is_upright:
            raise MeasurementError(str(sag))
        nodes = config.nodes
        names = self._robot.topology.joint_names
        off = {
            name: float(np.hypot(*(nodes[names.index(name)] - place)))
            for name, place in posture.joints.items()
        }
        worst = max(off, key=off.__getitem__)
        distance = f'marker {worst} is {1e3 * off[worst]:.1f} mm from the joint by the encoders'
        if off[worst] > MAX_JOINT_ERROR:
            raise MeasurementError(
                f'{distance}; must be at most {1e3 * MAX_JOINT_ERROR:.0f} mm: run calibrate_home'
            )
        return f'{words}; {distance}'

    def _check_pose(self) -> str:
        self._inputs.settle()
        return self._check_live('object_pose', self._inputs.pose)

    def _check_stop(self) -> str:
        if not self._stops:
            raise MeasurementError('emergency_stop: no message; a button must publish false')
        if self._stops[-1].data:
            raise MeasurementError('the last message of emergency_stop is true; must be false')
        return 'received, and false'

    def _check_limits(self) -> str:
        file = self._robot.description
        low, high = file.min_length, file.max_length
        limits = f'rollers {file.max_speed:g} m/s, members {low:g} to {high:g} m'
        if not self._joint_states:
            raise MeasurementError(
                'joint_states: no message; must be published to check the lengths'
            )
        if self._travel is None:
            return f'{limits}; not compared: joint_states are invalid'
        lengths = self._robot.home.member_lengths + self._robot.topology.incidence @ self._travel
        beyond = np.maximum(low - lengths, lengths - high)
        worst = int(beyond.argmax())
        if beyond[worst] > 0.0:
            raise MeasurementError(
                f'member {self._robot.member_names[worst]} is {lengths[worst]:.3g} m long: must '
                f'be {low:g} to {high:g} m'
            )
        return f'{limits}; all members are within; compare these limits with those of the drives'

    def _check_rates(self) -> str:
        joints = self._check_rate('joint_states', self._joint_states, MIN_JOINT_RATE)
        return f'{joints}, {self._check_rate("object_pose", self._poses, MIN_POSE_RATE)}'

    def _check_signs(self) -> str:
        checked = self._robot.description.calibration.get('checked_rollers', ())
        missing = [name for name in self._robot.roller_names if name not in checked]
        if missing:
            raise MeasurementError(
                f'rollers {", ".join(missing)} were not checked: run check_rollers'
            )
        return f'{len(checked)} rollers checked'

    def _check_masses(self) -> str:
        module = self._robot.description.module.mass
        described = common.read_described(self.values)
        body = self.values.object_mass or (described.mass if described else None)
        if module is None or not body:
            which = 'module.mass of the robot file' if module is None else 'object_mass'
            raise MeasurementError(f'{which} is missing; without it the gains of the loop are low')
        return f'module {module:g} kg, object {body:g} kg'

    def _check_live(self, topic: str, latest: Input) -> str:
        """Return a text with the age of an input; raise an error if it is stale or missing."""
        now = self.now()
        try:
            (fresh,) = require_fresh(now, MAX_TOPIC_AGE, '', **{topic: latest})
        except InputError as error:
            raise MeasurementError(str(error)) from error
        if fresh.rejected is not None:
            raise MeasurementError(fresh.rejected.reason)
        return f'{1e3 * (now - fresh.time):.0f} ms old'

    def _check_rate(
        self, topic: str, messages: Sequence[JointState | PoseStamped], least: float
    ) -> str:
        """Return a text with the rate of a topic; raise an error if it is too low."""
        rate = len(messages) / self.values.listen_time
        if rate < 0.9 * least:
            raise MeasurementError(f'{topic} has {rate:.3g} Hz: must be at least {least:g} Hz')
        return f'{topic} {rate:.3g} Hz'
