# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Colours that colour-blind readers tell apart."""

import itertools

from isotruss_ros.plotting.robot_drawing import TUBE_COLORS
from isotruss_ros.viewer.meshes import COLORS
import numpy as np
import pytest

#: Linear RGB as those see it who lack a kind of cone (Machado, Oliveira and Fernandes 2009).
SIGHTS = {
    'all cones': np.eye(3),
    'protanopia': np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    'deuteranopia': np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    'tritanopia': np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}
#: Linear sRGB to CIE XYZ over the white D65.
TO_XYZ = np.array([[0.4339, 0.3762, 0.1899], [0.2126, 0.7152, 0.0722], [0.0178, 0.1095, 0.8727]])
#: Distance that is told apart at a glance, in CIELAB units; 2.3 is just noticeable.
APART = 20.0


def to_lab(rgb, sight):
    """Return CIELAB coordinates of a colour of 0 to 1 for a kind of sight."""
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    x, y, z = np.cbrt(TO_XYZ @ np.clip(sight @ linear, 1e-3, 1.0))
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


def smallest_distance(colors, sight):
    """Return the smallest CIELAB distance between two colours."""
    places = [to_lab(np.array(color), SIGHTS[sight]) for color in colors]
    return min(float(np.linalg.norm(a - b)) for a, b in itertools.combinations(places, 2))


@pytest.mark.parametrize('sight', sorted(SIGHTS))
def test_tubes_are_told_apart_by_their_colours(sight):
    colors = [[int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)] for color in TUBE_COLORS]
    assert smallest_distance(colors[:3], sight) > APART
    assert smallest_distance(colors, sight) > 0.5 * APART


@pytest.mark.parametrize('sight', sorted(SIGHTS))
def test_degrees_of_utilisation_are_told_apart_by_their_colours(sight):
    assert smallest_distance(COLORS / 255, sight) > APART
