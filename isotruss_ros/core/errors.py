# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exceptions of the package, which have one common base class."""

from __future__ import annotations

from collections.abc import Iterable
import difflib


class IsotrussError(Exception):
    """Base class of all exceptions that this package raises deliberately."""


class ArgumentError(IsotrussError, TypeError):
    """An argument of a public function is of a wrong kind."""


class RobotFileError(IsotrussError, ValueError):
    """A robot file is unreadable, or does not describe a working robot."""


class ConfigurationError(IsotrussError, ValueError):
    """No configuration exists, or roller travel, a trajectory or a bound is invalid."""


class GraspError(IsotrussError, ValueError):
    """A grasp, a twist or a list of failed rollers is invalid."""


class ObjectFileError(GraspError):
    """A file or text does not describe a valid object."""


class SolverError(IsotrussError, RuntimeError):
    """A solver failed although the problem should have a solution."""


class StructureError(IsotrussError, ValueError):
    """A structure is unstable under its loads, or its stiffness laws contradict each other."""


class PathError(IsotrussError, ValueError):
    """A path of the object, or a request to follow a path, is invalid."""


class NoMotionError(PathError):
    """All poses of a path are equal."""


def quote(name: str) -> str:
    """Return a name in quotes for an error message, truncated if long."""
    return repr(name if len(name) <= 80 else f'{name[:80]}…')


def suggest(name: str, allowed: Iterable[str]) -> str:
    """Return a question whether the most similar allowed name was meant, or an empty text."""
    similar = difflib.get_close_matches(name, list(allowed), n=1)
    return f'did you mean {similar[0]}? ' if similar else ''


def format_numbers(values: Iterable[float]) -> str:
    """Return numbers as a text with six digits each, for an error message."""
    return f'[{", ".join(f"{value:.6g}" for value in values)}]'


def distinct_numbers(value: float, bound: float) -> tuple[str, str]:
    """Return two numbers as texts of at least four digits, which differ if the numbers differ."""
    digits = range(4, 18 if value != bound else 5)
    pairs = ((f'{value:.{count}g}', f'{bound:.{count}g}') for count in digits)
    return next((pair for pair in pairs if pair[0] != pair[1]), (f'{value:.4g}', f'{bound:.4g}'))
