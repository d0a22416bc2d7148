# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All robots with all objects, on the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import itertools

from distributed import as_completed, Client, Future
from isotruss_ros.cli.sweep.evaluation import evaluate, SweepResult, unanswered
from isotruss_ros.core import ConvexObject, GraspRequirements
from isotruss_ros.core.model.description import RobotDescription


def sweep(
    client: Client,
    robots: Sequence[RobotDescription],
    objects: Sequence[ConvexObject],
    requirements: GraspRequirements | None = None,
    seed: int = 0,
) -> Iterator[SweepResult]:
    """
    Search for grasps of every object by every robot, from its home.

    Each pair is one task, in one thread of one worker: give the workers one thread each. The
    answers do not depend on the cluster, only their order does. What is not computed yet when the
    caller stops listening is cancelled.

    :param client: of the cluster; its workers must have this package.
    :param robots: descriptions: `load_robot(...).description`, or variations of it by
        `dataclasses.replace`.
    :param objects: the objects.
    :param requirements: what a grasp must fulfil; those of `GraspRequirements()` if None.
    :param seed: of every search.
    :return: results as they come; a pair that could not be computed says so in `error`.
    """
    needs = requirements or GraspRequirements()
    pairs = list(itertools.product(range(len(robots)), range(len(objects))))
    # Not pure: two robots that are alike are two results all the same.
    futures = client.map(
        evaluate,
        pairs,
        [robots[i] for i, _ in pairs],
        [objects[j] for _, j in pairs],
        requirements=needs,
        seed=seed,
        pure=False,
    )
    left: dict[Future, tuple[int, int]] = dict(zip(futures, pairs, strict=True))
    del futures  # nothing else keeps what was computed
    try:
        for future in as_completed(left):
            i, j = left.pop(future)
            error = future.exception()
            if error is None:
                yield future.result()
            else:
                reason = f'{type(error).__name__}: {error}'
                yield unanswered((i, j), robots[i], objects[j], reason)
    finally:
        client.cancel(list(left))
