# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Check of the kinds of objects that users pass to public functions."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
import functools
import inspect
from typing import Any, ParamSpec, TypeVar

from isotruss_ros.core.errors import ArgumentError

#: Expression that returns an object of a kind, by the name of this class. Arguments with these
#: annotations are checked.
EXAMPLES = {
    'Callable[[Progress], None]': 'print',
    'Callable[[Transition], float]': 'progress_reward',
    'Callable[[], bool]': 'lambda: False',
    'Callable[[float], None]': 'print',
    'Collection[str]': "['north/Z']",
    'Configuration': 'robot.home',
    'ConvexObject': 'ConvexObject.disc((x, y), diameter)',
    'EstimatorSettings': 'EstimatorSettings()',
    'Executor': 'ProcessPoolExecutor()',
    'EstimatedTravel': 'EstimatedTravel(offsets, covariance)',
    'GraspGradient': 'grasp_gradient(settled)',
    'GraspRequirements': 'GraspRequirements(friction=0.7)',
    'Grip': 'Grip.at_module(robot, module, body)',
    'GripRecord': 'GripRecord.of(held)',
    'HeldGrip': 'settle_grasp(config, body).equilibrium',
    'LostContact': 'settle_grasp(config, body).lost',
    'Mapping[str, ArrayLike]': "{'Z': (1.0, 0.0)}",
    'Mechanism': "load_robot('nine_member')",
    'Obstacle': "Obstacle('post', ConvexObject.disc((x, y), diameter))",
    'ObjectPath': 'ObjectPath(poses, speed, turn_rate)',
    'Robot': "load_robot('nine_member')",
    'RollerState': 'RollerState(positions, velocities)',
    'RollerFaults': 'RollerFaults()',
    'RollingGrip': 'RollingGrip.attach(config, grip)',
    'Sequence[Barrier]': '[barrier]',
    'Sequence[Limit]': 'default_limits(robot)',
    'Sequence[Obstacle]': '[obstacle]',
    'ServoSettings': 'ServoSettings(grip, period, timeout)',
    'SettledGrasp': 'settle_grasp(config, body)',
    'Shape': 'Disc(diameter)',
    'ShapeBounds': 'ShapeBounds()',
    'SqueezeSettings': 'SqueezeSettings(force)',
    'StampedInput': 'StampedInput(value, time)',
    'TrackingSettings': 'TrackingSettings()',
    'Uncertainty': 'Uncertainty(friction=0.05)',
}

#: Abstract classes of the package's annotations, which are no base classes of their subclasses.
ABSTRACT_KINDS: dict[str, Any] = {
    **dict.fromkeys((kind for kind in EXAMPLES if kind.startswith('Callable')), Callable),
    'Collection[str]': Collection,
    'Mapping[str, ArrayLike]': Mapping,
    'Sequence[Barrier]': Sequence,
    'Sequence[Limit]': Sequence,
    'Sequence[Obstacle]': Sequence,
}

#: Kind of the elements of a sequence, where they are checked.
ELEMENTS = {'Sequence[Obstacle]': 'Obstacle'}

P = ParamSpec('P')
R = TypeVar('R')


def check_kinds(function: Callable[P, R]) -> Callable[P, R]:
    """Return a decorated function that raises ArgumentError for an argument of a wrong kind."""
    parameters = inspect.signature(function).parameters
    annotations = {name: str(entry.annotation).split(' | ') for name, entry in parameters.items()}
    checked = [
        (place, name, tuple(valid))
        for place, (name, valid) in enumerate(annotations.items())
        if not EXAMPLES.keys().isdisjoint(valid)
    ]

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        for place, name, valid in checked:
            if place < len(args):
                check_kind(name, args[place], *valid)
            elif name in kwargs:
                check_kind(name, kwargs[name], *valid)
        return function(*args, **kwargs)

    return call


def check_kind(name: str, value: Any, *valid: str) -> None:
    """Raise ArgumentError unless an argument is an object of a valid class, or a valid None."""
    if not _kinds_of(value.__class__).isdisjoint(valid):
        if valid[0] in ELEMENTS:
            for number, element in enumerate(value):
                check_kind(f'{name}[{number}]', element, ELEMENTS[valid[0]])
        return
    kind = type(value).__name__
    shown = f'class {value.__name__}' if isinstance(value, type) else f'of type {kind}'
    article, words = 'an' if valid[0][0] in 'AEIOU' else 'a', ' or '.join(valid)
    example = EXAMPLES[valid[0]]
    raise ArgumentError(
        f'argument {name}: {shown}: must be {article} {words}, such as `{example}`'
    )


@functools.cache
def _kinds_of(kind: Any) -> frozenset[str]:
    """Return the names of a class and of its base classes, or the name None."""
    abstract = (name for name, base in ABSTRACT_KINDS.items() if issubclass(kind, base))
    bases = ('None' if base is type(None) else base.__name__ for base in kind.__mro__)
    return frozenset((*abstract, *bases))
