"""Objects that are pressed into members of the nine-member robot at home, and held there."""

from apart_grips import APART, NINE
from isotruss_ros.core import place_between, Polygon
from isotruss_ros.core.grasping.held_grip import HeldGrip
import numpy as np

HOME = NINE.home
BOX = Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], corner_radius=0.02)
#: A triangle's own sides.
LOOP = ('south/P-Q', 'south/Q-X', 'south/X-P')


def numbers(members):
    """Return the numbers of members."""
    return np.array([NINE.member_names.index(name) for name in members])


def held(shape, angle, members=APART, depth=0.01, **options):
    """Return how an object is held that is pressed into members."""
    grip = place_between(HOME, members, shape, angle=angle, indentation=depth)
    found = HeldGrip.attach(HOME, grip.body, numbers(members), **options)
    assert isinstance(found, HeldGrip)
    return found
