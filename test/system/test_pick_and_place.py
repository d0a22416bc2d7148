# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pick, move and place with all nodes as processes: the object is where it should be, at rest."""

from pathlib import Path
import re
import signal
import subprocess
import sys
import time

from action_msgs.msg import GoalStatus
from isotruss_msgs.action import MoveObject, PickObject, PlaceObject
from isotruss_ros.nodes.conversions.messages import read_stamp
import numpy as np
from picking import ANSWERS, APART, CENTER, Client, DIAMETER, path_to, PATIENT, PICK, READY
import pytest
from robot_processes import robot

pytestmark = [pytest.mark.system, pytest.mark.xdist_group('pick and place')]

#: Whether or not the middleware has noticed that the node was gone for a while.
ENDED = re.compile('has lost the goal|no node offers the action|has sent no feedback for')


@pytest.fixture(scope='module')
def shared(shared_domain, tmp_path_factory):
    with robot(tmp_path_factory.mktemp('nodes')) as r:
        yield Client(r)


@pytest.fixture
def client(shared, request):
    """Return a client of all nodes, which run; none of them outlives a test that fails."""
    shared.complete()
    failures = request.session.testsfailed
    yield shared
    if request.session.testsfailed > failures:
        shared.r.kill()


@pytest.mark.nightly
def test_a_cancel_ends_the_goal_where_a_node_under_it_hangs(client):
    client.let_go()
    handle = client.until_searching()
    client.r.signal('grasp_planner', signal.SIGSTOP)
    handle.cancel_goal_async()
    status, result = client.end(handle)
    assert (status, result.code) == (GoalStatus.STATUS_CANCELED, PickObject.Result.CANCELLED)
    client.r.signal('grasp_planner', signal.SIGCONT)
    assert client.execute(PICK)[1].code == 0


@pytest.mark.nightly
def test_a_motion_ends_where_a_node_under_it_is_killed_and_started_again(client):
    handle, moving = client.until_moving(0.005)
    client.restart('path_follower')
    status, result = client.end(handle)
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, MoveObject.Result.STOPPED)
    assert ENDED.search(result.message)
    assert 0.01 < result.position_error < 0.05
    assert read_stamp(result) > read_stamp(result.object_pose.header) > 0.0
    client.r.check_rests()
    assert client.execute(moving)[1].code == 0


@pytest.mark.nightly
@pytest.mark.parametrize('name', ['manipulation', 'path_follower'])
def test_a_motion_ends_one_timeout_after_a_node_under_it_is_killed(client, name):
    handle, _ = client.until_moving(0.005)
    client.r.signal(name, signal.SIGKILL)
    killed = time.monotonic()
    status, result = client.end(handle)
    took = time.monotonic() - killed
    client.start(name)
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, MoveObject.Result.STOPPED)
    # Less than half of `progress_timeout`, which is for a robot that does not move.
    assert took < PATIENT['command_timeout'] + 1.5
    client.r.check_rests()
    assert client.execute(READY)[1].code in ANSWERS


def operate(words):
    """Call an action from a terminal; return the exit code and what is printed."""
    command = [sys.executable, '-m', 'isotruss_ros.cli.operate', *words.split()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    return done.returncode, done.stdout


def test_an_object_is_picked_up_moved_and_placed(client):
    client.let_go()
    lay = client.place()
    code, printed = operate('pick --squeeze 15')
    words = r'pick_object: held at north/\w, squeeze (\S+) N, deviation (\S+) N'
    ((squeeze, deviation),) = re.findall(words, printed)
    # Commands that come late on a busy machine close the grip unevenly, and push the object.
    assert (code, 5.0 < float(squeeze) < 25.0) == (0, True)
    assert 0.0 < float(deviation) < 0.5 * float(squeeze)
    assert 'first place the object' in client.end(client.begin(PICK))[1].message
    assert np.hypot(*(client.place() - lay)) < DIAMETER / 4
    goal = np.array([0.6, 0.35])
    assert operate('move 0.6 0.35 --angle 3')[0] == 0
    # Commands that come late, zeros among them, take it beyond the tolerance of the goal.
    assert np.hypot(*(client.place() - goal)) < 2e-2
    client.r.check_rests()
    held = client.place()
    _, refused = client.execute(PlaceObject.Goal(max_rotation=1e-9))
    assert refused.code == refused.NO_MOTION_FOUND
    assert 'turns the object by' in refused.message
    status, result = client.execute(APART)
    assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.message
    assert max(result.displacement, np.hypot(*(client.place() - held))) < 1e-2
    assert result.object_pose.pose.position.x == pytest.approx(client.place()[0], abs=1e-6)
    refused = client.end(client.begin(MoveObject.Goal(path=path_to(*CENTER))))[1]
    assert refused.code == MoveObject.Result.NOT_HELD
    assert operate('place')[0] == 1


@pytest.mark.nightly
def test_the_example_picks_an_object_up_and_places_it(client):
    client.let_go()
    example = Path(__file__).parents[2] / 'examples' / 'ros_pick_and_place.py'
    done = subprocess.run(
        [sys.executable, example], capture_output=True, text=True, timeout=300, check=True
    )
    assert 'pick_object: held at' in done.stdout
    assert 'place_object: the object is free' in done.stdout


@pytest.mark.nightly
def test_a_motion_ends_with_a_pick_and_place_that_is_killed(client):
    r = client.r
    client.until_moving(0.002)
    r.signal('pick_and_place', signal.SIGKILL)
    r.w.until(lambda: 'supervises the goal' in r.w.report('path_follower').message)
    r.check_rests()
