# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A client of a view that sends any message and can freeze, and one in control of a view."""

from __future__ import annotations

import contextlib
import threading
import time
from typing import Any
from urllib.parse import urlsplit

from isotruss_ros.core import Pose
from isotruss_ros.viewer.controls import Controls
from isotruss_ros.viewer.picture import Picture
from isotruss_ros.viewer.view import View
import msgspec
from robots import preset
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
import zstandard

CAMERA = {
    'type': 'ViewerCameraMessage',
    'wxyz': [1.0, 0.0, 0.0, 0.0],
    'position': [0.0, 0.0, 1.0],
    'fov': 1.0,
    'near': 0.1,
    'far': 100.0,
    'image_height': 100,
    'image_width': 100,
    'look_at': [0.0, 0.0, 0.0],
    'up_direction': [0.0, 1.0, 0.0],
}
CLICK = {
    'type': 'ScenePointerMessage',
    'event_type': 'click',
    'modifier': None,
    'ray_origin': [0.0, 0.0, 1.0],
    'ray_direction': [0.0, 0.0, -1.0],
    'screen_pos': [[0.5, 0.5]],
}
HEARTBEAT = {'type': 'LocalStorageGetItemResponseMessage', 'request_uuid': '', 'error': None}
#: Period of the heartbeats [s].
PERIOD = 0.1
#: Longest wait of a test [s].
DEADLINE = 60.0
#: Texts before and after the time of a picture.
MARK = '<!--picture ', '-->'


class FakeBrowser:
    """Client that draws every picture at once while it is not frozen; keeps controls and scene."""

    def __init__(self, address: str) -> None:
        parts = urlsplit(address)
        query = f'/?{parts.query}' if parts.query else ''
        self._socket = connect(
            f'ws://{parts.netloc}{query}',
            origin=f'http://{parts.netloc}',
            subprotocols=[f'viser-v{viser.__version__}'],
            max_size=None,
        )
        self.frozen, self.controls, self.scene = False, {}, {}
        self._texts: dict[str, str] = {}
        self._mark = None
        self._closed = threading.Event()
        self.send(CAMERA)
        self._threads = [
            threading.Thread(target=each, daemon=True) for each in (self._listen, self._live)
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        self._closed.set()
        self._socket.close()
        for thread in self._threads:
            thread.join()

    def set(self, label: str, value: object) -> None:  # noqa: A003
        message = {'type': 'GuiUpdateMessage', 'uuid': self.controls[label]}
        self.send(message | {'updates': {'value': value}})

    def shows(self, words: str) -> bool:
        """Return whether a changed element of the page contains words."""
        return any(words in text for text in list(self._texts.values()))

    def until_drawn(self, node: str, field: str, value: object) -> None:
        """Wait until a field of a node of the scene has a value."""
        end = time.monotonic() + DEADLINE
        while self.scene.get(node, {}).get(field) != value:
            assert time.monotonic() < end, self.scene.get(node)
            time.sleep(0.01)

    def drag(
        self,
        handle: str,
        phase: str,
        x: float,
        y: float,
        grabbed: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Send a phase of a drag of `handle` or `turner`, which was grabbed at a point."""
        place = {'start_position': [*grabbed, 0.0], 'end_position': [x, y, 0.0]}
        screen = {'start_screen_pos': [0.5, 0.5], 'end_screen_pos': [0.5, 0.5]}
        drag = {'type': 'SceneNodeDragMessage', 'phase': phase, 'name': f'/{handle}'}
        how = {'instance_index': None, 'button': 'left', 'modifier': None, 'owner': ''}
        self.send(drag | how | place | screen)

    @property
    def is_clickable(self) -> bool:
        """Return whether the page sends clicks in the scene."""
        return bool(self.scene.get('ScenePointerEnableMessage', {}).get('modifiers'))

    def click(self, x: float, y: float, down: float = -1.0) -> None:
        """
        Click a point of the scene in the plane of the robot.

        :param down: vertical component of the ray, upward if positive.
        """
        ray = {'ray_origin': [x - 0.3, y, 2.0], 'ray_direction': [0.15, 0.0, down]}
        self.send(CLICK | ray)

    def send(self, message: dict[str, Any]) -> None:
        """Send a message of viser's protocol."""
        self.send_packed(msgspec.msgpack.encode(message))

    def send_packed(self, message: str | bytes) -> None:
        self._socket.send(message)

    def _live(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while not self._closed.wait(PERIOD):
                if not self.frozen:
                    self.send(HEARTBEAT | {'value': self._mark})

    def _listen(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                data = self._socket.recv()
                packed = data[16:][: int.from_bytes(data[8:16], 'little')]
                whole = int.from_bytes(data[:8], 'little')
                text = zstandard.ZstdDecompressor().decompress(packed, whole)
                sent, end, arrays = msgspec.msgpack.decode(text), 16 + len(packed), []
                for size in sent['binaryBufferLengths']:
                    begin = end + -end % 8  # aligned
                    end = begin + size
                    arrays.append(data[begin:end])
                for message in sent['messages']:
                    self._take(message, arrays)

    def _take(self, message: dict[str, Any], arrays: list[bytes]) -> None:
        fields = message | message.get('props', {}) | message.get('updates', {})
        for name, value in fields.items():
            if isinstance(value, dict) and '__binary_index' in value:
                fields[name] = arrays[value['__binary_index']]
        self.scene.setdefault(message.get('name', message['type']), {}).update(fields)
        if 'props' in message and (label := message['props'].get('label')):
            self.controls[label] = message['uuid']
        updates = message.get('updates', {})
        content = updates.get('content', updates.get('_markdown'))
        if isinstance(content, str):
            self._texts[message['uuid']] = content
            if content.startswith(MARK[0]):
                self._mark = content.removeprefix(MARK[0]).removesuffix(MARK[1])


class Session:
    """View without a node, and a browser that has control until a timeout without pictures [s]."""

    POSE = Pose(0.5, 0.2, 0.3)

    def __init__(self, timeout=DEADLINE):
        self.view = View(Picture(preset('nine_member'), 0.3), '127.0.0.1', 0)
        self.refused, self.log, self.taken, self.stops = [], [], [], 0
        self.controls = Controls(
            self.view.server, self.view.picture, 0.5, timeout, self.refused.append, self.log.append
        )
        self.control = self.controls.control
        self.browser = FakeBrowser(self.view.address)
        self.set('control', True)
        self.until(lambda: self.control.browser is not None)

    def set(self, label, value):  # noqa: A003
        """Set a control of the page; True presses a button."""
        self.until(lambda: label in self.browser.controls)
        self.browser.set(label, value)

    def step(self):
        """Take requests and send a picture, as the node does."""
        now = time.monotonic()
        self.stops += self.controls.hear(now)
        self.taken += self.controls.take(now, now)
        self.controls.update(self.POSE)
        self.view.update(now)
        self.controls.mark(now)

    def until(self, what):
        """Step until a condition is true."""
        end = time.monotonic() + DEADLINE
        while not what():
            assert time.monotonic() < end, (self.control, self.refused, self.taken)
            self.step()
            time.sleep(0.002)

    def grab(self):
        """Begin a drag of the object."""
        self.browser.drag('handle', 'start', 0.1, 0.0)
        self.until(lambda: self.control.drag is not None)

    def press_stop(self):
        """Press the stop, after which all earlier messages have been read."""
        self.set('stop', True)
        self.until(lambda: self.stops)

    def close(self):
        """End browser and server."""
        self.browser.close()
        self.view.close()
