# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The server of the live view."""

from __future__ import annotations

from isotruss_ros.core import IsotrussError
from isotruss_ros.viewer.panels import Panels
from isotruss_ros.viewer.picture import Picture
from isotruss_ros.viewer.scene import Scene
import viser


class ViewError(IsotrussError, RuntimeError):
    """The view cannot be served."""


class View:
    """
    Serve scene and panels; `controls` are added by who commands a robot.

    :ivar server: of the view.
    :ivar picture: what is shown.
    :ivar address: for a browser.
    :param picture: what is shown.
    :param host: address to which the server is bound.
    :param port: of the server; the next that is free if it is taken.
    """

    def __init__(self, picture: Picture, host: str, port: int) -> None:
        self.picture = picture
        try:
            self.server = viser.ViserServer(host=host, port=port, verbose=False)
        except OSError as error:
            raise ViewError(f'no server at {host}:{port}: {error}') from error
        # Beside the scene, so that the robot is not under it.
        self.server.gui.main_panel.dock_right()
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        self.address = f'http://{host}:{self.server.get_port()}'
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
        self.server.stop()
