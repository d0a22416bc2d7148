# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ranking of planned grasps by the chance from samples that they hold the object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from isotruss_ros.core.chance.uncertainty import SAMPLES, Uncertainty
from isotruss_ros.core.holding.settle_grasp import settle_grasp
from isotruss_ros.core.planning.grasp_plan import PlannedGrasp

#: Number of samples by which all grasps of a plan are ranked [-]. They take 0.3 to 0.9 s of one
#: core. The three grasps of a plan by default have 200 each, with standard errors below 0.036.
RANKING_SAMPLES = 600
#: Smallest number of samples of each grasp, with standard errors up to 0.07 [-]; of more grasps
#: the ranking remains that to first order.
MIN_SAMPLES = 50


def rank_by_chance(
    grasps: Sequence[PlannedGrasp], friction: float, uncertainty: Uncertainty
) -> tuple[PlannedGrasp, ...]:
    """
    Return grasps ranked by their chances from samples, which replace those to first order.

    All grasps have the same random numbers, so that their chances differ less than by chance.
    """
    count = min(SAMPLES, RANKING_SAMPLES // max(len(grasps), 1))
    if count < MIN_SAMPLES:
        return tuple(grasps)
    ranked = []
    for grasp in grasps:
        settled = settle_grasp(
            grasp.config, grasp.grip.body, friction, members=list(grasp.members)
        )
        chance = uncertainty.chance(settled, count)
        ranked.append(replace(grasp, chance=chance, score=chance.reliability))
    # Grasps with equal chances remain in the order to first order.
    return tuple(sorted(ranked, key=lambda grasp: -grasp.score))
