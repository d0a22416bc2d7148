# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Controls of the view: a stop button, handles to drag, and a panel for each browser.

Callbacks for events in browsers run in the thread of the server. They only queue requests, which
the program that shows the view processes in its own thread; everything else belongs to that
thread. Values of viser's handles, which viser replaces as a whole, are read without a lock.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import html
import math
import queue

from isotruss_ros.core import Pose
from isotruss_ros.viewer.browser_panel import BrowserPanel
from isotruss_ros.viewer.control import Control
from isotruss_ros.viewer.drag import LEVER_LENGTH, place_on_circle
from isotruss_ros.viewer.heartbeat import HEARTBEAT, Heartbeats
from isotruss_ros.viewer.names import (
    CLEAR,
    DRAGGED,
    MOVED,
    OBJECT,
    PICK,
    PLACE,
    PLACED,
    PLACING,
    PLANT,
    RESET,
    SHAPE,
    STOP,
    TARGET,
    TURN,
)
from isotruss_ros.viewer.obstacle_controls import ObstacleControls
from isotruss_ros.viewer.picture import Picture
from isotruss_ros.viewer.requests import (
    check_request,
    INITIAL_CHOICE,
    list_choices,
    RequestError,
    WRENCH,
)
import viser

#: Radius [m] and colours of the handles for translation and rotation.
HANDLE, COLOR, TURN_COLOR = 0.07, (31, 79, 217), (242, 120, 0)
#: Requests that cancel a drag.
CANCELLING_REQUESTS = (DRAGGED, PICK, PLACE, SHAPE, PLANT, RESET)
FORCES = tuple(setting.name for setting in WRENCH)


#: Sort keys that put the stop button at the top of the panel, and the introduction below it.
STOP_ORDER, FIRST_ORDER = -10.0, -9.5
INTRODUCTION = """\
An inflated robot holds an object. With *control* on, drag the blue ball; the object moves there,
also after you let go. The orange ball turns it.
"""


