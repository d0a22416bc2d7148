# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Live view of a robot, served to browsers."""

from __future__ import annotations

import contextlib
import io

from isotruss_ros.viewer.panels import Panels
from isotruss_ros.viewer.picture import Picture
from isotruss_ros.viewer.scene import Scene
from isotruss_ros.viewer.server import open_server


class View:
    """
    Live view with scene and panels; `Controls` are added by nodes that move a robot.

    :ivar address: address to open in a browser, with its token.
    :ivar local: whether only this machine can reach the server.
    :param port: port of the server; 0: any free port.
    """

    def __init__(self, picture: Picture, host: str, port: int) -> None:
        self.picture = picture
        self.server, gate = open_server(host, port)
        self.address, self.local = gate.address, gate.local
        # Beside the scene, without covering the robot.
        self.server.gui.main_panel.dock_right()
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        self._scene = Scene(self.server, picture)
        self._panels = Panels(self.server)

    def update(self, now: float) -> None:
        """Show the current state of the picture."""
        with self.server.atomic():
            self._scene.update(self.picture, now)
            self._panels.update(self.picture, now)

    def close(self) -> None:
        """Stop the server of the view."""
        # viser prints that it stopped.
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()
