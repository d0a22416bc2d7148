# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The controls of the view: a handle to drag, sliders, buttons.

The functions of a browser's events run in threads of the server. They only leave requests, which
the owner of the view takes in its own thread.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import queue

from isotruss_ros.viewer.names import OBJECT, PICK, PLACE, PLANT, PLANTS, RELEASE, STOP
from isotruss_ros.viewer.picture import Picture
import viser

#: Radius of the handle [m], and its colour.
HANDLE, COLOR = 0.05, (31, 79, 217)
#: The plant that runs, of which the view knows nothing.
AS_STARTED = 'as started'


@dataclass(frozen=True)
class Setting:
    """
    A slider.

    :ivar name: of the request that it leaves.
    :ivar label: as it is shown.
    :ivar bounds: smallest and largest value.
    :ivar step: between values.
    :ivar initial: value at the beginning.
    """

    name: str
    label: str
    bounds: tuple[float, float]
    step: float
    initial: float


WRENCH = (
    Setting('fx', 'force x [N]', (-20.0, 20.0), 0.5, 0.0),
    Setting('fy', 'force y [N]', (-20.0, 20.0), 0.5, 0.0),
    Setting('m', 'moment [N m]', (-2.0, 2.0), 0.05, 0.0),
)


class Controls:
    """
    The controls, which leave requests only while `control` is switched on; a stop always.

    :ivar target: (x, y) of the handle [m]; None while nothing is to be moved.
    :ivar wrench: (fx, fy, m) by the sliders [N, N m].
    :param server: of the view.
    :param picture: of the first view.
    :param friction: initial value of its slider.
    """

    def __init__(self, server: viser.ViserServer, picture: Picture, friction: float) -> None:
        self._requests: queue.SimpleQueue[tuple[str, float | str]] = queue.SimpleQueue()
        self.target: tuple[float, float] | None = None
        self.wrench = (0.0, 0.0, 0.0)
        self._at: tuple[float, float] | None = None
        gui = server.gui
        self._stop = gui.add_button('stop', color='red')
        self._stop.on_click(lambda _: self._leave(STOP, 0.0))
        self._control = gui.add_checkbox('control', False, hint='Commands are sent while on')
        self._control.on_update(lambda _: self._switch())
        joints = picture.robot.node_names[: len(picture.robot.topology.joint_names)]
        self._dragged = gui.add_dropdown('drag', (OBJECT, *joints))
        self._dragged.on_update(lambda _: self._choose())
        for name in (PICK, PLACE):
            self._add_goal(gui, name)
        release = gui.add_button('release the stop')
        release.on_click(lambda _: self._leave_if_on(RELEASE, 0.0))
        with gui.add_folder('settings', expand_by_default=False):
            for setting in (
                Setting('friction', 'friction', (0.05, 1.5), 0.05, friction),
                Setting('diameter', 'diameter [m]', (0.05, 0.6), 0.01, picture.diameter),
                Setting('squeeze', 'squeeze [N]', (0.0, 60.0), 1.0, 0.0),
            ):
                self._add(gui, setting, self._leave_if_on)
            plant = gui.add_dropdown('plant', (AS_STARTED, *PLANTS))
            plant.on_update(lambda _: self._choose_plant(plant.value))
        with gui.add_folder('external wrench', expand_by_default=False):
            for setting in WRENCH:
                self._add(gui, setting, self._set_wrench)
        # Above the object and the tubes, so that it is always within reach.
        self._height = picture.robot.description.tube_diameter
        self._handle = server.scene.add_icosphere(
            '/handle', HANDLE, color=COLOR, position=(0.0, 0.0, self._height), visible=False
        )
        self._handle.on_drag('left')(self._drag)

    @property
    def on(self) -> bool:
        """Return whether commands are to be sent."""
        return self._control.value

    @property
    def dragged(self) -> str:
        """Return `object`, or the name of the joint that is dragged."""
        return self._dragged.value

    def take(self) -> list[tuple[str, float | str]]:
        """Return the requests since the last call, (name, value) in their order."""
        taken = []
        while not self._requests.empty():
            taken.append(self._requests.get())
        return taken

    def update(self, position: tuple[float, float] | None) -> None:
        """
        Show the handle on what is dragged, while nobody drags it.

        :param position: (x, y) of object or joint [m]; None if unknown.
        """
        visible = self.on and position is not None
        if self._handle.visible != visible:
            self._handle.visible = visible
        if visible and self.target is None and position != self._at:
            self._handle.position = (*position, self._height)
            self._at = position

    def switch_off(self) -> None:
        """Switch the control off."""
        self._control.value = False
        self._switch()

    def _choose_plant(self, plant: str) -> None:
        self._switch()
        if plant != AS_STARTED:
            self._leave_if_on(PLANT, plant)

    def _add_goal(self, gui: viser.GuiApi, name: str) -> None:
        gui.add_button(name).on_click(lambda _: self._begin_goal(name))

    def _begin_goal(self, name: str) -> None:
        """Leave the request; what was dragged to so far does not count any more."""
        self._switch()
        self._leave_if_on(name, 0.0)

    def _add(
        self,
        gui: viser.GuiApi,
        setting: Setting,
        leave: Callable[[str, float], None],
    ) -> None:
        slider = gui.add_slider(setting.label, *setting.bounds, setting.step, setting.initial)
        slider.on_update(lambda _: leave(setting.name, slider.value))

    def _leave(self, name: str, value: float | str) -> None:
        self.target = None if name == STOP else self.target
        self._requests.put((name, value))

    def _leave_if_on(self, name: str, value: float | str) -> None:
        if self.on:
            self._leave(name, value)

    def _switch(self) -> None:
        self.target = self._at = None

    def _choose(self) -> None:
        self._switch()
        self._leave_if_on('drag', self.dragged)

    def _set_wrench(self, name: str, value: float) -> None:
        names = [setting.name for setting in WRENCH]
        new = dict(zip(names, self.wrench, strict=True)) | {name: value}
        self.wrench = tuple(new.values())

    def _drag(self, event: viser.SceneNodeDragEvent) -> None:
        if not self.on:
            return
        # The grabbed point goes where the pointer is.
        x, y, height = self._handle.position
        x += event.end_position[0] - event.start_position[0]
        y += event.end_position[1] - event.start_position[1]
        self._handle.position = (x, y, height)
        self.target = (float(x), float(y))
