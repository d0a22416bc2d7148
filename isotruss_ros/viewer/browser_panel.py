# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Control panel of one browser; it has commands while this browser is in control."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Mapping, Sequence
import math

from isotruss_ros.viewer.control import Control
from isotruss_ros.viewer.names import (
    CLEAR,
    DRAGGED,
    PICK,
    PLACE,
    PLACED,
    PLACING,
    PLANT,
    RELEASE,
    RESET,
    RESUME,
    SHAPE,
)
from isotruss_ros.viewer.requests import Setting, SETTINGS, WRENCH
import viser

#: Sort key that puts the panel below the stop button and above the measurements.
PANEL_ORDER = -9.0


class BrowserPanel:
    """Switch to request control, and commands that only the browser in control has."""

    def __init__(
        self,
        client: viser.ClientHandle,
        choices: Mapping[str, Sequence[str]],
        queue: Callable[[str, object], None],
    ) -> None:
        self._number, self._gui, self._scene = client.client_id, client.gui, client.scene
        self._choices, self._queue = choices, queue
        self._words = client.gui.add_markdown('', order=PANEL_ORDER)
        self._switch = client.gui.add_checkbox(
            'control', False, hint='Commands are sent while on', order=PANEL_ORDER + 1.0
        )
        self._commands: viser.GuiFolderHandle | None = None

    @property
    def wish(self) -> bool:
        """Return whether this browser requests control."""
        return self._switch.value is True

    def show(self, control: Control, wish: bool, values: Mapping[str, float | str]) -> None:
        """Show which browser is in control, and the values of the settings."""
        mine = control.browser == self._number
        # Only for a refused request: a new one may have arrived since.
        if wish and not mine:
            self._switch.value = False
        self._switch.disabled = not mine and control.browser is not None
        self._words.content = control.describe(self._number)
        if mine and self._commands is None:
            self._commands = self._add_commands(values)
        elif not mine and self._commands is not None:
            self._commands.remove()
            self._commands = None
            self.end_placing()

    def begin_placing(self) -> None:
        """Queue the place of the next click in the scene."""
        self.end_placing()
        self._scene.on_click()(self._queue_click)

    def end_placing(self) -> None:
        """Ignore clicks in the scene."""
        self._scene.remove_click_callback()

    def _add_commands(self, values: Mapping[str, float | str]) -> viser.GuiFolderHandle:
        gui = self._gui
        with gui.add_folder(None, order=PANEL_ORDER + 2.0) as commands:
            self._add_choice('drag', DRAGGED, values)
            for label, name in (
                ('pick', PICK),
                ('place', PLACE),
                ('resume', RESUME),
                ('release the stop', RELEASE),
                ('reset', RESET),
                ('add obstacle', PLACING),
                ('clear obstacles', CLEAR),
            ):
                gui.add_button(label).on_click(self._on_event(name, 0.0))
            with gui.add_folder('assumed by the analysis', expand_by_default=False):
                for setting in SETTINGS:
                    self._add_slider(setting, values[setting.name])  # type: ignore[arg-type]
            self._add_choice('object', SHAPE, values)
            self._add_choice('plant', PLANT, values)
            with gui.add_folder('external wrench', expand_by_default=False):
                for setting in WRENCH:
                    self._add_slider(setting, 0.0)
        return commands

    def _add_slider(self, setting: Setting, value: float) -> None:
        slider = self._gui.add_slider(setting.label, *setting.bounds, setting.step, value)
        slider.on_update(self._on_event(setting.name))

    def _add_choice(self, label: str, name: str, values: Mapping[str, float | str]) -> None:
        choice = self._gui.add_dropdown(label, self._choices[name], initial_value=values[name])
        choice.on_update(self._on_event(name))

    def _on_event(
        self, name: str, value: float | None = None
    ) -> Callable[[viser.GuiEvent], Coroutine[None, None, None]]:
        """
        Return a callback that queues a request.

        It is a coroutine, which viser calls in its own thread, so that the order is preserved.

        :param value: value of the request; None: that of the control.
        """

        async def queue(event: viser.GuiEvent) -> None:
            self._queue(name, event.target.value if value is None else value)

        return queue

    async def _queue_click(self, event: viser.SceneClickEvent) -> None:
        """Queue the point in the plane of the robot that was clicked; NaN for the sky."""
        (x, y, z), (dx, dy, dz) = event.ray_origin, event.ray_direction
        way = -z / dz if z * dz < 0.0 else math.nan
        self._queue(PLACED, ((x + way * dx, y + way * dy),))