class Controls:
    """
    Controls that accept a stop from any browser, other requests from the browser in control.

    :ivar control: browser in control and its commands.
    :ivar placed: obstacles that browsers have placed; they remain without control.
    :param timeout: longest delay of the pictures that the browser in control draws [s]; it is
        longer for a page that draws slowly, see `Heartbeats.timeout`.
    :param report: function that shows the reason of a refused request.
    :param log: function that logs the reason why control was ended; the pages show it.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        picture: Picture,
        friction: float,
        timeout: float,
        report: Callable[[str], None],
        log: Callable[[str], None],
    ) -> None:
        self.control = Control()
        self._server = server
        self._received: queue.SimpleQueue[tuple[int, str, object]] = queue.SimpleQueue()
        self._requests: list[tuple[int, str, object]] = []
        self._released = False
        self._panels: dict[int, BrowserPanel] = {}
        self._values = {
            DRAGGED: OBJECT,
            SHAPE: INITIAL_CHOICE,
            PLANT: INITIAL_CHOICE,
            'friction': friction,
            'diameter': picture.diameter,
            'squeeze': 0.0,
        }
        self._choices = list_choices(
            picture.robot.node_names[: len(picture.robot.topology.joint_names)]
        )
        self._timeout, self._report, self._log = timeout, report, log
        self._heartbeats = Heartbeats(server, self._queue)
        self._at: Pose | None = None
        self._grip = (0.0, 0.0)
        self._twisted = self._way = 0.0
        # At the top, so that it is visible on every screen.
        stop = server.gui.add_button('stop', color='red', order=STOP_ORDER)
        stop.on_click(self._press_stop)
        self._fault = server.gui.add_html('', order=STOP_ORDER)
        server.gui.add_markdown(INTRODUCTION, order=FIRST_ORDER)
        # Above the object and the tubes, always reachable.
        self._height = picture.robot.description.tube_diameter
        self._handle, self._turner = (
            server.scene.add_icosphere(f'/{name}', HANDLE, color=color, visible=False)
            for name, color in (('handle', COLOR), ('turner', TURN_COLOR))
        )
        self._handle.on_drag('left')(partial(self._drag, TARGET))
        self._turner.on_drag('left')(partial(self._drag, TURN))
        self._obstacles = ObstacleControls(server.scene, self._height, self._queue)
        self.placed = self._obstacles.placed

    @property
    def dragged(self) -> str:
        """Return the name of the part selected for dragging: `object`, or the name of a joint."""
        return self._values[DRAGGED]  # type: ignore[return-value]

    def hear(self, now: float) -> bool:
        """
        Read what the browsers have sent since the last call, and return whether one pressed stop.

        It depends neither on a page nor on the drawing, so that a stop always works.

        :param now: time on the clock of the heartbeats [s].
        """
        stops = False
        # Not until it is empty: a page may send faster than this reads.
        for _ in range(self._received.qsize()):
            browser, name, value = self._received.get()
            if name == HEARTBEAT:
                self._heartbeats.note(browser, value, now)
            elif name == STOP:
                stops = True
                self._release()
            else:
                self._requests.append((browser, name, value))
        return stops

    def take(self, now: float, robot_time: float) -> list[tuple[str, float | str]]:
        """
        Update which browser is in control, and return its requests of the last `hear` in order.

        :param now: time on the clock of the heartbeats [s].
        :param robot_time: time on the clock of the robot, for drags [s].
        :return: name and value of each request.
        """
        clients = self._server.get_clients()
        self._panels = {
            number: self._panels.get(number) or self._add_panel(client)
            for number, client in clients.items()
        }
        self._heartbeats.keep(clients)
        wishes = {number: panel.wish for number, panel in self._panels.items()}
        self._pass_on({} if self._released else wishes, now)
        self._released = False
        requests, self._requests = self._requests, []
        taken = []
        for number, name, value in requests:
            if number != self.control.browser:
                continue
            try:
                check_request(name, value, self._choices)
                taken += self._sort(name, value, robot_time)
            except RequestError as error:
                self._report(str(error))
        for number, panel in self._panels.items():
            panel.show(self.control, wishes[number], self._values)  # type: ignore[arg-type]
        return taken

    def mark(self, now: float) -> None:
        """Mark what was sent until now as a picture, which the browser in control must draw."""
        self._fault.content = ''
        self._heartbeats.mark(now)

    def give_up(self, words: str) -> None:
        """
        End the control by a browser after an error, and show it in all pages until one is drawn.

        :param words: text of the error.
        """
        self._release()
        self.control.ended = 'an error of the viewer; switch control on again'
        self._fault.content = f'<b style="color: #b00">{html.escape(words)}</b>'

    def update(self, pose: Pose | None) -> None:
        """
        Place the handles at the part selected for dragging, unless a drag is active.

        :param pose: pose of the selected part; None if unknown.
        """
        shown = self.control.browser is not None and pose is not None
        self._obstacles.update(self.control.browser is not None)
        self._handle.visible = shown
        self._turner.visible = shown and self.dragged == OBJECT
        drag = self.control.drag
        if pose is None or pose == self._at:
            return
        if drag is None:
            self._handle.position = (pose.x, pose.y, self._height)
        if drag is None or not drag.turns:
            self._put_turner(pose.angle)
        # After a drag the next call returns the handle to the dragged part.
        self._at = pose if drag is None else None

    def _add_panel(self, client: viser.ClientHandle) -> BrowserPanel:
        return BrowserPanel(client, self._choices, partial(self._queue, client.client_id))

    def _queue(self, browser: int, name: str, value: object) -> None:
        self._received.put((browser, name, value))

    async def _press_stop(self, event: viser.GuiEvent) -> None:
        self._queue(event.client_id, STOP, 0.0)

    def _release(self) -> None:
        """End the control by a browser; its switch must be switched on again."""
        self.control.release()
        self.placed.end_drags()
        self._requests.clear()
        self._released = True

    def _pass_on(self, wishes: dict[int, bool], now: float) -> None:
        """Pass on the control; a browser whose pictures are delayed loses it."""
        holder, alive = self.control.browser, dict(wishes)
        if holder is not None:
            timeout = self._heartbeats.timeout(holder, self._timeout)
            if self._heartbeats.delay(holder, now) > timeout:
                alive[holder] = False
                self.control.ended = (
                    f'browser {holder} has drawn no new picture for {timeout:.3g} s; '
                    'switch control on again'
                )
                self._log(f'control ended: {self.control.ended}')
        self.control.pass_on(alive)
        if self.control.browser not in (holder, None):
            self._heartbeats.begin(self.control.browser, now)
        if self.control.browser != holder:
            self.placed.end_drags()

    def _sort(self, name: str, value: object, now: float) -> list[tuple[str, float | str]]:
        """Apply a request that concerns the controls; return any other request for the viewer."""
        control = self.control
        if name in (TARGET, TURN, MOVED) and value[-3]:  # type: ignore[index]
            self._report('')  # what was said of the last drag
        if name == TARGET:
            self._move_handle(*value, now)  # type: ignore[call-arg, misc]
            return []
        if name == TURN:
            self._move_turner(*value, now)  # type: ignore[call-arg, misc]
            return []
        if name in (PLACING, PLACED, MOVED, CLEAR):
            self._change_obstacles(name, value, now)
            return [(name, value)] if name == CLEAR else []  # type: ignore[list-item]
        if name in FORCES:
            wrench = dict(zip(FORCES, control.wrench, strict=True)) | {name: value}
            control.wrench = tuple(wrench.values())  # type: ignore[assignment]
            return []
        if name in self._values:
            self._values[name] = value
        if name in CANCELLING_REQUESTS:
            control.drag = None
        return [] if value == INITIAL_CHOICE else [(name, value)]  # type: ignore[list-item]

    def _change_obstacles(self, name: str, value: object, now: float) -> None:
        panel = self._panels[self.control.browser]  # type: ignore[index]
        if name == PLACING:
            panel.begin_placing()
        elif name == PLACED:
            panel.end_placing()
            self._obstacles.add(*value)  # type: ignore[misc]
        elif name == MOVED:
            self._obstacles.move(*value, now)  # type: ignore[call-arg, misc]
        else:
            self._obstacles.clear()

    async def _drag(self, name: str, event: viser.SceneNodeDragEvent) -> None:
        """Queue a drag event; the server's event loop calls this, so the order is preserved."""
        begins = event.phase == 'start'
        drag = (begins, event.start_position[:2], event.end_position[:2])
        self._queue(event.client_id, name, drag)

    def _move_handle(
        self, begins: bool, grabbed: tuple[float, float], pointer: tuple[float, float], now: float
    ) -> None:
        """Move the handle so that the point at which it was grabbed follows the pointer."""
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
        """Rotate the handle by the angle that the pointer has moved around the object."""
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
        place = x + LEVER_LENGTH * math.cos(angle), y + LEVER_LENGTH * math.sin(angle)
        self._turner.position = (*place, self._height)
