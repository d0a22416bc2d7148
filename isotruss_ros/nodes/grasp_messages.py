"""Grasps to messages, and what is asked about them back."""

from __future__ import annotations

from collections.abc import Sequence
import math

from geometry_msgs.msg import Point, Vector3, Wrench, WrenchStamped
from isotruss_msgs.msg import Contact, GraspState
from isotruss_msgs.srv import AnalyzeGrasp
from isotruss_ros.core import GraspAnalysis, GraspReport, Question
from isotruss_ros.nodes.messages import check_frame, MessageError, stamp, time_at
import numpy as np

#: No wrench is larger [N, N m]; what is beyond is a broken sensor, not a load.
MAX_WRENCH = 1e6


def planar_wrench(wrench: Wrench) -> tuple[float, float, float]:
    """Return (fx, fy, m) [N, N m]; what is out of the plane is carried by the ground."""
    return wrench.force.x, wrench.force.y, wrench.torque.z


def external_wrench(message: WrenchStamped, frame: str) -> tuple[float, float, float]:
    """
    Return the external wrench (fx, fy, m) on the object [N, N m].

    :raises MessageError: another frame, not finite, or larger than can be.
    """
    check_frame('external wrench', message.header, frame)
    wrench = planar_wrench(message.wrench)
    if not all(abs(component) <= MAX_WRENCH for component in wrench):
        raise MessageError(
            f'external wrench {wrench}: force.x, force.y and torque.z must be finite, '
            f'at most {MAX_WRENCH:g} N and N m'
        )
    return wrench


def wrench_message(wrench: Sequence[float]) -> Wrench:
    """Return (fx, fy, m) as a message."""
    fx, fy, m = map(float, wrench)
    return Wrench(force=Vector3(x=fx, y=fy), torque=Vector3(z=m))


def question(request: AnalyzeGrasp.Request, spacing: float) -> Question:
    """Return what a request asks; whether it can be answered is for the analysis to say."""
    return Question(
        tuple(request.roller_positions),
        (request.center.x, request.center.y),
        request.diameter,
        request.friction,
        planar_wrench(request.external_wrench),
        spacing,
    )


def state_message(report: GraspReport, frame: str) -> GraspState:
    """Return an answer as a message; numbers of no answer are as bad as they can be."""
    state = GraspState(code=int(report.code), message=report.message)
    stamp(state.header, time_at(report.time), frame)
    if report.grasp is None:
        state.closure_residual = state.required_friction = math.inf
        state.closure_margin = -math.inf
        return state
    analysis = report.grasp.analysis
    state.force_closure = report.force_closure
    state.closure_residual = analysis.closure_residual
    state.closure_tolerance = analysis.closure_tolerance
    state.required_friction = analysis.required_friction
    state.closure_margin = analysis.closure_margin
    state.normal_wrench = wrench_message(analysis.normal_wrench)
    state.contacts = contact_messages(analysis)
    state.contact_members = list(analysis.contact_lengths)
    state.contact_lengths = list(analysis.contact_lengths.values())
    state.stiffness = analysis.stiffness.ravel()
    state.computing_time = report.grasp.computing_time
    return state


def contact_messages(analysis: GraspAnalysis) -> list[Contact]:
    """Return the points that touch."""
    touching = np.flatnonzero(analysis.normal_forces > 0.0)
    return [
        Contact(
            position=Point(x=x, y=y),
            normal=Vector3(x=nx, y=ny),
            normal_force=normal,
            friction_force=friction,
            gap=gap,
        )
        for (x, y), (nx, ny), normal, friction, gap in zip(
            analysis.points[touching].tolist(),
            analysis.normals[touching].tolist(),
            analysis.normal_forces[touching].tolist(),
            analysis.friction_forces[touching].tolist(),
            analysis.gaps[touching].tolist(),
            strict=True,
        )
    ]
