"""How far a search is, on the terminal."""

from __future__ import annotations

from types import TracebackType

from isotruss_ros.core import Progress as SearchProgress
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn


class ProgressBar:
    """Shows what `plan_grasps` tells, on standard error, while that is a terminal."""

    def __init__(self) -> None:
        console = Console(stderr=True)
        self._progress = Progress(
            TextColumn('searching'),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn('{task.fields[words]}'),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._task = self._progress.add_task('', total=1.0, words='')

    def __enter__(self) -> ProgressBar:
        """Begin to draw."""
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the terminal as it was."""
        if not self._progress.disable:  # it would end a line that it did not begin
            self._progress.stop()

    def show(self, told: SearchProgress) -> None:
        """Draw how far it is."""
        words = f'{told.evaluations} evaluations, {told.found} found'
        if told.best is not None:
            words += f', best {told.best:.4g}'
        if told.time_left is not None:
            words += f', {told.time_left:.0f} s left'
        self._progress.update(self._task, completed=told.share, words=words)
