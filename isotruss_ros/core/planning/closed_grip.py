"""A grip that holds the object, and the path on which it closed."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.grasping.analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.objects import Cylinder
from isotruss_ros.core.planning.force_bounds import GraspLoads


@dataclass(frozen=True, eq=False)
class ClosedGrip:
    """
    A grip that holds the object.

    :ivar path: configurations from where all grasping members touch the object to the grasp.
    :ivar body: the object where it lay, or where it went as the grip closed.
    :ivar analysis: of the grasp, the object held fast.
    :ivar loads: of the grasp.
    :ivar squeeze: mean normal force of the grasping members [N].
    :ivar slip_margin: smallest wrench, moment over d/2, at which a contact slips or lets go, the
        object free [N]; zero where it is not held then, or by more than two members.
    """

    path: tuple[Configuration, ...]
    body: Cylinder | ConvexObject
    analysis: GraspAnalysis
    loads: GraspLoads
    squeeze: float
    slip_margin: float
