# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pick up the object, move it up by 10 cm and place it: three goals.

First: `ros2 launch isotruss_ros simulation.launch.py object_is_free:=true
object_pose:="[0.6, 0.3, 0.0]" object_diameter:=0.2`, or the nodes of docs/nodes/pick_and_place.md.
"""

import sys

from isotruss_ros.extras import explained_imports

with explained_imports():
    from geometry_msgs.msg import PoseStamped
    from isotruss_msgs.action import MoveObject, PickObject, PlaceObject
    from nav_msgs.msg import Path
    import rclpy
    from rclpy.action import ActionClient

TIMEOUT = 20.0  # of the waits for a server and for its response [s]
DURATION = 300.0  # longest duration of a goal [s]
rclpy.init()
node = rclpy.create_node('ros_pick_and_place')
there = PoseStamped()
there.pose.position.x, there.pose.position.y, there.pose.orientation.w = 0.6, 0.4, 1.0  # [m]
for kind, name, goal in (
    (PickObject, 'pick_object', PickObject.Goal(squeeze=15.0)),  # [N]
    (MoveObject, 'move_object', MoveObject.Goal(path=Path(poses=[there]))),
    (PlaceObject, 'place_object', PlaceObject.Goal()),
):
    client = ActionClient(node, kind, name)
    if not client.wait_for_server(TIMEOUT):
        sys.exit(f'no node offers {name} in {TIMEOUT:g} s: does pick_and_place run?')
    sent = client.send_goal_async(goal)
    rclpy.spin_until_future_complete(node, sent, timeout_sec=TIMEOUT)
    if not (sent.done() and sent.result().accepted):
        sys.exit(f'{name} was not accepted in {TIMEOUT:g} s: is pick_and_place active?')
    ended = sent.result().get_result_async()
    rclpy.spin_until_future_complete(node, ended, timeout_sec=DURATION)
    if not ended.done():
        sent.result().cancel_goal_async()
        sys.exit(f'{name} has not ended in {DURATION:g} s')
    result = ended.result().result
    print(f'{name}: {result.message}')
    if result.code != kind.Result.SUCCEEDED:
        sys.exit(1)
node.destroy_node()
rclpy.shutdown()
