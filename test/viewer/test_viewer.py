# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The live view without a browser: meshes, drags, control, texts and camera."""

import math
from types import SimpleNamespace
from unittest.mock import MagicMock, Mock

from geometry_msgs.msg import Point
from isotruss_msgs.msg import GraspState, ManipulationStatus
from isotruss_ros.core import (
    ConvexObject,
    load_robot,
    Obstacle,
    Polygon,
    Pose,
    Status,
    tangent_center,
)
from isotruss_ros.nodes.conversions.grasp_messages import to_state_message
from isotruss_ros.nodes.grasp.grasp_monitor import GraspMonitor, GraspQuery, LatestInputs
from isotruss_ros.viewer.camera import FIELD_OF_VIEW, PANEL_SHARE, PHONE_ASPECT, place_camera
from isotruss_ros.viewer.control import Control
from isotruss_ros.viewer.drag import (
    ARRIVAL_DISTANCE,
    Drag,
    LEVER_LENGTH,
    MIN_PROGRESS_RATIO,
    place_on_circle,
    PROGRESS_TIME,
)
from isotruss_ros.viewer.meshes import prism
from isotruss_ros.viewer.picture import Hold, MESSAGE_TIMEOUT, Picture
import numpy as np
import pytest
from visualization_msgs.msg import Marker, MarkerArray

ROBOT = load_robot('nine_member')
DURATION, STEP = 10.0, 0.05


@pytest.fixture
def panels():
    return pytest.importorskip('isotruss_ros.viewer.panels')


@pytest.fixture
def picture():
    return Picture(ROBOT, 0.3)


def test_a_prism_is_closed_and_shows_its_faces_outward():
    outline = Polygon([(-0.2, -0.1), (0.3, -0.1), (0.3, 0.1), (-0.2, 0.1)], 0.05).outline(0.01)
    vertices, faces = prism(outline, 0.2)
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}
    a, b, c = vertices[faces].transpose(1, 0, 2)
    # Six times the volume, by the divergence theorem.
    volume = (a * np.cross(b, c)).sum() / 6.0
    assert volume == pytest.approx(0.2 * (0.5 * 0.2 - (4.0 - np.pi) * 0.05**2), rel=1e-2)


def test_a_drag_is_straight_and_within_the_speed_limit():
    x, y = 0.0, 0.0
    drag = Drag((0.3, 0.4), 0.0)
    for _ in range(2000):
        vx, vy = drag.follow((x, y), 0.05, 0.0)
        assert math.hypot(vx, vy) <= 0.05 + 1e-12
        assert 0.4 * vx == pytest.approx(0.3 * vy)
        x, y = x + 0.01 * vx, y + 0.01 * vy
    assert math.dist((x, y), (0.3, 0.4)) <= ARRIVAL_DISTANCE
    assert (vx, vy) == (0.0, 0.0)


@pytest.mark.parametrize(('ratio', 'end'), [(0.5, PROGRESS_TIME), (2.0, DURATION)])
def test_a_drag_is_stuck_after_the_timeout_only_with_little_progress(ratio, end):
    drag, x, y, now = Drag((3.0, 4.0), 0.0), 0.0, 0.0, 0.0
    while now < DURATION and not drag.is_stuck(now):
        vx, vy = drag.follow((x, y), 0.05, now)
        way = ratio * MIN_PROGRESS_RATIO * STEP
        x, y, now = x + way * vx, y + way * vy, now + STEP
    assert now == pytest.approx(end, abs=STEP + 0.01)


@pytest.mark.parametrize(
    ('time', 'is_stuck'), [(0.9 * PROGRESS_TIME, False), (PROGRESS_TIME, True), (-495.0, True)]
)
def test_a_drag_without_pose_is_stuck_after_the_timeout_or_a_jump_of_the_clock(time, is_stuck):
    assert Drag((1.0, 0.0), 500.0).is_stuck(500.0 + time) == is_stuck


@pytest.mark.parametrize(('begin', 'end'), [(0.0, 2.5), (3.0, -3.0), (-3.1, 3.1), (1.0, -1.0)])
def test_a_rotation_is_the_shorter_one_and_within_the_speed_limit(begin, end):
    angle, drag = begin, Drag(place_on_circle(end, place_on_circle(begin)[0]), 0.0)
    for _ in range(2000):
        position = place_on_circle(angle, drag.target[0])
        way, across = drag.follow(position, 0.05, 0.0)
        assert abs(way) <= 0.05 + 1e-12
        assert across == 0.0
        angle += STEP * way / LEVER_LENGTH
    left = math.remainder(angle - end, 2.0 * math.pi)
    assert left == pytest.approx(0.0, abs=ARRIVAL_DISTANCE / LEVER_LENGTH)
    assert abs(angle - begin) <= math.pi


