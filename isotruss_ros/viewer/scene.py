# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""3D scene of the robot, the object and the forces."""

from __future__ import annotations

from collections.abc import Sequence
import math

from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.viewer.camera import place_camera
from isotruss_ros.viewer.meshes import color_of, prism, tube_faces, tube_vertices
from isotruss_ros.viewer.message_checks import DEFORMED, FORCES, REGIONS
from isotruss_ros.viewer.obstacle_drawing import ObstacleDrawing
from isotruss_ros.viewer.picture import Hold, Picture
import numpy as np
import viser

#: Number of cross sections of a tube [-].
TUBE_SECTIONS = 28
#: Colours of the object by its hold.
COLORS = {
    Hold.HELD: (51, 179, 77),
    Hold.NOT_HELD: (217, 51, 51),
    Hold.FREE: (178, 150, 204),
    Hold.UNKNOWN: (190, 190, 190),
}
MODULE, REGION, FORCE, MARK = (59, 59, 59), (242, 191, 26), (31, 79, 217), (20, 20, 20)
SUPPORT_COLOR, PATH_COLOR = (122, 82, 48), (200, 40, 140)
#: Spacing of points along curved outlines [m].
OUTLINE_SPACING = 0.01
#: Thickness of rods, contact regions and the planned path [m].
ROD, STRIPE, PATH = 0.03, 0.02, 0.012


