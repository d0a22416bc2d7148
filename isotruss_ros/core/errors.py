# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exceptions of the package, with one base class."""


class IsotrussError(Exception):
    """Base class of all exceptions that this package raises deliberately."""


class RobotFileError(IsotrussError, ValueError):
    """A robot file is unreadable, or describes no working robot."""


class ConfigurationError(IsotrussError, ValueError):
    """No configuration of the robot fulfils the constraints."""


class GraspError(IsotrussError, ValueError):
    """The grasp, the twist or the list of failed rollers is invalid."""


class ObjectFileError(GraspError):
    """A file or text describes no valid object."""


class SolverError(IsotrussError, RuntimeError):
    """The solver failed on a quadratic program that has a solution."""


class StructureError(IsotrussError, ValueError):
    """A structure is unstable under its loads, or its stiffness laws are contradictory."""


class PathError(IsotrussError, ValueError):
    """A path of the object, or a request to follow it, is invalid."""


class NoMotionError(PathError):
    """All poses of a path are the same."""


def quote(name: str, longest: int = 80) -> str:
    """
    Return a name in quotes for an error message, truncated if long.

    :param name: name of any length, for example from a message.
    :param longest: largest number of characters.
    """
    return repr(name if len(name) <= longest else f'{name[:longest]}…')
