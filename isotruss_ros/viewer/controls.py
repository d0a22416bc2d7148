# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The controls of the view: a stop, handles to drag, and for each browser its own panel.

The functions of a browser's events run in threads of the server. They only leave requests, which
the owner of the view takes in its own thread.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import math
import queue

from isotruss_ros.core import Pose
from isotruss_ros.viewer.browser_panel import BrowserPanel
from isotruss_ros.viewer.control import Control
from isotruss_ros.viewer.drag import LEVER, place_on_circle
from isotruss_ros.viewer.heartbeat import Heartbeats
from isotruss_ros.viewer.names import (
    DRAGGED,
    OBJECT,
    PICK,
    PLACE,
    PLANT,
    RESET,
    SHAPE,
    STOP,
    TARGET,
    TURN,
)
from isotruss_ros.viewer.picture import Picture
from isotruss_ros.viewer.requests import (
    AS_STARTED,
    check_request,
    list_choices,
    RequestError,
    WRENCH,
)
import viser

#: Radius of the handles [m], and their colours.
HANDLE, COLOR, TURN_COLOR = 0.07, (31, 79, 217), (242, 120, 0)
#: Requests with which what was dragged to so far does not count any more.
NEW_TASKS = (DRAGGED, PICK, PLACE, SHAPE, PLANT, RESET)
FORCES = tuple(setting.name for setting in WRENCH)


#: Of the stop, before all that the panel shows, and of the first words, behind it.
STOP_ORDER, FIRST_ORDER = -10.0, -9.5
FIRST_WORDS = """\
A truss robot of inflated tubes holds an object. To move it, switch *control* on and drag the blue
ball; the object follows. The orange ball turns it.
"""


class Controls:
    """
    The controls: requests count from the browser in control only, but a stop from each.

    :ivar control: who has it, and what is commanded so.
    :param server: of the view.
    :param picture: of the first view.
    :param friction: initial value of its slider.
    :param timeout: control ends where a page gives no sign of life for so long [s].
    :param report: called with what is refused, in words.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        picture: Picture,
        friction: float,
        timeout: float,
        report: Callable[[str], None],
    ) -> None:
        self.control = Control()
        self._server = server
        self._requests: queue.SimpleQueue[tuple[int, str, object]] = queue.SimpleQueue()
        self._panels: dict[int, BrowserPanel] = {}
        self._values = {
            DRAGGED: OBJECT,
            SHAPE: AS_STARTED,
            PLANT: AS_STARTED,
            'friction': friction,
            'diameter': picture.diameter,
            'squeeze': 0.0,
        }
        self._choices = list_choices(
            picture.robot.node_names[: len(picture.robot.topology.joint_names)]
        )
        self._timeout, self._report = timeout, report
        self._heartbeats = Heartbeats(server)
        self._at: Pose | None = None
        self._grip = (0.0, 0.0)
        self._twisted = self._way = 0.0
        # Before all else, so that it is on every screen.
        stop = server.gui.add_button('stop', color='red', order=STOP_ORDER)
        stop.on_click(lambda event: self._requests.put((event.client_id, STOP, 0.0)))
        server.gui.add_markdown(FIRST_WORDS, order=FIRST_ORDER)
        # Above the object and the tubes, so that it is always within reach.
        self._height = picture.robot.description.tube_diameter
        self._handle, self._turner = (
            server.scene.add_icosphere(f'/{name}', HANDLE, color=color, visible=False)
            for name, color in (('handle', COLOR), ('turner', TURN_COLOR))
        )
        self._handle.on_drag('left')(partial(self._drag, TARGET))
        self._turner.on_drag('left')(partial(self._drag, TURN))

    @property
    def dragged(self) -> str:
        """Return `object`, or the name of the joint that is dragged."""
        return self._values[DRAGGED]  # type: ignore[return-value]

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
        alive = dict(wishes)
        holder = self.control.browser
        if self._heartbeats.is_silent(holder, now, self._timeout):
            alive[holder] = False
            self._report(
                f'control ended: browser {holder} gave no sign of life for {self._timeout:g} s'
            )
        self.control.pass_on(alive)
        if self.control.browser not in (holder, None):
            self._heartbeats.note(self.control.browser)
        taken = []
        while not self._requests.empty():
            number, name, value = self._requests.get()
            if name != STOP and number != self.control.browser:
                continue
            try:
                check_request(name, value, self._choices)
            except RequestError as error:
                self._report(str(error))
            else:
                taken += self._sort(name, value, now)
        for number, panel in self._panels.items():
            panel.show(self.control, wishes[number], self._values)  # type: ignore[arg-type]
        return taken

    def update(self, pose: Pose | None) -> None:
        """
        Show the handles on what is dragged, while nobody drags it.

        :param pose: of object or joint; None if unknown.
        """
        shown = self.control.browser is not None and pose is not None
        self._handle.visible = shown
        self._turner.visible = shown and self.dragged == OBJECT
        drag = self.control.drag
        if pose is None or pose == self._at:
            return
        if drag is None:
            self._handle.position = (pose.x, pose.y, self._height)
        if drag is None or not drag.turns:
            self._put_turner(pose.angle)
        # What a drag ends, the next call puts back on what was dragged.
        self._at = pose if drag is None else None

    def _add_panel(self, client: viser.ClientHandle) -> BrowserPanel:
        number = client.client_id
        return BrowserPanel(
            client, self._choices, lambda name, value: self._requests.put((number, name, value))
        )

    def _sort(self, name: str, value: object, now: float) -> list[tuple[str, float | str]]:
        """Keep what a request changes here; return what is left for the owner of the view."""
        control = self.control
        if name == TARGET:
            self._move_handle(*value, now)  # type: ignore[call-arg, misc]
            return []
        if name == TURN:
            self._move_turner(*value, now)  # type: ignore[call-arg, misc]
            return []
        if name in FORCES:
            wrench = dict(zip(FORCES, control.wrench, strict=True)) | {name: value}
            control.wrench = tuple(wrench.values())  # type: ignore[assignment]
            return []
        if name in self._values:
            self._values[name] = value
        if name == STOP:
            control.release()
        elif name in NEW_TASKS:
            control.drag = None
        return [] if value == AS_STARTED else [(name, value)]  # type: ignore[list-item]

    async def _drag(self, name: str, event: viser.SceneNodeDragEvent) -> None:
        """Leave a request; in the loop of the server, which keeps the order of the events."""
        begins = event.phase == 'start'
        drag = (begins, event.start_position[:2], event.end_position[:2])
        self._requests.put((event.client_id, name, drag))

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

    def _move_turner(
        self, begins: bool, grabbed: tuple[float, float], pointer: tuple[float, float], now: float
    ) -> None:
        """Turn the lever as far as the pointer turned about the object since it was grabbed."""
        x, y, _ = self._handle.position
        angle, start = (math.atan2(place[1] - y, place[0] - x) for place in (pointer, grabbed))
        if begins:
            at = self._turner.position
            self._twisted = math.atan2(at[1] - y, at[0] - x) - start
            self._way = 0.0
        self._way, _ = target = place_on_circle(angle + self._twisted, self._way)
        self.control.drag_to(target, begins, now, turns=True)
        if self.control.drag is not None:
            self._put_turner(angle + self._twisted)

    def _put_turner(self, angle: float) -> None:
        x, y, _ = self._handle.position
        place = x + LEVER * math.cos(angle), y + LEVER * math.sin(angle)
        self._turner.position = (*place, self._height)
