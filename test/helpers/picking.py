# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A client of all nodes of a robot that picks, moves and places an object."""

import signal

from action_msgs.msg import GoalInfo
from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import MoveObject, PickObject, PlaceObject, PlanGrasp
from isotruss_msgs.msg import GraspState
from isotruss_ros.core import Pose
from isotruss_ros.nodes.conversions.messages import read_stamp, to_pose_message
from nav_msgs.msg import Path as PathMessage
import numpy as np
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.qos import QoSProfile
from robots import quick_robot

ACTIONS = {PickObject: 'pick_object', MoveObject: 'move_object', PlaceObject: 'place_object'}
CENTER, DIAMETER, FRICTION = (0.6, 0.3), 0.2, 0.5
#: An object that is at one of them, by an earlier test, is moved to the other.
DESTINATIONS = (0.58, 0.34), CENTER
#: A goal ends when inputs are late, and a busy machine delays them.
PATIENT = {'command_timeout': 4.0}
#: Rollers whose commands are late stop soon, and push no object away meanwhile.
STOPPING = {'command_timeout': 0.2}
#: With so much progress the node under the goal has begun.
BEGUN = 0.05
PICK = PickObject.Goal(squeeze=15.0, module='north/Z')
#: Takes some time to plan: any module, any squeeze.
SEARCHED = PickObject.Goal()
#: So far that a pick approaches for some time.
APART = PlaceObject.Goal(clearance=0.05)
#: Fails without a motion, as soon as all nodes have discovered each other.
READY = PickObject.Goal(squeeze=1e5, time_limit=0.2)
#: There is no such grasp; or a grip that was closing when its node was killed holds the object.
ANSWERS = {PickObject.Result.NO_MOTION_FOUND, PickObject.Result.BAD_GOAL}


class Client:
    """Sends goals to all nodes of a picking robot."""

    def __init__(self, r, pose=(*CENTER, 0.0), **described):
        self.r = r
        patient = PATIENT | {'robot': quick_robot()}
        shared = patient | {'object_diameter': DIAMETER, 'friction': FRICTION} | described
        lying = {'plant': 'elastic', 'object_is_free': True, 'object_pose': list(map(float, pose))}
        self._values = {
            'simulator': {'rate': 50.0, **shared, **STOPPING, **lying},
            'manipulation': {'rate': 50.0, **shared},
            'grasp_analysis': {'rate': 20.0, **shared},
            'path_follower': {'rate': 50.0, **shared},
            'grasp_planner': {**patient, **described},
            'pick_and_place': shared,
        }
        # Ten messages, as by default, are fewer than come while a busy machine holds this process.
        every = QoSProfile(depth=1000)
        self._clients = {
            kind: ActionClient(r.w.probe, kind, name, feedback_sub_qos_profile=every)
            for kind, name in ACTIONS.items()
        }
        self.feedback = []

    def start(self, name):
        self.r.start(name, **self._values[name])

    def restart(self, name):
        self.r.signal(name, signal.SIGKILL)
        self.start(name)

    def start_missing(self):
        """Start the nodes that do not run; return whether there were some."""
        missing = self._values.keys() - self.r.alive.keys()
        for name in missing:
            self.start(name)
        return bool(missing)

    def complete(self):
        """Start the nodes that do not run, and wait until all have discovered each other."""
        if self.start_missing():
            assert self.execute(READY)[1].code in ANSWERS

    def analysis(self):
        """Return a result of the grasp analysis whose inputs are later than this call."""
        now = self.r.w.probe.past(0.0)

        def arrived():
            state = self.r.w.probe.last('state')
            known = state is not None and state.held != GraspState.HELD_UNKNOWN
            return known and read_stamp(state.header) > now

        self.r.w.until(arrived)
        return self.r.w.probe.last('state')

    def hold(self):
        """Pick the object up, unless it is held by the analysis that `pick_and_place` has."""
        result = self.execute(PICK)[1]
        assert result.code == 0 or 'already held' in result.message, result.message

    def let_go(self):
        """Place the object if it is held; begin at home if members press on it otherwise."""
        state = self.analysis()
        if state.held == GraspState.HELD_YES:
            result = self.execute(APART)[1]
            assert result.code == 0, result.message
        elif len(state.grasping_members) > 1:
            self.restart('simulator')
            self.r.w.until(lambda: len(self.analysis().grasping_members) < 2)

    def begin(self, goal):
        """Send a goal; return its handle."""
        (kind,) = (kind for kind in ACTIONS if isinstance(goal, kind.Goal))
        client = self._clients[kind]
        self.r.w.until(client.server_is_ready)
        # A server that answers has discovered the client; a goal cannot be sent again, as it is
        # carried out even where its answer is lost.
        self.r.w.ask(ClientGoalHandle(client, GoalInfo().goal_id, None).get_result_async)
        self.feedback.clear()
        sent = client.send_goal_async(goal, lambda m: self.feedback.append(m.feedback))
        self.r.w.until(sent.done)
        return sent.result()

    def end(self, handle):
        found = self.r.w.ask(handle.get_result_async)
        return found.status, found.result

    def execute(self, goal):
        """Send a goal, return how it ends; again while nodes have not discovered each other."""
        status, result = self.end(self.begin(goal))
        for _ in range(30):
            started = 'none received yet' not in result.message
            if started and result.code != PickObject.Result.NOT_READY:
                break
            self.r.w.spin(0.5)
            status, result = self.end(self.begin(goal))
        return status, result

    def until_stage(self, goal, stage, progress=0.0):
        """Send a goal, and return its handle in a stage, with so much of it done."""
        handle = self.begin(goal)
        ended = handle.get_result_async()
        self.r.w.until(
            lambda: (
                ended.done()
                or any(m.stage == stage and m.progress >= progress for m in self.feedback)
            )
        )
        assert not ended.done(), ended.result().result.message
        return handle

    def until_moving(self, speed):
        """Send a goal to move the held object far enough; return its handle, and the goal."""
        self.hold()
        here = self.place()
        # It ends well as soon as a path follower that was started again has been discovered.
        staying = MoveObject.Goal(path=path_to(*here))
        self.r.w.until(lambda: self.execute(staying)[1].code == 0)
        far = max(DESTINATIONS, key=lambda there: np.hypot(*(here - there)))
        moving = MoveObject.Goal(path=path_to(*far), speed=speed)
        return self.until_stage(moving, MoveObject.Feedback.MOVING, progress=BEGUN), moving

    def until_searching(self):
        """Send a goal, and return its handle once the planner searches."""
        probe = self.r.w.probe
        probe.listen(PlanGrasp.Impl.FeedbackMessage, 'search', 'plan_grasp/_action/feedback')
        handle = self.begin(SEARCHED)
        self.r.w.until(lambda: probe.seen['search'])
        return handle

    def place(self):
        """Return where the object is, by a message that was sent after this call."""
        now = self.r.w.probe.past(0.0)

        def arrived():
            pose = self.r.w.probe.last('pose')
            return pose is not None and read_stamp(pose.header) > now

        self.r.w.until(arrived)
        position = self.r.w.probe.last('pose').pose.position
        return np.array([position.x, position.y])


def path_to(x, y):
    pose = PoseStamped(pose=to_pose_message(Pose(x, y, 0.0)))
    return PathMessage(poses=[pose])