def test_only_the_grabbed_handle_moves_the_target_until_the_drag_ends():
    control = Control(2)
    control.drag_to((1.0, 0.0), False, 0.0)
    assert control.drag is None
    control.drag_to((0.5, 0.0), True, 0.0, turns=True)
    control.drag_to((2.0, 2.0), False, 0.1)
    assert (control.drag.target, control.drag.turns) == ((0.5, 0.0), True)
    control.drag_to((2.0, 0.0), False, 1.0, turns=True)
    assert control.drag.target == (2.0, 0.0)


def test_stale_state_is_not_shown_as_held(picture):
    assert picture.hold(0.0) is Hold.UNKNOWN
    picture.receive_state(GraspState(code=0, held=True, utilisation=[0.1] * 9), 1.0)
    assert picture.hold(1.0) is Hold.HELD
    assert picture.hold(1.0 + MESSAGE_TIMEOUT) is Hold.UNKNOWN
    picture.receive_state(GraspState(code=21, held=False), 2.0)
    assert picture.hold(2.0) is Hold.UNKNOWN


@pytest.mark.parametrize(
    ('place', 'hold', 'words'),
    [
        ((0.0, 3.0), Hold.FREE, '<b>free</b>: the object touches nothing'),
        (tangent_center(ROBOT.home, 'north/Z', 0.295), Hold.NOT_HELD, '<b>not held</b>: '),
    ],
)
def test_an_object_without_contact_is_shown_as_free(panels, picture, place, hold, words):
    body = ConvexObject.disc(place, 0.3)
    query = GraspQuery((0.0,) * 6, body, 0.01, (0.0, 0.0, 0.0), 0.02)
    report = GraspMonitor(ROBOT, query, 1.0, LatestInputs()).analyze_request(query, 0.0)
    picture.receive_state(to_state_message(report, 'truss'), 0.0)
    assert picture.hold(0.0) is hold
    tell(picture, Status.HALT_NOT_HELD)
    shown = panels.describe_state(picture, 0.0)
    assert shown.partition('>')[2].startswith(words)
    assert ('to carry the object: press' in shown) == (hold is Hold.FREE)


def test_deleted_markers_of_the_analysis_are_not_drawn(picture):
    line = [Point(), Point(x=1.0)]
    shown = [Marker(ns='deformed', id=number, points=line) for number in range(3)]
    one, all_of_them = Marker(ns='deformed', action=Marker.DELETE), Marker(action=Marker.DELETEALL)
    for markers, left in ((shown, 3), ([one], 2), ([all_of_them], 0)):
        picture.receive_markers(MarkerArray(markers=markers), 0.0)
        assert len(picture.select_lines('deformed', 0.0)) == left


def tell(picture, code, now=0.0, **values):
    picture.receive_status(ManipulationStatus(code=code, squeeze=math.nan, **values), now)


@pytest.mark.parametrize(
    ('goal', 'words'),
    [(None, 'at rest, nothing is commanded'), ((1.0, 0.0), 'halt no twist: twist: 0.3 s old')],
)
def test_a_missing_twist_is_a_halt_only_during_a_drag(picture, goal, words):
    picture.goal = goal
    tell(picture, Status.HALT_NO_TWIST, message='twist: 0.3 s old')
    assert picture.describe_manipulation(0.0) == f'manipulation: {words}'


def test_a_hindrance_is_the_slowest_status_of_the_most_frequent_limit_in_the_interval(picture):
    for now, code, scale in (
        *((0.0, Status.SLOWED_OBJECT, 0.1), (0.1, Status.SLOWED_OBJECT, 0.1)),
        *((0.2, Status.SLOWED_OBJECT, 0.1), (4.0, Status.SLOWED_RIGIDITY, 0.05)),
        *((4.1, Status.SLOWED_MEMBER_LENGTH, 0.3), (4.2, Status.SLOWED_MEMBER_LENGTH, 0.2)),
        *((4.3, Status.SLOWED_MEMBER_LENGTH, 0.4), (4.4, Status.OK, 1.0)),
    ):
        tell(picture, code, now, scale=scale, message=f'scale {scale}')
    expected = 'manipulation: slowed member length: scale 0.2'
    assert picture.describe_hindrance(5.0, 2.0) == expected


