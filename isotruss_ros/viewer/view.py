# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The server of the live view."""

from __future__ import annotations

import contextlib
import io

from isotruss_ros.viewer.panels import Panels
from isotruss_ros.viewer.picture import Picture
from isotruss_ros.viewer.scene import Scene
from isotruss_ros.viewer.server import open_server


class View:
    """
    Serve scene and panels; `controls` are added by who commands a robot.

    :ivar server: of the view.
    :ivar picture: what is shown.
    :ivar address: for a browser.
    :param picture: what is shown.
    :param host: address to which the server is bound.
    :param port: of the server; any that is free if 0.
    :raises ViewError: the address cannot be served.
    """

    def __init__(self, picture: Picture, host: str, port: int) -> None:
        self.picture = picture
        self.server, self.address = open_server(host, port)
        # Beside the scene, so that the robot is not under it.
        self.server.gui.main_panel.dock_right()
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        self._scene = Scene(self.server, picture)
        self._panels = Panels(self.server)

    def update(self, now: float) -> None:
        """
        Show the picture as it is.

        :param now: time on the clock of its messages [s].
        """
        with self.server.atomic():
            self._scene.update(self.picture, now)
            self._panels.update(self.picture, now)

    def close(self) -> None:
        """End the server."""
        # viser prints that it stopped.
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()
