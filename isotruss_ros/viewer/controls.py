# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The controls of the view: a stop, a handle to drag, and for each browser its own panel.

The functions of a browser's events run in threads of the server. They only leave requests, which
the owner of the view takes in its own thread.
"""

from __future__ import annotations

import queue

from isotruss_ros.viewer.browser_panel import AS_STARTED, BrowserPanel, WRENCH
from isotruss_ros.viewer.control import Control
from isotruss_ros.viewer.names import DRAGGED, OBJECT, PICK, PLACE, PLANT, STOP, TARGET
from isotruss_ros.viewer.picture import Picture
import viser

#: Radius of the handle [m], and its colour.
HANDLE, COLOR = 0.05, (31, 79, 217)
#: Requests with which what was dragged to so far does not count any more.
NEW_TASKS = (DRAGGED, PICK, PLACE, PLANT)
FORCES = tuple(setting.name for setting in WRENCH)


#: Of the stop, before all that the panel shows.
STOP_ORDER = -10.0


class Controls:
    """
    The controls: requests count from the browser in control only, but a stop from each.

    :ivar control: who has it, and what is commanded so.
    :param server: of the view.
    :param picture: of the first view.
    :param friction: initial value of its slider.
    """

    def __init__(self, server: viser.ViserServer, picture: Picture, friction: float) -> None:
        self.control = Control()
        self._server = server
        self._requests: queue.SimpleQueue[tuple[int, str, object]] = queue.SimpleQueue()
        self._panels: dict[int, BrowserPanel] = {}
        self._values = {
            DRAGGED: OBJECT,
            PLANT: AS_STARTED,
            'friction': friction,
            'diameter': picture.diameter,
            'squeeze': 0.0,
        }
        self._joints = picture.robot.node_names[: len(picture.robot.topology.joint_names)]
        self._at: tuple[float, float] | None = None
        self._grip = (0.0, 0.0)
        # Before all else, so that it is on every screen.
        stop = server.gui.add_button('stop', color='red', order=STOP_ORDER)
        stop.on_click(lambda event: self._requests.put((event.client_id, STOP, 0.0)))
        # Above the object and the tubes, so that it is always within reach.
        self._height = picture.robot.description.tube_diameter
        self._handle = server.scene.add_icosphere(
            '/handle', HANDLE, color=COLOR, position=(0.0, 0.0, self._height), visible=False
        )
        self._handle.on_drag('left')(self._drag)

    @property
    def dragged(self) -> str:
        """Return `object`, or the name of the joint that is dragged."""
        return self._values[DRAGGED]

    def take(self, now: float) -> list[tuple[str, float | str]]:
        """
        Decide who has control, and return the requests since the last call in their order.

        :param now: time [s].
        :return: name and value of each.
        """
        clients = self._server.get_clients()
        self._panels = {
            number: self._panels.get(number) or self._add_panel(client)
            for number, client in clients.items()
        }
        wishes = {number: panel.wish for number, panel in self._panels.items()}
        self.control.pass_on(wishes)
        taken = []
        while not self._requests.empty():
            number, name, value = self._requests.get()
            if name == STOP or number == self.control.browser:
                taken += self._sort(name, value, now)
        for number, panel in self._panels.items():
            panel.show(self.control, wishes[number], self._values)
        return taken

    def update(self, position: tuple[float, float] | None) -> None:
        """
        Show the handle on what is dragged, while nobody drags it.

        :param position: (x, y) of object or joint [m]; None if unknown.
        """
        self._handle.visible = self.control.browser is not None and position is not None
        if self.control.drag is not None:
            self._at = None
        elif position is not None and position != self._at:
            self._handle.position = (*position, self._height)
            self._at = position

    def _add_panel(self, client: viser.ClientHandle) -> BrowserPanel:
        number = client.client_id
        return BrowserPanel(
            client, self._joints, lambda name, value: self._requests.put((number, name, value))
        )

    def _sort(self, name: str, value: object, now: float) -> list[tuple[str, float | str]]:
        """Keep what a request changes here; return what is left for the owner of the view."""
        control = self.control
        if name == TARGET:
            self._move_handle(*value, now)
            return []
        if name in FORCES:
            wrench = dict(zip(FORCES, control.wrench, strict=True)) | {name: value}
            control.wrench = tuple(wrench.values())
            return []
        if name in self._values:
            self._values[name] = value
        if name == STOP:
            control.release()
        elif name in NEW_TASKS:
            control.drag = None
        return [] if value == AS_STARTED else [(name, value)]

    async def _drag(self, event: viser.SceneNodeDragEvent) -> None:
        """Leave a request; in the loop of the server, which keeps the order of the events."""
        begins = event.phase == 'start'
        drag = (begins, event.start_position[:2], event.end_position[:2])
        self._requests.put((event.client_id, TARGET, drag))

    def _move_handle(
        self, begins: bool, grabbed: tuple[float, float], pointer: tuple[float, float], now: float
    ) -> None:
        """Put the point that was grabbed where the pointer is."""
        if begins:
            x, y, _ = self._handle.position
            self._grip = (x - grabbed[0], y - grabbed[1])
        target = (pointer[0] + self._grip[0], pointer[1] + self._grip[1])
        self.control.drag_to(target, begins, now)
        if self.control.drag is not None:
            self._handle.position = (*target, self._height)
