# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The exceptions of the package, all of one base class."""


class IsotrussError(Exception):
    """Base of every error that this package raises on purpose."""


class RobotFileError(IsotrussError, ValueError):
    """A robot file cannot be read, or describes no robot that could work."""


class ConfigurationError(IsotrussError, ValueError):
    """No configuration of the robot belongs to what was given."""


class GraspError(IsotrussError, ValueError):
    """The grasp, the twist or the list of failed rollers is not usable."""


class ObjectFileError(GraspError):
    """A file or a text describes no object that could be held."""


class SolverError(IsotrussError, RuntimeError):
    """A quadratic program was not solved, although it has a solution."""


class StructureError(IsotrussError, ValueError):
    """A structure cannot carry what it is asked to, or its stiffness laws are contradictory."""


class PathError(IsotrussError, ValueError):
    """A path of the object, or what is asked of following it, is not usable."""


class NoMotionError(PathError):
    """All poses of a path are the same."""


def quote(name: str, longest: int = 80) -> str:
    """
    Return a name in quotes for an error, cut off where it is long.

    :param name: of any length, such as one from a message.
    :param longest: number of characters that are kept.
    """
    return repr(name if len(name) <= longest else f'{name[:longest]}…')
