# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names shared by the view and the programs that show it, without drawing packages."""

from __future__ import annotations

#: Name of the object as a part that can be dragged, and requests to stop and to release the stop.
OBJECT, STOP, RELEASE = 'object', 'stop', 'release'
#: Requests to pick up and to place the object.
PICK, PLACE = 'pick', 'place'
#: Requests to select the dragged part, to translate it and to rotate it.
DRAGGED, TARGET, TURN = 'dragged', 'target', 'turn'
#: Requests to place an obstacle by the next click, to place it where it was clicked, to drag it,
#: and to clear all moving obstacles.
PLACING, PLACED, MOVED, CLEAR = 'add obstacle', 'placed', 'moved', 'clear obstacles'
#: Request to resume after the object has slipped.
RESUME = 'resume'
#: Request to reset the simulated robot.
RESET = 'reset'
#: Request to simulate the robot by another plant.
PLANT = 'plant'
KINEMATIC, ELASTIC, MUJOCO = PLANTS = ('kinematic', 'elastic', 'mujoco')
#: Request to replace the object by another object.
SHAPE = 'shape'
OBJECTS = {
    'disc': '',
    'box': '{shape: polygon, corner_radius: 0.03, '
    'vertices: [[-0.15, -0.12], [0.15, -0.12], [0.15, 0.12], [-0.15, 0.12]]}',
    'ellipse': '{shape: ellipse, semi_axes: [0.17, 0.13]}',
}
#: Address that only this machine can reach.
LOCAL = '127.0.0.1'
