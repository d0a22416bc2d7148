# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data sets of random grasps, which are computed in parts, so that a run can be resumed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, FIRST_COMPLETED, Future, wait
import contextlib
from dataclasses import asdict, dataclass, field
import fcntl
import hashlib
import itertools
import json
import os
from pathlib import Path
import shutil
from typing import Any

from isotruss_ros.core import ConvexObject, Robot
from isotruss_ros.core.holding.settle_grasp import GROUP_SIZE
from isotruss_ros.core.numerics.arrays import check_count
from isotruss_ros.core.recording.recorded_servo import find_versions
from isotruss_ros.dataset.columns import check_columns, COLUMNS, compute_columns, corner_count
from isotruss_ros.dataset.random_grasps import DatasetError, draw_grasp, GraspDistribution
from isotruss_ros.dataset.table_files import (
    check_path,
    Form,
    join_parts,
    read_settings,
    write_part,
    write_text,
)
import numpy as np
from numpy.typing import NDArray

#: Default number of grasps in a part [-], those that `settle_grasps` computes together.
PART_SIZE = GROUP_SIZE
#: Largest number of grasps of a data set [-].
MAX_GRASPS = 10**9
#: Largest number of parts that an executor has at once [-]: enough for all processes.
MAX_SUBMITTED = 512


@dataclass(frozen=True)
class DatasetRun:
    """
    Arguments that determine the rows of a data set.

    :ivar robot: the robot.
    :ivar count: number of grasps, 1 to `MAX_GRASPS`.
    :ivar distribution: distribution of the grasps.
    :ivar seed: random seed, not negative.
    :ivar columns: names of `COLUMNS`; none: all columns.
    :ivar part_size: number of grasps in a part, 1 or more. It bounds the memory, and what an
        interrupted run loses.
    :raises DatasetError: a number or the name of a column is invalid.
    """

    robot: Robot
    count: int
    distribution: GraspDistribution = field(default_factory=GraspDistribution)
    seed: int = 0
    columns: tuple[str, ...] = ()
    part_size: int = PART_SIZE

    def __post_init__(self) -> None:
        """Check the fields."""
        check_count(self.seed, 'seed', DatasetError)
        for name in ('count', 'part_size'):
            value = check_count(getattr(self, name), name, DatasetError)
            if not 1 <= value <= MAX_GRASPS:
                raise DatasetError(f'{name} {value}: must be from 1 to {MAX_GRASPS}')
        object.__setattr__(self, 'columns', check_columns(self.columns))

    def settings(self) -> dict[str, Any]:
        """Return the arguments as plain values; the robot file as a hash of its content."""
        drawn = {name: getattr(self.distribution, name) for name in _DRAWN}
        items = self.distribution.objects
        described = [i.to_dict() if isinstance(i, ConvexObject) else i for i in items]
        content = repr(asdict(self.robot.description) | {'source': ''})
        settings = {
            'version': find_versions()['isotruss_ros'],
            'robot': self.robot.name,
            'robot_file': hashlib.sha256(content.encode()).hexdigest()[:16],
            'member_names': self.robot.member_names,
            'roller_names': self.robot.roller_names,
            **drawn,
            'objects': described,
            'count': self.count,
            'seed': self.seed,
            'columns': self.columns,
            'part_size': self.part_size,
        }
        return json.loads(json.dumps(settings))  # as it is read from a file

    def forms(self) -> dict[str, Form]:
        """Return the data type and the shape of a row of each column."""
        counts = {
            'corners': corner_count(self.distribution.objects),
            'rollers': len(self.robot.roller_names),
            'members': len(self.robot.member_names),
        }
        axes = {name: COLUMNS[name].axis for name in self.columns}
        return {
            name: (np.dtype(COLUMNS[name].kind), (int(counts.get(axis, axis)),) if axis else ())
            for name, axis in axes.items()
        }


_DRAWN = ('sizes', 'friction', 'depth', 'travel', 'force', 'moment')


