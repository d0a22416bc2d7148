# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Check of settings by their plausible ranges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.model.pose import check_range


def check_settings(
    settings: Any, ranges: Mapping[str, tuple[str, float, float]], error: type[IsotrussError]
) -> None:
    """
    Raise an error for the first setting that is no finite number within its range.

    None is valid if it is the default, and infinity if it is the end of the range.

    :param settings: dataclass of the settings.
    :param ranges: unit, smallest and largest plausible value of each setting.
    """
    defaults = {field.name: field.default for field in fields(settings)}
    for name, (unit, low, high) in ranges.items():
        value = getattr(settings, name)
        is_infinite = isinstance(value, float) and value == high
        if not (is_infinite or (value is None and defaults[name] is None)):
            check_range(value, name, unit, low, high, error)
