"""Which rollers have failed: by the topic and the parameter `failed_rollers`, or detected."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from isotruss_ros.core import Grasp, IsotrussError, remaining_task, Robot, Sample, TwistServo
from isotruss_ros.nodes.messages import quoted
from isotruss_ros.nodes.parameters import ParameterError, Value
from isotruss_ros.nodes.qos import subscribe_latched
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

NAME = 'failed_rollers'
SERVICE = 'forgive_failed_rollers'


class FailedRollers:
    """
    Keeps what the topic said last, and what was found, in whatever state the node is.

    :param node: listens and answers, from now until it is destroyed.
    :param servo: gives the servo while there is one.
    :param changed: called when the topic says something else.
    """

    def __init__(
        self, node: Node, servo: Callable[[], TwistServo | None], changed: Callable[[], None]
    ) -> None:
        self._servo, self._changed = servo, changed
        self._named: frozenset[str] = frozenset()
        #: Found to have failed by the servo before, for the next one.
        self._found: frozenset[str] = frozenset()
        subscribe_latched(node, String, NAME, self._take)
        node.create_service(Trigger, SERVICE, self._forgive)

    def named(self, robot: Robot) -> frozenset[str]:
        """Return the rollers that the topic names, of those that the robot has."""
        return self._named & frozenset(robot.roller_names)

    def doubt(self, robot: Robot) -> str | None:
        """Return why it is not known which rollers the topic means."""
        unknown = self._named - frozenset(robot.roller_names)
        if not unknown:
            return None
        return f'the topic {NAME} names {unknown_rollers(unknown, robot)}'

    def keep_found(self) -> None:
        """Keep what was found, before the servo goes."""
        servo = self._servo()
        if servo is not None and servo.detector is not None:
            self._found = servo.detector.failed

    def hold_found(self) -> None:
        """Let a new servo hold what was found before, of the rollers that its robot has."""
        servo = self._servo()
        servo.detector.failed = self._found & frozenset(servo.robot.roller_names)

    def _take(self, message: String) -> None:
        named = frozenset(part.strip() for part in message.data.split(',')) - {''}
        if named != self._named:
            self._named = named
            self._changed()

    def _forgive(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Take the rollers for working again that were found not to be."""
        self.keep_found()
        response.success = True
        response.message = 'no roller was found to have failed'
        if self._found:
            response.message = f'working again: {", ".join(sorted(self._found))}'
            self._found = frozenset()
            servo = self._servo()
            if servo is not None:
                servo.detector.forgive()
        return response


def unknown_rollers(names: Iterable[str], robot: Robot) -> str:
    """Return what is wrong with names of rollers."""
    return (
        f'{quoted(", ".join(sorted(names)))}: robot {robot.name} has no such roller; '
        f'its rollers are {", ".join(robot.roller_names)}'
    )


def check_failed_rollers(robot: Robot, values: dict[str, Value]) -> None:
    """
    Refuse a parameter that names rollers which the robot does not have.

    :raises ParameterError: names the rollers there are.
    """
    unknown = frozenset(values.get(NAME, ())) - {''} - frozenset(robot.roller_names)
    if unknown:
        raise ParameterError(f'parameter {NAME}: {unknown_rollers(unknown, robot)}')


def remaining_motions(servo: TwistServo) -> str:
    """Return in words what can still be done with the object, where that is known."""
    rollers, center = servo.rollers, servo.center
    if not isinstance(rollers, Sample) or not isinstance(center, Sample):
        return 'not known without joint states and object pose'
    try:
        config = servo.robot.configuration(rollers.value.positions)
        grasp = Grasp(servo.grip_module, center.value, servo.object_diameter)
        twists = remaining_task(config, grasp, servo.failed)
    except IsotrussError as error:
        return f'not known: {error}'
    listed = ', '.join(f'({vx:.3g}, {vy:.3g}, {omega:.3g})' for vx, vy, omega in twists)
    return f'{len(twists)} of 3: twists (vx, vy, omega) along {listed or "none"}'
