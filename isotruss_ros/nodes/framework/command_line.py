# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Command line of a node: help, and errors for invalid arguments."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import inspect
import sys
from typing import Any

from isotruss_ros.nodes.framework.parameters import Spec


def refuse_arguments(kind: Any, arguments: Sequence[str]) -> None:
    """
    Print the help of a node if requested, and refuse arguments that ROS does not process.

    :param kind: class of the node.
    :param arguments: arguments of the command line that are not for ROS.
    :raises SystemExit: the help was printed (exit code 0), or an argument is invalid.
    """
    parser = argparse.ArgumentParser(
        prog=f'isotruss {kind.node_name}',
        usage='%(prog)s [-h] [--ros-args -p PARAMETER:=VALUE ...]',
        description=inspect.getdoc(inspect.getmodule(kind)),
        epilog='\n'.join(['parameters:', *map(_describe, (*kind.base_specs, *kind.specs))]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.parse_args(arguments)


def explain_refusal(error: RuntimeError | UnicodeEncodeError) -> str:
    """
    Return a text that explains why ROS refuses its arguments, and what to correct.

    :param error: error raised by `rclpy.init`.
    """
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
