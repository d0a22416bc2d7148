# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits and barriers of one's own in the node."""

from dataclasses import replace

from isotruss_ros.core import Status
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.safety.barrier_law import ActiveValues, BarrierLaw
from isotruss_ros.nodes.manipulation.node import Manipulation
from manual_world import Manager, world
import numpy as np
from probe import overrides


class Wall:
    """The object does not move up, wherever it is."""

    status, needs_object, law = Status.SLOWED_BARRIER, True, BarrierLaw(0.0, 1.0)

    def active(self, config, grip):
        """Return no distance, which upward motion shrinks."""
        rows = np.zeros((1, 2 * len(config.points)))
        return ActiveValues(np.array([0]), np.zeros(1), rows, -grip_jacobian(config, grip)[1:2])

    def values(self, config, grip, indices):
        """Return no distance."""
        return np.zeros(len(indices))

    def names(self, indices):
        """Return what the value is."""
        return ['a wall'] * len(indices)


class Careful(Manipulation):
    """The node with a barrier of its own."""

    def prepare(self, settings):
        """Add the barrier."""
        return replace(settings, barriers=(Wall(),))


def slowed(w):
    """Return by what the twist is slowed."""
    status = w.until_code(Status.SLOWED_BARRIER, w.probe.send_all)
    return status.message


def test_a_barrier_of_ones_own_is_kept_in_the_node_whatever_changes():
    with world(lambda: Careful(overrides(failure_time=0.0, slide_along_limits=False))) as w:
        assert 'a wall' in slowed(w)
        w.change(min_clearance=0.03)
        assert w.nodes[1]._servo.settings.bounds.min_clearance == 0.03
        assert 'a wall' in slowed(w)
        Manager(w, 'manipulation').restart()
        assert 'a wall' in slowed(w)
