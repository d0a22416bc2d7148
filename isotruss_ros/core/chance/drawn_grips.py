# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exact equilibria of grasps with changed parameters."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.held_gradient import GraspParameters
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Smallest factor on stiffness, pressures and size in a draw [-].
MIN_FACTOR = 0.05


def changed_grip(grip: HeldGrip, change: Array) -> HeldGrip:
    """
    Return the equilibrium with unknown contact history for changed parameters.

    :param change: (p,) changes of the parameters, see `criteria`.
    :raises NotHeldError: there is no equilibrium.
    """
    columns, body = GraspParameters.of(grip.config), grip.statics.body
    travel = grip.config.roller_positions + change[columns.rollers]
    body = scaled(body, max(1.0 + change[-1], MIN_FACTOR))
    body = body.moved_to(np.array(body.pose) + change[columns.place])
    given = np.array(grip.statics.bent.structure.pressures)
    pressures = np.maximum(given + change[columns.pressures], MIN_FACTOR * given).tolist()
    names = grip.config.robot.description.pressures
    tubes = TubeModel(
        max(grip.tubes.stiffness_scale + change[columns.stiffness], MIN_FACTOR),
        pressure=dict(zip(names, pressures, strict=True)),
    )
    wrench = grip.wrench * (1.0, 1.0, grip.arm) + change[columns.wrench]
    return attach_grip(grip.config.moved_to(travel), body, grip.members, wrench, tubes)


def scaled(body: ConvexObject, factor: float) -> ConvexObject:
    """Return an object of another size; its centroid does not move, its fields are lengths."""
    shape: Any = body.shape
    lengths = {field.name: np.array(getattr(shape, field.name)) for field in fields(shape)}
    scaled_fields = {name: (factor * length).tolist() for name, length in lengths.items()}
    moved = body.turn * shape.centroid * (1.0 - factor)
    x, y, angle = body.pose
    pose = x + moved.real, y + moved.imag, angle
    return replace(body, shape=replace(shape, **scaled_fields)).moved_to(pose)
