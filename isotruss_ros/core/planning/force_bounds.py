"""The bounds on what a grasp does to tubes and object."""

from __future__ import annotations

from isotruss_ros.core.grasping.analysis import GraspAnalysis
from isotruss_ros.core.planning.grasp_plan import Violation
from isotruss_ros.core.planning.requirements import GraspRequirements


def exceeded_bound(needs: GraspRequirements, analysis: GraspAnalysis) -> Violation | None:
    """
    Return the first bound on forces and bending moments that a grasp exceeds; None if none.

    :param needs: what a grasp must fulfil.
    :param analysis: of the grasp.
    """
    values = {
        'max_contact_force': max(analysis.contact_forces.values(), default=0.0),
        'max_total_force': float(analysis.normal_forces.sum()),
        'max_utilisation': max(analysis.utilisation.values()),
    }
    for name, value in values.items():
        bound = getattr(needs, name)
        if value > bound:
            return Violation(name, value, bound, 1.0 - bound / value)
    return None
