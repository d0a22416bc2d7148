# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Parameters of nodes with type, range and description, checked at start and on each change.

Each parameter is a parameter of rclpy with a descriptor. The package `generate_parameter_library`
is not used, because it cannot be installed from PyPI on machines without ROS.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from isotruss_ros.core import IsotrussError
from isotruss_ros.core.errors import suggest
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
NO_TYPE = Parameter.Type.NOT_SET
#: Default of a list of names without a name, because ROS gives an empty list no type.
NO_NAMES = ['']
#: Types of values in words, with an article.
TYPES_IN_WORDS = {
    Parameter.Type.BOOL: 'true or false',
    Parameter.Type.INTEGER: 'a whole number',
    Parameter.Type.DOUBLE: 'a number',
    Parameter.Type.STRING: 'a text, in quotes',
    Parameter.Type.STRING_ARRAY: 'a list of names',
    Parameter.Type.DOUBLE_ARRAY: 'a list of numbers',
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
    :param overrides: parameters of the command line, of parameter files and of the constructor.
    """

    def __init__(
        self, node: Node, specs: Sequence[Spec], overrides: Mapping[str, Parameter]
    ) -> None:
        self._node, self._managed = node, isinstance(node, LifecycleNode)
        self.fixed = {spec.name for spec in specs if spec.read_only} | {'use_sim_time'}
        self._real = {spec.name for spec in specs if _is_real(spec.default)}
        self._names = {spec.name for spec in specs if spec.default == NO_NAMES}
        for spec in specs:
            self._declare(spec, overrides.get(spec.name))
        known = [spec.name for spec in specs]
        for name in sorted(set(overrides).difference(known)):
            if not name.startswith(RCLPY_PREFIXES):
                words = f'parameter {name}: unknown, and not used; {suggest(name, known)}'
                node.get_logger().warning(words.rstrip('; '))
        node.add_pre_set_parameters_callback(self._convert)

    def __getattr__(self, name: str) -> Any:
        return self._node.get_parameter(name).value

    def _declare(self, spec: Spec, override: Parameter | None) -> None:
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
        value = spec.default
        if override is not None:
            read = self._convert_one(override)
            value = read.value
            expected = Parameter.Type.from_parameter_value(spec.default)
            if read.type_ is not expected:
                words = TYPES_IN_WORDS[expected]
                was = 'an empty list' if value is None else repr(value)
                raise ParameterError(f'parameter {spec.name}: {was}: must be {words}')
        try:
            self._node.declare_parameter(spec.name, value, descriptor, True)
        except InvalidParameterValueException as error:
            raise ParameterError(
                f'parameter {spec.name}: {value}: out of range; must be from {low:g} to {high:g}'
            ) from error
        except ParameterException as error:
            raise ParameterError(f'parameter {spec.name}: {error}') from error

    def _convert(self, parameters: list[Parameter]) -> list[Parameter]:
        """Return the parameters with integers as floats, and empty lists as `NO_NAMES`."""
        # A request without a type would delete the parameter; rclpy refuses it.
        return [p if p.type_ is NO_TYPE else self._convert_one(p) for p in parameters]

    def _convert_one(self, parameter: Parameter) -> Parameter:
        name, kind, value = parameter.name, parameter.type_, parameter.value
        if name in self._real and kind in WHOLE_NUMBERS:
            return Parameter(name, value=WHOLE_NUMBERS[kind](value))
        # An empty list has no type in a parameter file, and any type in a message.
        is_list = kind is NO_TYPE or kind.name.endswith('ARRAY')
        if name in self._names and is_list and not value:
            return Parameter(name, value=NO_NAMES)
        return parameter


def _is_real(default: Value) -> bool:
    """Return whether a parameter is a real number, or a list of real numbers."""
    return isinstance(default[0] if isinstance(default, list) else default, float)
