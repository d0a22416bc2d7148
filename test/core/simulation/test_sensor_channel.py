# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sensor: what it measures, when that arrives, and what never does."""

from isotruss_ros.core.simulation.sensor_channel import SensorChannel, SensorFaults
import numpy as np
import pytest

#: Cycles of a simulated robot at 100 Hz [s].
TIMES = 0.01 * np.arange(1000)


def arrivals(faults, seed=0, rows=1, times=TIMES):
    """Return (when it arrived, measurement) of a quantity that is the time."""
    channel = SensorChannel(faults, seed)
    return [
        (time, found)
        for time in times
        for found in channel.measure(time, lambda time=time: np.full((rows, 2), time))
    ]


def test_a_perfect_sensor_tells_the_truth_at_once():
    found = arrivals(SensorFaults())
    assert [time for time, _ in found] == TIMES.tolist()
    assert all((one.values == time).all() and one.seen.all() for time, one in found)


def test_noise_has_its_deviation_by_value():
    found = np.array([one.values[0] - one.time for _, one in arrivals(SensorFaults(noise=[1, 5]))])
    assert found.std(axis=0) == pytest.approx([1.0, 5.0], rel=0.1)
    assert abs(found.mean(axis=0) / [1.0, 5.0]).max() < 0.1


def test_rounding_leaves_less_than_half_a_step_and_only_where_there_is_one():
    for _, one in arrivals(SensorFaults(step=[0.03, 0.0])):
        rounded, exact = one.values[0]
        assert exact == one.time
        assert abs(rounded - one.time) <= 0.5 * 0.03 + 1e-12
        assert rounded / 0.03 == pytest.approx(round(rounded / 0.03))


@pytest.mark.parametrize('rate', [7.0, 20.0, 30.0, 99.0])
def test_the_mean_rate_is_kept_where_it_does_not_divide_that_of_the_cycles(rate):
    assert len(arrivals(SensorFaults(rate=rate))) == pytest.approx(10.0 * rate, abs=1)


def test_what_is_delayed_is_stamped_when_it_was_taken():
    found = arrivals(SensorFaults(delay=0.03, rate=20.0))
    assert np.array([time - one.time for time, one in found]) == pytest.approx(0.03)
    assert all((one.values == one.time).all() for _, one in found)


def test_rows_are_lost_on_their_own_by_the_share_of_the_dropouts():
    seen = [one.seen for _, one in arrivals(SensorFaults(dropouts=0.3), rows=5)]
    assert np.mean(seen) == pytest.approx(0.7, abs=0.03)
    assert len({tuple(row.tolist()) for row in seen}) > 10


def test_a_sensor_that_loses_all_says_nothing():
    assert arrivals(SensorFaults(dropouts=1.0), rows=5) == []


def test_the_noise_of_a_seed_is_the_same_with_dropouts_and_another_for_another_seed():
    noisy = {one.time: one.values for _, one in arrivals(SensorFaults(noise=1.0), seed=4)}
    gappy = arrivals(SensorFaults(noise=1.0, dropouts=0.5), seed=4)
    assert 400 < len(gappy) < 600
    assert all((noisy[one.time] == one.values).all() for _, one in gappy)
    assert (arrivals(SensorFaults(noise=1.0), seed=5)[0][1].values != noisy[0.0]).all()


def test_values_are_read_only_where_they_are_measured():
    channel, reads = SensorChannel(SensorFaults(rate=10.0)), []
    for time in TIMES:
        channel.measure(time, lambda: reads.append(0) or [[0.0]])
    assert len(reads) == 100


def test_a_clock_that_runs_back_drops_what_is_under_way_and_goes_on():
    channel = SensorChannel(SensorFaults(rate=20.0, delay=0.05))
    assert channel.measure(5.0, lambda: [[1.0]]) == []
    assert channel.measure(1.0, lambda: [[2.0]]) == []
    (found,) = channel.measure(1.05, lambda: [[3.0]])
    assert (found.time, found.values.tolist()) == (1.0, [[2.0]])
