"""What a search came to, in words."""

from __future__ import annotations

from isotruss_ros.core import GraspPlan, Miss, PlannedGrasp

#: By the name of a requirement: what the nearest candidate has, and what it would need.
SENTENCES = {
    'free': 'the robot touches the object already: the gap between them is {value:.4g} m',
    'enclosed': 'no loop of the robot that may grip goes around the object',
    'reach': 'a side stays {value:.4g} m short of the object',
    'opening': 'the sides open by {value:.3g} rad, and were to open by {bound:.3g}',
    'rigidity': 'on the way the shape comes down to {value:.3g} of its rigidity, not {bound:.3g}',
    'self_clearance': 'on the way the clearance of the robot from itself is {value:.4g} m',
    'object_clearance': 'on the way what is not to touch comes within {value:.4g} m of the object',
    'force_closure': 'it takes a friction coefficient of {value:.4g}, there is {bound:.4g}',
    'min_margin': 'the closure margin is {value:.4g} N, and must be {bound:.4g} N',
    'max_contact_force': 'one side presses with {value:.4g} N, and may with {bound:.4g} N',
    'max_total_force': 'the sides press with {value:.4g} N in all, and may with {bound:.4g} N',
    'path': 'there is no way from the touch to the grasp',
}


def miss_in_words(miss: Miss | None) -> str:
    """Return what the nearest candidate misses; without one, that nothing was looked at."""
    if miss is None:
        return 'no candidate was looked at'
    if miss.requirement not in SENTENCES:
        return f'the nearest candidate cannot be computed: {miss.requirement}'
    if miss.requirement == 'force_closure' and miss.value == 0.0:
        return 'force_closure: the sides do not press on the object'
    sentence = SENTENCES[miss.requirement].format(value=miss.value, bound=miss.bound)
    return f'{miss.requirement}: {sentence}'


def grasp_in_words(grasp: PlannedGrasp) -> str:
    """Return where a grasp holds, and how well."""
    return (
        f'at {grasp.grasp.module} between {", ".join(grasp.members)}: closure margin '
        f'{1e3 * grasp.closure_margin:.3g} mN, needs friction {grasp.required_friction:.3g}, '
        f'presses with {grasp.total_force:.3g} N'
    )


def plan_in_words(plan: GraspPlan) -> str:
    """Return what was found, best first, or what is missed."""
    if not plan.grasps:
        miss = miss_in_words(plan.nearest_miss)
        return f'no grasp found in {plan.evaluations} evaluations; {miss}'
    count = len(plan.grasps)
    found = 'one grasp' if count == 1 else f'{count} grasps, the best'
    return f'{found} {grasp_in_words(plan.grasps[0])}'
