# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Offscreen rendering of recorded states by MuJoCo, with EGL and without a graphics card."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
import importlib
from itertools import pairwise
from types import TracebackType
from typing import Any

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.mujoco_plant.options import load_mujoco, PlantError
from isotruss_ros.mujoco_plant.recording import PlantRecording
import numpy as np
from numpy.typing import NDArray

#: Margin of the view around all moving parts, relative to their extent [-].
VIEW_MARGIN = 0.06
#: Number of recorded states from which the extent of the moving parts is computed [-].
EXTENT_SAMPLES = 60
#: Height of lines and arrows above the tubes' plane, and radius of lines and of arrows [m].
OVERLAY_HEIGHT, LINE_RADIUS, ARROW_RADIUS = 0.08, 0.008, 0.016
#: Colours of lines and arrows: red, green, blue, opacity.
LINE_COLOR, ARROW_COLOR = (0.17, 0.545, 0.243, 1.0), (0.851, 0.282, 0.059, 1.0)
#: Largest number of lines and arrows in a picture [-].
MAX_EXTRA_GEOMS = 1000
#: Azimuth and elevation of MuJoCo's free camera for a top view with the y axis upward [degrees].
NORTH_UP, DOWN = 90.0, -90.0


def require_egl() -> Any:
    """
    Return MuJoCo's module for offscreen rendering with EGL.

    :raises PlantError: MuJoCo is not installed, or EGL is missing; the message names the remedy.
    """
    load_mujoco()
    try:
        egl = importlib.import_module('mujoco.egl')
        context = egl.GLContext(1, 1)
        context.make_current()
        context.free()
    except (ImportError, RuntimeError, AttributeError, OSError) as error:
        raise PlantError(
            f'pictures of plant mujoco need EGL, which cannot be used here ({error}); Mesa has '
            'one for computers without a graphics card: apt install libegl1 libgl1-mesa-dri'
        ) from error
    return egl


class PlantRenderer:
    """
    Context manager that renders states of a recording from a fixed camera above the robot.

    :ivar recording: recorded states.
    :param recording: recorded states.
    :param width: width of the pictures [pixels].
    :param height: height of the pictures [pixels].
    :raises PlantError: MuJoCo is not installed, or EGL is missing.
    """

    def __init__(self, recording: PlantRecording, width: int, height: int) -> None:
        self.recording, self._width, self._height = recording, width, height
        egl, self._mj = require_egl(), load_mujoco()
        self._model = self._mj.MjModel.from_xml_string(recording.text)
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = width, height
        self._data = self._mj.MjData(self._model)
        self._options, self._camera = self._mj.MjvOption(), self._look_at_all()
        self._scene = self._mj.MjvScene(self._model, self._model.ngeom + MAX_EXTRA_GEOMS)
        self._context = egl.GLContext(width, height)
        self._context.make_current()
        self._drawing = self._mj.MjrContext(self._model, self._mj.mjtFontScale.mjFONTSCALE_100)
        self._mj.mjr_setBuffer(self._mj.mjtFramebuffer.mjFB_OFFSCREEN, self._drawing)

    def __enter__(self) -> PlantRenderer:
        """Return the renderer."""
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        """Release the rendering context."""
        self._drawing.free()
        # PyOpenGL raises if the display is already closed.
        with suppress(Exception):
            self._context.free()

    def draw(
        self,
        time: float,
        line: Sequence[tuple[float, float]] = (),
        arrow: tuple[tuple[float, float], tuple[float, float]] | None = None,
    ) -> NDArray[np.uint8]:
        """
        Return a picture (height, width, 3) of one recorded state.

        :param time: time of the state on the clock of the recording [s].
        :param line: points (x, y) of a line above the robot [m].
        :param arrow: tail and tip (x, y) of an arrow [m]; None: no arrow.
        """
        self._go_to(self.recording.at(time))
        mj, scene = self._mj, self._scene
        mj.mjv_updateScene(
            self._model,
            self._data,
            self._options,
            None,
            self._camera,
            mj.mjtCatBit.mjCAT_ALL,
            scene,
        )
        for begin, end in pairwise(line):
            self._connect(mj.mjtGeom.mjGEOM_CAPSULE, LINE_RADIUS, begin, end, LINE_COLOR)
        if arrow is not None:
            self._connect(mj.mjtGeom.mjGEOM_ARROW, ARROW_RADIUS, *arrow, ARROW_COLOR)
        box = mj.MjrRect(0, 0, self._width, self._height)
        mj.mjr_render(box, scene, self._drawing)
        picture = np.empty((self._height, self._width, 3), dtype=np.uint8)
        mj.mjr_readPixels(picture, None, box, self._drawing)
        return np.flipud(picture)

    def _go_to(self, state: Array) -> None:
        """Set the model to a recorded state."""
        model, data, mj = self._model, self._data, self._mj
        coordinates, sizes, places = np.split(state, [model.nq, model.nq + model.ngeom])
        model.geom_size[:, 1], model.geom_pos[:, 0] = sizes, places
        data.qpos[:] = coordinates
        mj.mj_kinematics(model, data)
        mj.mj_comPos(model, data)
        mj.mj_camlight(model, data)

    def _look_at_all(self) -> Any:
        """Return a camera above the robot that shows all moving parts."""
        low, high = np.full(2, np.inf), np.full(2, -np.inf)
        states = self.recording.states
        for state in states[:: max(1, len(states) // EXTENT_SAMPLES)]:
            self._go_to(state)
            places = self._data.xpos[1:, :2]
            low, high = np.minimum(low, places.min(axis=0)), np.maximum(high, places.max(axis=0))
        extent = (1.0 + 2.0 * VIEW_MARGIN) * (high - low)
        upright = max(extent[1], extent[0] * self._height / self._width)
        camera = self._mj.MjvCamera()
        camera.azimuth, camera.elevation = NORTH_UP, DOWN
        camera.lookat[:] = *(0.5 * (low + high)), 0.0
        opening = np.radians(self._model.vis.global_.fovy)
        camera.distance = 0.5 * upright / np.tan(0.5 * opening)
        return camera

    def _connect(
        self,
        kind: Any,
        radius: float,
        begin: tuple[float, float],
        end: tuple[float, float],
        color: Sequence[float],
    ) -> None:
        """Add a cylinder or arrow between two points to the picture, above the tubes."""
        scene, mj = self._scene, self._mj
        if scene.ngeom >= scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        shade = np.array(color, dtype=np.float32)
        mj.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), shade)
        ends = np.array([(*begin, OVERLAY_HEIGHT), (*end, OVERLAY_HEIGHT)])
        mj.mjv_connector(geom, kind, radius, *ends)
        scene.ngeom += 1
