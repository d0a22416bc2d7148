# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulated time that no node falls behind, however busy the machine is."""

from __future__ import annotations

from collections.abc import Iterable
import math
import time

from geometry_msgs.msg import TwistStamped
from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.framework.cycle import create_steady_timer
from probe import Probe

#: Step of the clock, at most in real time [s].
STEP = 0.01
#: Largest ages of the last message of each source, two periods of its node [s].
LARGEST_AGES = {'joints': 0.04, 'status': 0.04, 'twist': 0.04, 'state': 0.1}
#: Wall time after which a source without messages is not awaited until its next one [s].
PATIENCE = 2.0


class PacedClock:
    """
    Publishes `/clock`: a step after all nodes that publish have published for the last ones.

    :param probe: probe by simulated time, which hears the nodes.
    :param nodes: names of the nodes; the first step is when all of them hear the clock.
    """

    def __init__(self, probe: Probe, nodes: Iterable[str]) -> None:
        self._probe, self._time, self._stepped = probe, 0.0, time.monotonic()
        self._deaf = set(nodes)
        self._silent = dict.fromkeys(LARGEST_AGES, 0)
        probe.listen(TwistStamped, 'twist', 'cmd_vel')
        create_steady_timer(probe, 0.2 * STEP, self._advance)

    def _advance(self) -> None:
        if self._deaf:
            infos = self._probe.get_subscriptions_info_by_topic('/clock')
            self._deaf -= {info.node_name for info in infos}
            return
        waited = time.monotonic() - self._stepped
        late = [key for key in LARGEST_AGES if self._is_late(key)]
        if waited < STEP or (late and waited < PATIENCE):
            return
        for key in late:
            self._silent[key] = len(self._probe.seen[key])
        self._time, self._stepped = self._time + STEP, time.monotonic()
        self._probe.tick(self._time)

    def _is_late(self, key: str) -> bool:
        """Return whether the last message of a source, if it publishes, is too old."""
        count = len(self._probe.seen[key])
        if count == self._silent[key]:
            return False
        stamp = read_stamp(self._probe.last(key).header)
        return math.isfinite(stamp) and self._time - stamp > LARGEST_AGES[key]
