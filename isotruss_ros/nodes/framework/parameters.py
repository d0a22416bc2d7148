# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Parameters of nodes with type, range and description, checked at start and on each change.

Each parameter is a parameter of rclpy with a descriptor. The package `generate_parameter_library`
is not used, because it cannot be installed from PyPI on machines without ROS.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from isotruss_ros.core import IsotrussError
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterValueException, ParameterException
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter

Value = bool | int | float | str | list[Any]

#: Prefixes of the names of parameters that rclpy declares itself.
RCLPY_PREFIXES = ('use_sim_time', 'start_type_description_service', 'qos_overrides.')
#: Conversions of whole numbers to real numbers, by type.
WHOLE_NUMBERS: dict[Parameter.Type, Callable[[Any], Value]] = {
    Parameter.Type.INTEGER: float,
    Parameter.Type.INTEGER_ARRAY: lambda values: list(map(float, values)),
}
UNCONFIGURED_ONLY = 'read-only unless the node is unconfigured'


class ParameterError(IsotrussError, ValueError):
    """Error: a parameter has an invalid value."""


@dataclass(frozen=True)
class Spec:
    """Declaration of a parameter."""

    name: str  #: name of the parameter
    default: Value  #: default value, which defines the type
    description: str  #: description for `ros2 param describe` and the documentation
    #: smallest and largest value of a number; None: no bounds
    bounds: tuple[float, float] | None = None
    #: whether the value can be set only at start, or while a managed node is unconfigured
    read_only: bool = False


#: Declaration of a read-only parameter.
FixedSpec = partial(Spec, read_only=True)
ROBOT = FixedSpec('robot', 'nine_member', 'Name of a preset, or path of a robot file')
AUTOSTART = FixedSpec(
    'autostart', True, 'Whether the node configures and activates itself at the start'
)


class Parameters:
    """
    Values of the parameters of one node, as attributes.

    :ivar fixed: names of the parameters that a managed node reads only when it is configured.
    """

    def __init__(self, node: Node, specs: Sequence[Spec]) -> None:
        self._node, self._managed = node, isinstance(node, LifecycleNode)
        self.fixed = {spec.name for spec in specs if spec.read_only} | {'use_sim_time'}
        self._real = {spec.name for spec in specs if _is_real(spec.default)}
        present = node.get_parameters_by_prefix('')
        given = {
            name: each for name, each in present.items() if not name.startswith(RCLPY_PREFIXES)
        }
        for name in given:
            node.undeclare_parameter(name)
        for spec in specs:
            self._declare(spec, given.pop(spec.name, None))
        for name in sorted(given):
            node.get_logger().warning(f'parameter {name}: unknown, and not used')
        node.add_pre_set_parameters_callback(self._read_whole_numbers)

    def __getattr__(self, name: str) -> Any:
        return self._node.get_parameter(name).value

    def _declare(self, spec: Spec, given: Parameter | None) -> None:
        """Declare a parameter with its override, or if there is none, with its default."""
        descriptor = ParameterDescriptor(name=spec.name, description=spec.description)
        if spec.read_only and self._managed:
            descriptor.additional_constraints = UNCONFIGURED_ONLY
        else:
            descriptor.read_only = spec.read_only
        if spec.bounds is not None:
            low, high = spec.bounds
            if isinstance(spec.default, float):
                reach = FloatingPointRange(from_value=low, to_value=high)
                descriptor.floating_point_range = [reach]
            else:
                descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=1)]
        default, read = spec.default, None
        if given is not None:
            (read,) = self._read_whole_numbers([given])
            if read is not given:
                default = read.value
        try:
            self._node.declare_parameter(spec.name, default, descriptor, read is not given)
        except InvalidParameterValueException as error:
            raise ParameterError(
                f'parameter {spec.name}: {given.value}: out of range; must be from {low:g} to '
                f'{high:g}'
            ) from error
        except ParameterException as error:
            raise ParameterError(f'parameter {spec.name}: {error}') from error

    def _read_whole_numbers(self, parameters: list[Parameter]) -> list[Parameter]:
        """Return the parameters, with integers converted to floats where floats are declared."""
        return [
            Parameter(p.name, value=WHOLE_NUMBERS[p.type_](p.value))
            if p.name in self._real and p.type_ in WHOLE_NUMBERS
            else p
            for p in parameters
        ]


def _is_real(default: Value) -> bool:
    """Return whether a parameter is a real number, or a list of real numbers."""
    return isinstance(default[0] if isinstance(default, list) else default, float)
