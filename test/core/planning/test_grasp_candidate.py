# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Candidates are sent, squeezed and judged: the answer is that of squeezing here."""

import copy
from dataclasses import replace
import pickle

from isotruss_ros.core import ConvexObject, GraspRequirements
from isotruss_ros.core.planning.grasp_candidate import judge_candidate
from isotruss_ros.core.planning.seeds import find_seeds
from robots import preset

HOME = preset('triangle').home
BODY = ConvexObject.disc((0.716, 0.5), 0.4)
SEED = find_seeds(HOME, BODY, GraspRequirements(module='main/T'), 0, 0)[0]


def judge(**values):
    """Return the grasp and the tally of a candidate that was sent, and sent back."""
    seed = replace(SEED, needs=GraspRequirements(**values))
    sent = pickle.loads(pickle.dumps((HOME, seed)))
    return pickle.loads(pickle.dumps(judge_candidate(*sent)))


def test_candidates_in_another_process_have_equal_results():
    grasp, tally = judge()
    # The seed counts what was looked at: each candidate has its own.
    here, counts = judge_candidate(HOME, replace(copy.deepcopy(SEED), needs=GraspRequirements()))
    assert (grasp.path == here.path).all()
    assert (grasp.config.points == here.config.points).all()
    assert grasp.slip_margin == here.slip_margin > 0.0
    assert (tally.evaluations, tally.analyses) == (counts.evaluations, counts.analyses)