def test_plots_have_the_mean_squeeze_and_the_error_in_millimetres(panels, picture):
    plots, gui = {}, Mock()
    gui.add_uplot = lambda *_, title, **__: plots.setdefault(title, SimpleNamespace())
    gui.add_folder = MagicMock()
    shown = panels.Panels(SimpleNamespace(gui=gui))
    picture.goal = (0.503, 0.2)
    picture.take_pose(Pose(0.5, 0.204, 0.5), 0.0)
    picture.receive_state(GraspState(squeeze=[10.0, 20.0]), 0.0)
    for number in range(panels.PLOT_INTERVAL):
        shown.update(picture, 0.1 * number)
    assert all(plot.data[0] == pytest.approx(np.arange(-0.4, 0.1, 0.1)) for plot in plots.values())
    last = {title: plot.data[1][-1] for title, plot in plots.items()}
    assert last == {'squeeze [N]': 15.0, 'pose error [mm]': pytest.approx(5.0)}
    assert 'object at (0.500, 0.204) m, 28.6°' in panels.describe(picture, 0.0)


def test_texts_of_other_nodes_are_not_rendered_as_markup(panels, picture):
    picture.goal_report = '<img src=x onerror=alert(1)> [a](b) *c*'
    shown = panels.describe(picture, 0.0)
    assert r'\<img src\=x onerror\=alert\(1\)\> \[a\]\(b\) \*c\*' in shown


@pytest.mark.parametrize('status', [Status.HALT_NO_TWIST, Status.IDLE, Status.ARRIVED])
@pytest.mark.parametrize(
    ('offset', 'bend', 'overlaps'),
    [(0.07, 0.0, True), (0.2, 0.0, False), (0.2, 0.1, True), (0.07, -0.1, False)],
    ids=['within the straight tube', 'beside it', 'within the bent tube', 'beside that'],
)
def test_obstacle_in_a_tube_of_the_robot_at_rest_is_named(picture, offset, bend, overlaps, status):
    member, home = ROBOT.member_names.index('north/P-Z'), ROBOT.home
    start, axis = home.points[ROBOT.topology.b[member]], home.member_axes[member]
    place = start + (0.5 + 1j * offset) * axis
    body = ConvexObject.disc((place.real, place.imag), 0.1)
    picture.room.take_obstacles([Obstacle('cup', body, stamp=0.0)], 0.0)
    if bend:
        lines = home.points[ROBOT.topology.b, None] + (
            home.member_lengths[:, None] * np.linspace(0.0, 1.0, 9) * home.member_axes[:, None]
        )
        away = np.abs(lines[member] - start - 0.5 * axis)
        lines[member] += 1j * axis * bend * (away < 0.2)
        markers = [
            Marker(ns='deformed', id=k, points=[Point(x=z.real, y=z.imag) for z in line])
            for k, line in enumerate(lines)
        ]
        picture.receive_markers(MarkerArray(markers=markers), 0.0)
    tell(picture, status, message='')
    text = picture.describe_manipulation(0.0)
    assert ('member north/P-Z and obstacle cup overlap' in text) == overlaps


LATCHED = (
    Status.HALT_EMERGENCY_STOP,
    Status.HALT_SLIPPED,
    Status.HALT_NOT_HELD,
    Status.HALT_TRAJECTORY,
)


@pytest.mark.parametrize('chance', [0.93, math.nan])
@pytest.mark.parametrize('code', [Status.OK, *LATCHED])
def test_state_line_has_hold_chance_margin_squeeze_and_next_step(panels, picture, code, chance):
    state = GraspState(held=True, slip_margin=3.2, chance=chance, utilisation=[0.1] * 9)
    state.slip_direction = [0.0, 2.0, -1.0]
    picture.receive_state(state, 0.0)
    status = ManipulationStatus(code=code, squeeze=10.0, squeeze_deviation=1.0)
    picture.receive_status(status, 0.0)
    shown = panels.describe_state(picture, 0.0)
    known = '' if math.isnan(chance) else ' with a chance of 0.93'
    assert f'held</b>{known}, slip margin 3.2 N ↑' in shown
    assert 'squeeze 10.0 N' in shown
    assert ('<strong>' in shown) == (code in LATCHED)


@pytest.mark.parametrize('aspect', [0.46, 0.7, 1.0, 1.6, 2.4])
def test_the_whole_robot_is_on_the_screen_and_above_the_panel_of_a_phone(aspect):
    points = ROBOT.home.points
    position, target = (np.array(place) for place in place_camera(points, aspect))
    forward = (target - position) / np.linalg.norm(target - position)
    up = np.cross([1.0, 0.0, 0.0], forward)
    rays = np.column_stack([points.real, points.imag, np.zeros(len(points))]) - position
    depth = rays @ forward
    scale = math.tan(0.5 * FIELD_OF_VIEW)
    across, upward = rays[:, 0] / depth / (scale * aspect), (rays @ up) / depth / scale
    assert np.abs(across).max() < 1.0
    assert upward.max() < 1.0
    assert upward.min() > (-1.0 if aspect > PHONE_ASPECT else 2.0 * PANEL_SHARE - 1.0)