class Scene:
    """Scene that shows a `Picture`; only changed parts are sent to browsers."""

    def __init__(self, server: viser.ViserServer, picture: Picture) -> None:
        scene = server.scene
        lines = member_lines(picture.config)
        points = picture.config.points
        camera = server.initial_camera
        camera.position, camera.look_at = place_camera(points, 1.1)
        camera.up = (0.0, 1.0, 0.0)
        self._server = server
        self._fitted: set = set()
        # Shadows dominate the load of browsers without a graphics card.
        scene.configure_default_lights(cast_shadow=False)
        scene.add_grid(
            '/grid',
            6.0,
            6.0,
            position=(*camera.look_at[:2], -0.3),
            cell_size=0.25,
            section_size=1.0,
        )
        self._diameter = picture.robot.description.tube_diameter
        faces = tube_faces(TUBE_SECTIONS)
        self._tubes = [
            scene.add_mesh_simple(
                f'/tubes/{name}', self._vertices(line), faces, color=color_of(0.0), side='double'
            )
            for name, line in zip(picture.robot.member_names, lines, strict=True)
        ]
        self._lines = lines
        self._modules = scene.add_line_segments(
            '/modules', _module_lines(picture), MODULE, thickness=ROD
        )
        self._supports = [
            (picture.robot.node_names.index(joint), self._add_support(scene, joint, axes))
            for joint, axes in picture.robot.description.supports.items()
        ]
        nothing = np.zeros((1, 2, 3), dtype=np.float32)
        self._regions = scene.add_line_segments(
            '/contact_regions', nothing, REGION, thickness=STRIPE, visible=False
        )
        self._forces = scene.add_arrows(
            '/contact_forces',
            nothing,
            FORCE,
            shaft_radius=0.006,
            head_radius=0.016,
            head_length=0.04,
            visible=False,
        )
        self._path = scene.add_line_segments(
            '/planned_path', nothing, PATH_COLOR, thickness=PATH, visible=False
        )
        middle = complex(*camera.look_at[:2])
        self._obstacles = ObstacleDrawing(scene, self._diameter, middle)
        self._scene = scene
        #: Diameter and shape of the drawn object.
        self._drawn: tuple[float, Shape | None] | None = None
        self._frame: viser.FrameHandle
        self._make_object(picture)

    def update(self, picture: Picture, now: float) -> None:
        """Draw the current state of a picture."""
        self._fit_cameras(picture)
        if (picture.diameter, picture.shape) != self._drawn:
            self._make_object(picture)
        self._move_tubes(picture, now)
        if self._has_changed('config', picture.config.roller_positions.tobytes()):
            self._modules.points = _module_lines(picture)
            for node, support in self._supports:
                support.position = (*picture.config.nodes[node], 0.0)
        hold = picture.hold(now)
        if self._has_changed('hold', hold):
            self._object.color = COLORS[hold]
        if self._has_changed('pose', picture.pose) and picture.pose is not None:
            x, y, angle = picture.pose
            self._frame.position = (x, y, 0.0)
            self._frame.wxyz = (math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle))
            self._frame.visible = True
        top = 0.5 * self._diameter + 0.02
        # From above, a region with two triangles per step reduces to a line.
        regions = [points.reshape(-1, 6, 3) for points in picture.select_lines(REGIONS, now)]
        pieces = [points[:, [0, 2]] for points in regions if len(points)]
        self._show_lines(self._regions, pieces, top)
        forces = [line[None] for line in picture.select_lines(FORCES, now) if len(line) == 2]
        self._show_lines(self._forces, forces, top)
        path, room = [], picture.room
        if room.path is not None:
            points = np.column_stack([room.path, np.zeros(len(room.path))])
            path = [np.stack([points[:-1], points[1:]], axis=1)]
        self._show_lines(self._path, path, top)
        self._obstacles.update(room, now)

    def _fit_cameras(self, picture: Picture) -> None:
        """Show the whole robot on an upright screen after the page has set its initial camera."""
        clients = self._server.get_clients()
        self._fitted &= clients.keys()
        for number, client in clients.items():
            camera = client.camera
            begins = np.allclose(camera.position, self._server.initial_camera.position, atol=0.01)
            if number not in self._fitted and begins:
                self._fitted.add(number)
                if 0 < camera.image_width < camera.image_height:
                    points = picture.config.points
                    camera.position, camera.look_at = place_camera(points, camera.aspect)

    def _add_support(
        self, scene: viser.SceneApi, joint: str, axes: Sequence[str]
    ) -> viser.SceneNodeHandle:
        """Add and return a box at a fixed joint, or a ball at a sliding joint."""
        name, size = f'/supports/{joint}', 0.6 * self._diameter
        if len(axes) == 2:
            return scene.add_box(name, SUPPORT_COLOR, (2.0 * size,) * 3)
        return scene.add_icosphere(name, size, SUPPORT_COLOR)

    def _vertices(self, line: Points) -> Array:
        return tube_vertices(line, self._diameter, TUBE_SECTIONS).astype(np.float32)

    def _has_changed(self, name: str, value: object) -> bool:
        changed = name not in self._shown or self._shown[name] != value
        self._shown[name] = value
        return changed

    def _make_object(self, picture: Picture) -> None:
        diameter, shape = picture.diameter, picture.shape
        # A mark shows the orientation of the object.
        length = 0.45 * diameter
        if shape is not None:
            vertices, faces = prism(shape.outline(OUTLINE_SPACING), self._diameter)
            length = 0.9 * float(shape.support_points(np.array([1.0 + 0.0j]))[0].real)
        mark = np.array([[[0.0, 0.0, 0.0], [length, 0.0, 0.0]]], dtype=np.float32)
        mark[..., 2] = 0.5 * self._diameter + 0.005
        if self._drawn is not None:
            self._frame.remove()
        self._drawn = diameter, shape
        self._shown: dict[str, object] = {}
        self._frame = self._scene.add_frame('/object', show_axes=False, visible=False)
        color = COLORS[Hold.UNKNOWN]
        if shape is None:
            self._object = self._scene.add_cylinder(
                '/object/body', 0.5 * diameter, self._diameter, color=color
            )
        else:
            self._object = self._scene.add_mesh_simple(
                '/object/body', vertices.astype(np.float32), faces, color=color, side='double'
            )
        self._scene.add_line_segments('/object/mark', mark, MARK, thickness=0.012)

    def _move_tubes(self, picture: Picture, now: float) -> None:
        bent = picture.select_lines(DEFORMED, now)
        if len(bent) == len(self._tubes):
            lines = [points[:, 0] + 1j * points[:, 1] for points in bent]
        else:
            lines = list(member_lines(picture.config))
        used = np.zeros(len(self._tubes))
        known = picture.is_analyzed(now) and picture.state.utilisation is not None
        if known and len(picture.state.utilisation):  # empty without an equilibrium
            used = np.array(picture.state.utilisation)
        for i, (tube, line) in enumerate(zip(self._tubes, lines, strict=True)):
            if not np.array_equal(line, self._lines[i]):
                tube.vertices = self._vertices(line)
            if self._has_changed(f'color {i}', color_of(used[i])):
                tube.color = color_of(used[i])
        self._lines = lines

    def _show_lines(
        self,
        handle: viser.LineSegmentsHandle | viser.ArrowHandle,
        pieces: list[Array],
        height: float,
    ) -> None:
        shown = bool(pieces)
        if self._has_changed(f'{handle.name} shown', shown):
            handle.visible = shown
        if not shown:
            return
        points = np.concatenate(pieces).astype(np.float32)
        points[..., 2] = height
        if self._has_changed(handle.name, points.tobytes()):
            handle.points = points


def _module_lines(picture: Picture) -> Array:
    """Return the lines (2 n, 2, 3) of the rods and of the bars between pinch points."""
    topology, points = picture.robot.topology, picture.config.points
    joint, b, c = points[topology.joint], points[topology.b], points[topology.c]
    ends = np.concatenate([np.stack([0.5 * (b + c), joint], 1), np.stack([b, c], 1)])
    return np.stack([ends.real, ends.imag, np.zeros(ends.shape)], axis=-1).astype(np.float32)
