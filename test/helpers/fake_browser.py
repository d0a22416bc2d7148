# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A client of a view that sends what it likes, as no page does, and that can freeze."""

from __future__ import annotations

import contextlib
import threading
from typing import Any
from urllib.parse import urlsplit

import msgspec
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
ALIVE = {
    'type': 'LocalStorageGetItemResponseMessage',
    'request_uuid': '',
    'value': None,
    'error': None,
}


class FakeBrowser:
    """
    Connected to a view, it gives signs of life while it is not frozen.

    :ivar frozen: whether it gives none.
    :ivar controls: uuid of what the page shows, by its label.
    :param address: of the view.
    """

    def __init__(self, address: str) -> None:
        parts = urlsplit(address)
        query = f'/?{parts.query}' if parts.query else ''
        self._socket = connect(
            f'ws://{parts.netloc}{query}',
            origin=f'http://{parts.netloc}',
            subprotocols=[f'viser-v{viser.__version__}'],
            max_size=None,
        )
        self.frozen, self.controls = False, {}
        self._closed = threading.Event()
        self._send(CAMERA)
        self._threads = [
            threading.Thread(target=each, daemon=True) for each in (self._listen, self._live)
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Disconnect."""
        self._closed.set()
        self._socket.close()
        for thread in self._threads:
            thread.join()

    def set(self, label: str, value: object) -> None:
        """Give a control a value, once the page shows it."""
        message = {'type': 'GuiUpdateMessage', 'uuid': self.controls[label]}
        self._send(message | {'updates': {'value': value}})

    def drag(self, handle: str, phase: str, x: float, y: float) -> None:
        """Send a phase of a drag of `handle` or `turner`."""
        place = {'start_position': [0.0, 0.0, 0.0], 'end_position': [x, y, 0.0]}
        screen = {'start_screen_pos': [0.5, 0.5], 'end_screen_pos': [0.5, 0.5]}
        drag = {'type': 'SceneNodeDragMessage', 'phase': phase, 'name': f'/{handle}'}
        how = {'instance_index': None, 'button': 'left', 'modifier': None, 'owner': ''}
        self._send(drag | how | place | screen)

    def _send(self, message: dict[str, Any]) -> None:
        self._socket.send(msgspec.msgpack.encode(message))

    def _live(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while not self._closed.wait(0.1):
                if not self.frozen:
                    self._send(ALIVE)

    def _listen(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                data = self._socket.recv()
                size = int.from_bytes(data[8:16], 'little')
                text = zstandard.ZstdDecompressor().decompress(
                    data[16 : 16 + size], int.from_bytes(data[:8], 'little')
                )
                for message in msgspec.msgpack.decode(text)['messages']:
                    self._take(message)

    def _take(self, message: dict[str, Any]) -> None:
        if 'props' in message and (label := message['props'].get('label')):
            self.controls[label] = message['uuid']