def write_dataset(
    run: DatasetRun,
    path: Path,
    executor: Executor | None = None,
    on_progress: Callable[[int], None] | None = None,
) -> bool:
    """
    Write a data set of random grasps; return whether it was written, not complete already.

    Parts are stored in the folder `path` + '.parts'. An interrupted run continues with the parts
    that are missing, and writes the same rows as a run that was not interrupted.

    :param run: arguments that determine the rows.
    :param path: file to write, .npz or .parquet.
    :param executor: executor that computes the parts, for example a process pool; None: this
        process computes them.
    :param on_progress: function that is called with the number of stored grasps.
    :raises DatasetError: the path is invalid, or it is a file or the parts of another run, or
        another process writes it.
    :raises MissingPackageError: a Parquet file needs pyarrow.
    """
    check_path(path)
    settings, folder = run.settings(), path.with_name(f'{path.name}.parts')
    if folder.is_symlink():
        raise DatasetError(f'{folder}: is a link; must be a folder, or not exist')
    if not path.exists():
        folder.mkdir(exist_ok=True)
        with _locked(folder):
            if not path.exists():  # another process may have written it meanwhile
                _write(run, path, folder, executor, on_progress or (lambda _: None))
                return True
    _check_same(path, read_settings(path), settings)
    return False


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Let no other process write the parts in a folder, which is removed if it is empty."""
    lock = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        try:
            yield
        finally:
            with contextlib.suppress(OSError):  # it has parts, or another process removed it
                folder.rmdir()
    except BlockingIOError as error:
        raise DatasetError(f'{folder}: another process writes it: wait for its end') from error
    finally:
        os.close(lock)


def _write(
    run: DatasetRun,
    path: Path,
    folder: Path,
    executor: Executor | None,
    report: Callable[[int], None],
) -> None:
    """Compute the missing parts in a folder, join all, and delete them."""
    settings, head = run.settings(), folder / 'settings.json'
    if head.exists():
        _check_same(folder, head.read_bytes(), settings)
    elif any(folder.iterdir()):
        raise DatasetError(f'{folder}: has no {head.name}: must not exist, or be of a run')
    begins = range(0, run.count, run.part_size)
    parts = {folder / f'{begin:010d}.npz': _size(run, begin) for begin in begins}
    missing = {part: begin for part, begin in zip(parts, begins, strict=True) if not part.exists()}
    stored = run.count - sum(parts[part] for part in missing)
    try:
        write_text(head, json.dumps(settings))
        report(stored)
        for begin, columns in _compute(run, list(missing.values()), executor):
            write_part(part := folder / f'{begin:010d}.npz', columns)
            stored += parts[part]
            report(stored)
        join_parts(path, parts, run.forms(), json.dumps(settings))
    finally:
        if path.exists() or not any(part.exists() for part in parts):
            shutil.rmtree(folder)


def _size(run: DatasetRun, begin: int) -> int:
    """Return the number of grasps in the part that begins with a number."""
    return min(run.part_size, run.count - begin)


def _check_same(path: Path, stored: str | bytes, settings: dict[str, Any]) -> None:
    """Raise DatasetError for the first setting in which a stored run is another one."""
    try:
        other = json.loads(stored)
        differing = [name for name in settings if other[name] != settings[name]]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise DatasetError(f'{path}: no data set of grasps; must be one, or new') from error
    for name in differing:
        raise DatasetError(
            f'{path}: belongs to another run: {name} {_show(other[name])}, now '
            f'{_show(settings[name])}: must be the same run, or another file'
        )


def _show(value: Any) -> str:
    """Return a setting as a text, truncated if long."""
    text = json.dumps(value)
    return text if len(text) <= 80 else f'{text[:80]}…'


def _compute(
    run: DatasetRun, begins: Sequence[int], executor: Executor | None
) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
    """Yield the first numbers and the columns of parts as soon as each is computed."""
    if executor is None:
        yield from ((begin, compute_part(run, begin)) for begin in begins)
        return
    remaining = iter(begins)
    running: dict[Future[dict[str, NDArray[Any]]], int] = {}
    while True:
        for begin in itertools.islice(remaining, MAX_SUBMITTED - len(running)):
            running[executor.submit(compute_part, run, begin)] = begin
        if not running:
            return
        # A failed part, or a dead process, raises only after the complete ones were stored.
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in sorted(done, key=lambda each: each.exception() is not None):
            yield running.pop(future), future.result()


def compute_part(run: DatasetRun, begin: int) -> dict[str, NDArray[Any]]:
    """Return the columns of the part whose first grasp has a number."""
    numbers = range(begin, begin + _size(run, begin))
    grasps = [draw_grasp(run.robot, run.distribution, run.seed, i) for i in numbers]
    corners = corner_count(run.distribution.objects)
    columns = compute_columns(run.robot, grasps, begin, corners)
    return {name: columns[name] for name in run.columns}
