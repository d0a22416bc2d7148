# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Paths of robot files, which are presets of the package or files of the user."""

from __future__ import annotations

from pathlib import Path

from isotruss_ros.core.errors import RobotFileError


def config_directory() -> Path:
    """Return the folder of the preset files."""
    return Path(__file__).resolve().parents[2] / 'config'


def preset_names() -> list[str]:
    """Return the names of the presets."""
    return sorted(path.stem for path in config_directory().glob('*.yaml'))


def find_robot_file(name_or_path: str | Path) -> Path:
    """Return the path of a robot file, given as the name of a preset or as a path."""
    text = str(name_or_path)
    if text in preset_names():
        return config_directory() / f'{text}.yaml'
    try:
        path = Path(name_or_path).expanduser()
        if path.is_file():
            return path
    # Name too long, null byte, ~ of an unknown user, or neither a text nor a path.
    except (OSError, ValueError, RuntimeError, TypeError):
        pass
    raise RobotFileError(
        f'robot {text!r}: there is no such preset and no such file; '
        f'give one of {", ".join(preset_names())}, or the path of a robot file'
    )
