# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated sensor: what it measures, when that arrives, and what never does."""

from isotruss_ros.nodes.simulator.simulated_sensors import SensorChannel
import numpy as np
import pytest

#: Cycles of a simulated robot at 100 Hz [s].
TIMES = 0.01 * np.arange(1000)


def arrivals(seed=0, rows=1, **faults):
    """Return (time of arrival, time, values) of a quantity that is the time."""
    channel = SensorChannel((seed,))
    return [
        (now, *found)
        for now in TIMES
        for found in channel.measure(now, lambda now=now: np.full((rows, 2), now), **faults)
    ]


@pytest.mark.parametrize('rate', [7.0, 20.0, 30.0, 99.0])
def test_the_mean_rate_is_kept_where_it_does_not_divide_that_of_the_cycles(rate):
    assert len(arrivals(rate=rate)) == pytest.approx(10.0 * rate, abs=1)


def test_rows_are_lost_on_their_own_by_the_share_of_the_dropouts():
    seen = np.isfinite([values[:, 0] for *_, values in arrivals(rows=5, dropouts=0.3)])
    assert np.mean(seen) == pytest.approx(0.7, abs=0.03)
    assert len({tuple(row.tolist()) for row in seen}) > 10
    assert arrivals(rows=5, dropouts=1.0) == []


def test_the_noise_of_a_seed_is_the_same_with_dropouts_and_another_for_another_seed():
    noisy = {time: values for _, time, values in arrivals(4, noise=1.0)}
    gappy = arrivals(4, noise=1.0, dropouts=0.5)
    assert 400 < len(gappy) < 600
    assert all((noisy[time] == values).all() for _, time, values in gappy)
    assert (arrivals(5, noise=1.0)[0][2] != noisy[0.0]).all()


def test_a_clock_that_runs_back_drops_pending_measurements():
    channel = SensorChannel((0,))
    assert channel.measure(5.0, lambda: [[1.0]], 20.0, 0.05) == []
    assert channel.measure(1.0, lambda: [[2.0]], 20.0, 0.05) == []
    ((time, values),) = channel.measure(1.05, lambda: [[3.0]], 20.0, 0.05)
    assert (time, values.tolist()) == (1.0, [[2.0]])
