"""What of a motion is admissible, by a parabola through margins, and which limits are checked."""

from types import SimpleNamespace

from hypothesis import assume, given, strategies
from isotruss_ros.core.safety.barrier_limit import _admissible_share
from isotruss_ros.core.safety.shape_guard import SAFETY_STEP, Watch
import numpy as np
import pytest
import robots


@robots.examples(100)
@given(
    strategies.floats(1e-3, 1.0),
    strategies.floats(-2.0, 2.0),
    strategies.floats(0.1, 2.0),
    strategies.sampled_from([-1.0, 1.0]),
)
def test_the_admissible_share_uses_up_the_room_of_a_parabola(room, slope, size, sign):
    change = slope + sign * size
    (share,) = _admissible_share(*np.array([[room], [slope], [change]]))
    # slope s + (change - slope) s^2 falls to -room first at the share, or after the motion.
    roots = np.roots([change - slope, slope, room])
    assume(abs(slope**2 - 4.0 * (change - slope) * room) > 1e-3)
    ahead = [root.real for root in roots if root.imag == 0.0 < root.real]
    if len(ahead) or sign < 0.0:
        assert share == pytest.approx(min([1.0, *ahead]), rel=1e-6)


@pytest.mark.parametrize(
    ('size', 'margin', 'checked'),
    [
        (0.9 * SAFETY_STEP, 0.049, True),
        (0.9 * SAFETY_STEP, 0.051, False),
        (1.1 * SAFETY_STEP, 0.051, True),
        (1.1 * SAFETY_STEP, 0.2, True),
    ],
)
def test_short_steps_are_checked_where_little_is_left(size, margin, checked):
    law = SimpleNamespace(safety_margin=0.1)
    limit = SimpleNamespace(margins=np.array([0.3, margin]), barrier=SimpleNamespace(law=law))
    watch = Watch(None, None, (), (limit,))
    assert watch._within_reach(size) == ((limit,) if checked else ())
