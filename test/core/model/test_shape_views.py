"""Other views of a shape: as round as it is already, and its arcs one by one."""

from isotruss_ros.core import Disc, Ellipse, Polygon
import numpy as np
import pytest


@pytest.mark.parametrize('shape', [Disc(0.3), Ellipse((0.3, 0.1))])
def test_what_has_no_corners_is_not_rounded(shape):
    assert shape.rounded(0.05) is shape


def test_arcs_of_a_rounded_square_are_about_its_inner_corners():
    square = Polygon([(0.0, 0.0), (0.4, 0.0), (0.4, 0.4), (0.0, 0.4)], (0.0, 0.05, 0.05, 0.1))
    assert [radius for _, radius in square.arcs] == pytest.approx([0.0, 0.05, 0.05, 0.1])
    centers = np.array([center for center, _ in square.arcs])
    wanted = np.array([0.0, 0.35 + 0.05j, 0.35 + 0.35j, 0.1 + 0.3j])
    assert centers == pytest.approx(wanted, abs=1e-12)
