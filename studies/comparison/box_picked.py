# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A free box in MuJoCo that two sides grasp, carry, rotate and release."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    Grip,
    place_between,
    Polygon,
    Pose,
    Status,
)
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.demo.path import Phase, rotation, translation
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import ContactForce, MujocoPlant
from isotruss_ros.plotting.grasp_drawing import FORCE_COLOR
from isotruss_ros.plotting.robot_drawing import frame, MODULE_COLOR, OBJECT_COLOR, plot_robot
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon as Patch
import numpy as np
from pressed_plants import mesh, round_robot
from studies.comparison.carrying import Carried, carry, Feedback, Regulated
from studies.paper.style import PAGE, SETTINGS

#: Members of two tubes, between which is the hole of the robot.
SIDES = ('south/P-Q', 'north/R-P')
BOX = Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], 0.02)
#: Coefficient of friction between tubes and box [-], and angle of the box, which is in contact at
#: two corners [rad].
FRICTION, ANGLE = 0.9, -0.5
#: Initial gap between sides and box [m].
GAP = 0.02
#: Speed of closing and opening [m/s].
CLOSING = 0.02
#: Length of force arrows in the drawing [m/N].
SCALE = 0.025
#: Margin of the drawing around the nodes [m].
MARGIN = 0.3
#: Friction force of the box on the ground [N].
GROUND = 0.5
#: Phases of the path: straight, a rotation in place by 17 degrees, and straight.
PHASES = (
    translation('along', 5.0, 0.08, 0.03),
    rotation('turn', 5.0, 0.3),
    translation('on', 5.0, 0.04, -0.04),
)


@dataclass(frozen=True)
class Stage:
    """State of the robot and the box at one time."""

    name: str  #: name of the stage
    config: Configuration  #: configuration of the robot
    pose: Pose  #: pose of the box
    forces: dict[str, ContactForce]  #: contact forces on the box by member


@dataclass(frozen=True)
class Picked:
    """
    Result of picking up the box.

    :ivar carried: result of the carry with squeeze control, from closing to opening.
    """

    stages: list[Stage] = field(default_factory=list)  #: stages in order
    carried: list[Carried] = field(default_factory=list)
    statuses: set[Status] = field(default_factory=set)  #: statuses of the commands of the carry

    def shift(self, name: str) -> float:
        """
        Return the displacement of the box in a stage [m].

        :param name: name of a stage, not the first.
        """
        number = [stage.name for stage in self.stages].index(name)
        before, after = self.stages[number - 1].pose, self.stages[number].pose
        return float(np.hypot(after.x - before.x, after.y - before.y))


def pick(phases: Sequence[Phase] = PHASES) -> Picked:
    """
    Grasp the box without moving it, carry it, and release it.

    :param phases: phases of the path.
    """
    robot = round_robot()
    lying = place_between(robot.home, SIDES, BOX, ANGLE, -GAP).body
    grip = Grip(SIDES, lying, FRICTION)
    options = PlantOptions(friction=FRICTION, ground_friction=GROUND)
    plant = MujocoPlant(robot, lying, options, mesh(robot, SIDES))
    plant.settle()
    picked = Picked()

    def note(name: str) -> None:
        config = robot.configuration(plant.travel)
        stage = Stage(name, config, plant.object_pose(), plant.contact_forces())
        picked.stages.append(stage)

    def move(rate: float, path: Sequence[Phase]) -> None:
        steering = Feedback(plant, robot.configuration(plant.travel), grip, rate)
        picked.carried.append(carry(steering, path))

    def transport(path: Sequence[Phase]) -> None:
        squeeze = float(np.mean([force.normal for force in plant.contact_forces().values()]))
        held = replace(grip, body=lying.moved_to(plant.object_pose()))
        regulated = Regulated(plant, robot, held, SqueezeSettings(squeeze))
        picked.carried.append(carry(regulated, path))
        picked.statuses.update(regulated.statuses)

    def wait(duration: float) -> tuple[Phase]:
        return (Phase('wait', duration, lambda _time: (0.0, 0.0, 0.0)),)

    note('lies free')
    # Both sides: as far to the box as into it.
    closing = 4.0 * GAP / CLOSING
    move(-CLOSING, wait(closing))
    move(0.0, wait(1.0))
    note('sides closed')
    transport(phases)
    note('carried and turned')
    move(CLOSING, wait(closing))
    plant.settle()
    note('put down')
    return picked


def draw(picked: Picked) -> Figure:
    """
    Draw the stages as panels.

    :param picked: result of picking the box.
    """
    with rc_context(SETTINGS):
        figure = Figure(figsize=(PAGE, 1.9), layout='constrained')
        nodes = np.concatenate([stage.config.nodes for stage in picked.stages])
        # As far as supports and joints reach beyond the nodes.
        low, high = nodes.min(axis=0) - MARGIN, nodes.max(axis=0) + MARGIN
        for axes, stage in zip(figure.subplots(1, len(picked.stages)), picked.stages, strict=True):
            plot_robot(stage.config, axes)
            _draw_box(axes, stage)
            frame(axes, low, high)
            axes.set(xlabel='', ylabel='', xticks=[], yticks=[], title=stage.name)
            axes.spines[:].set_visible(False)
    return figure


def _draw_box(axes: Axes, stage: Stage) -> None:
    outline = ConvexObject(BOX, stage.pose).outline(0.005)
    corners = np.column_stack([outline.real, outline.imag])
    axes.add_patch(Patch(corners, facecolor=OBJECT_COLOR, edgecolor=MODULE_COLOR, zorder=5))
    center, turn = complex(*stage.pose[:2]), np.exp(1j * stage.pose.angle)
    mark = center + turn * np.array([0.0, 0.2])
    axes.plot(mark.real, mark.imag, color=MODULE_COLOR, lw=1.0, zorder=6)
    topology, points = stage.config.robot.topology, stage.config.points
    for name, force in stage.forces.items():
        member = stage.config.robot.member_names.index(name)
        span = points[topology.c[topology.following[member]]] - points[topology.b[member]]
        inward = 1j * span / abs(span)
        if (inward.conjugate() * (center - force.point)).real < 0.0:
            inward = -inward
        tip = force.point
        tail = tip - SCALE * complex(force.normal, -force.friction) * inward
        axes.annotate(
            '',
            xy=(tip.real, tip.imag),
            xytext=(tail.real, tail.imag),
            arrowprops={'arrowstyle': '-|>', 'color': FORCE_COLOR, 'lw': 1.2},
            zorder=8,
        )
