# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Changes of frozen records."""

import dataclasses
from functools import cached_property

from isotruss_ros.core.numerics.frozen import replace
import pytest


@dataclasses.dataclass(frozen=True)
class Side:
    """Length of a square [m]."""

    length: float
    name: str = 'square'

    @cached_property
    def area(self):
        """Return the area [m^2]."""
        return self.length**2


def test_a_changed_record_has_its_own_cached_properties():
    side = Side(2.0, name='tile')
    assert side.area == 4.0
    changed = replace(side, length=3.0)
    assert changed == dataclasses.replace(side, length=3.0)
    assert (changed.area, side.area) == (9.0, 4.0)


def test_an_unknown_field_is_refused():
    with pytest.raises(TypeError, match='Side has no field width'):
        replace(Side(2.0), width=1.0)
