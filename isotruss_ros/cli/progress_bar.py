# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How far a search is, on the terminal."""

from __future__ import annotations

from types import TracebackType

from isotruss_ros.core.planning.grasp_plan import Progress as SearchProgress
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

    def show(self, progress: SearchProgress) -> None:
        """
        Draw how far it is.

        :param progress: of the search.
        """
        words = f'{progress.evaluations} evaluations, {progress.found} found'
        if progress.best is not None:
            words += f', best {progress.best:.4g}'
        if progress.time_left is not None:
            words += f', {progress.time_left:.0f} s left'
        self._progress.update(self._task, completed=progress.share, words=words)
