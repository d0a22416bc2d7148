# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Progress bar of a search on the terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib

from isotruss_ros.core.planning.grasp_plan import Progress as SearchProgress
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn


@contextlib.contextmanager
def show_progress() -> Iterator[Callable[[SearchProgress], None]]:
    """Yield a function that shows the progress of a search on a terminal."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda _: None
        return
    words = TextColumn('{task.fields[words]}')
    columns = (TextColumn('searching'), BarColumn(), TaskProgressColumn(), words)
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task('', total=1.0, words='')

        def show(progress: SearchProgress) -> None:
            words = f'{progress.evaluations} evaluations, {progress.found} found'
            if progress.best is not None:
                words += f', best {progress.best:.4g}'
            if progress.time_left is not None:
                words += f', {progress.time_left:.0f} s left'
            bar.update(task, completed=progress.share, words=words)

        yield show
