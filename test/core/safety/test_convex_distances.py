"""Distances of straight segments from convex objects, against a search along each of them."""

from isotruss_ros.core import ConvexObject, Cylinder, Polygon
from isotruss_ros.core.model.convex_object import as_convex_object
from isotruss_ros.core.safety.convex_distances import nearest_to_object
from isotruss_ros.core.safety.distances import nearest_on_segment
import numpy as np
import pytest
from scipy.optimize import minimize_scalar
import shapes


def points(generator, count):
    """Return random points around the origin [m]."""
    return generator.normal(size=count) + 1j * generator.normal(size=count)


@pytest.mark.parametrize('seed', range(20))
def test_is_the_least_distance_along_the_segment(seed):
    generator = np.random.default_rng(seed)
    place = generator.uniform(-0.3, 0.3, 3)
    body = ConvexObject(shapes.random_shape(generator, 0.4), place)
    starts, ends = points(generator, 12), points(generator, 12)
    ends[0] = starts[0]
    found = nearest_to_object(body, starts, ends)
    for start, end, gap, share in zip(starts, ends, found.gaps, found.shares, strict=True):

        def at(s, start=start, end=end):
            return float(body.nearest(np.array([start + s * (end - start)])).gaps[0])

        # A convex function of the share.
        options = {'xatol': 1e-10}
        searched = minimize_scalar(at, bounds=(0.0, 1.0), method='bounded', options=options)
        assert gap == pytest.approx(min(searched.fun, at(0.0), at(1.0)), abs=1e-7)
        assert at(share) == pytest.approx(gap, abs=1e-12)
    assert np.abs(found.normals) == pytest.approx(np.ones(12))


def test_of_a_cylinder_they_are_those_of_its_centre():
    generator = np.random.default_rng(7)
    starts, ends = points(generator, 40), points(generator, 40)
    found = nearest_to_object(as_convex_object(Cylinder((0.1, 0.2), 0.3)), starts, ends)
    center = nearest_on_segment(0.1 + 0.2j, starts, ends)
    assert found.gaps == pytest.approx(center.distance - 0.15, abs=1e-9)
    assert np.abs(found.normals + center.normal).max() < 1e-4


def test_a_face_along_a_segment_is_as_near_everywhere():
    box = ConvexObject(Polygon([(-0.2, -0.1), (0.2, -0.1), (0.2, 0.1), (-0.2, 0.1)]))
    found = nearest_to_object(box, np.array([-0.5 + 0.13j]), np.array([0.5 + 0.13j]))
    assert found.gaps == pytest.approx([0.03], abs=1e-12)
    assert found.normals == pytest.approx([1j])
    assert 0.3 - 1e-6 <= found.shares[0] <= 0.7 + 1e-6
