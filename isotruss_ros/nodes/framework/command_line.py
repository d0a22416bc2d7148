# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start of a node: help, and errors for invalid arguments and environments."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
import contextlib
import inspect
import os
import sys
from typing import Any

from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.framework.parameters import Spec
import rclpy
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

#: Variables of the environment, one of which names the folder for the log of ROS.
LOG_FOLDER_VARIABLES = ('ROS_LOG_DIR', 'ROS_HOME', 'HOME')


class StartError(IsotrussError, RuntimeError):
    """Error: ROS cannot be started with these arguments in this environment."""


def refuse_arguments(kind: Any, arguments: Sequence[str] | None) -> None:
    """Print the help of a node if requested, and refuse arguments that ROS does not process."""
    parser = argparse.ArgumentParser(
        prog=f'isotruss {kind.node_name}',
        usage='%(prog)s [-h] [--ros-args -p PARAMETER:=VALUE ...]',
        description=inspect.getdoc(inspect.getmodule(kind)),
        epilog='\n'.join(['parameters:', *map(_describe, (*kind.base_specs, *kind.specs))]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.parse_args(separate_ros_arguments((sys.argv if arguments is None else arguments)[1:]))


def separate_ros_arguments(arguments: Sequence[str]) -> list[str]:
    """Return the arguments after the name of a program that ROS does not process."""
    with _explained_refusals():
        return remove_ros_args(['program', *arguments])[1:]


def start_ros(
    arguments: Sequence[str] | None, handlers: SignalHandlerOptions = SignalHandlerOptions.ALL
) -> None:
    """Initialise rclpy, without messages of rcl, which do not name an invalid argument."""
    if not any(map(os.environ.get, LOG_FOLDER_VARIABLES)):
        raise StartError(
            'HOME is not set, so that ROS has no folder for its log: set HOME, or ROS_LOG_DIR to '
            'a folder that can be written'
        )
    set_logger_level('rcl', LoggingSeverity.FATAL)
    with _explained_refusals():
        rclpy.init(args=arguments, signal_handler_options=handlers)
    set_logger_level('rcl', LoggingSeverity.UNSET)


@contextlib.contextmanager
def _explained_refusals() -> Iterator[None]:
    """Raise StartError instead of an error of rcl, or of the conversion before it."""
    try:
        yield
    except (RuntimeError, UnicodeEncodeError) as error:
        raise StartError(_explain_refusal(error)) from error


def _explain_refusal(error: RuntimeError | UnicodeEncodeError) -> str:
    """Return a text that explains why ROS refuses its arguments, and what to correct."""
    if isinstance(error, UnicodeEncodeError):
        return (
            f'argument {error.object!a}: no text in the encoding of this locale, '
            f'{sys.getfilesystemencoding()}: set LC_ALL=C.UTF-8, or use names in ASCII'
        )
    # The reason is followed by source lines of rcl.
    why = ' '.join(str(error).partition(', at /')[0].split())
    if 'log directory' in why:
        return f'{why}: set ROS_LOG_DIR to a folder that can be written'
    return f'ROS arguments: {why}'


def _describe(spec: Spec) -> str:
    bounds = '' if spec.bounds is None else f', {spec.bounds[0]:g} to {spec.bounds[1]:g}'
    return f'  {spec.name}: {spec.description} (default {spec.default!r}{bounds})'
