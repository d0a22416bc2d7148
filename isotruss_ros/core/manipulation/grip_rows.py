"""
The one constraint of a grip: J_h(q) qdot = G^T nu (Murray, Li and Sastry).

At every contact the tube's material moves as the object's surface does: contacts roll. For a
cylinder between the two members of one module the rows are those of (14) to (18).

The tube does not stretch, so that the material of a straight member moves as a rigid body: with
the member's ends, and along it with the roller at which the member starts. The roller at its end
moves it just as much, (12): past the passive module of the tube it is the one that turns.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_contacts import (
    find_contacts,
    find_touches,
    GripContacts,
    Touches,
)
from isotruss_ros.core.model.objects import MIN_DIAMETER
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np
from scipy.linalg import lapack

ONE_POINT = 'the members touch the object in one point: it cannot be held there'


def hand_jacobian(config: Configuration, contacts: GripContacts) -> Array:
    """
    Return J_h: the velocity of the tubes' material at the contacts.

    :param config: configuration of the robot.
    :param contacts: of the grip.
    :return: (2 k, r) vx, vy of contact after contact in the robot frame, for 1 m/s at each
        roller [-].
    :raises ConfigurationError: the configuration is singular.
    """
    nodes = contacts.nodes
    # Turning rate of a member: Re(conj(turn) (velocity of its end - velocity of its start)). It
    # moves a point as i times its arm does, from the start on.
    arms = contacts.points - config.points.take(nodes.starts)
    entries: list[complex] = []
    for arm, span in zip(arms.tolist(), contacts.spans.tolist(), strict=True):
        turn = 1j / span.conjugate()
        x, y = arm.imag * turn, arm.real * turn
        entries += (1.0 + x, 1j - y, -x, y)  # vx, vy by the start, then by the end
    count = 2 * len(arms)
    rows = np.zeros(count * len(config.points), dtype=np.complex128)
    rows[nodes.places] = entries
    velocities = config.roller_rows(rows.view(np.float64).reshape(count, -1))
    velocities.reshape(-1)[nodes.rolled] += contacts.axes.view(np.float64).take(nodes.driven)
    return velocities


def grasp_map(center: complex, contacts: GripContacts) -> Array:
    """
    Return G^T: the velocity of the object's surface at the contacts.

    :param center: of the object, to which the twist belongs, x + iy [m].
    :param contacts: of the grip.
    :return: (2 k, 3) vx, vy of contact after contact in the robot frame, for a twist vx, vy
        [m/s], omega [rad/s].
    """
    arms = (contacts.points - center).tolist()
    return np.array([row for arm in arms for row in ((1.0, 0.0, -arm.imag), (0.0, 1.0, arm.real))])


class ContactRows(NamedTuple):
    """
    Both sides of the constraint of a grip.

    :ivar contacts: the k contacts.
    :ivar hand: (2 k, r) J_h, see `hand_jacobian`.
    :ivar rigid: (2 k, 3) G^T, see `grasp_map`.
    """

    contacts: GripContacts
    hand: Array
    rigid: Array


def contact_rows(config: Configuration, grip: Grip) -> ContactRows:
    """
    Return both sides of the constraint.

    :param config: configuration of the robot.
    :param grip: the grip.
    :raises GraspError: see `find_contacts`.
    :raises ConfigurationError: the configuration is singular.
    """
    return _contact_rows(config, grip, find_contacts(config, grip))


def _contact_rows(config: Configuration, grip: Grip, contacts: GripContacts) -> ContactRows:
    hand = hand_jacobian(config, contacts)
    return ContactRows(contacts, hand, grasp_map(grip.center, contacts))


def motion_rows(rows: ContactRows, kept: Indices | None = None) -> Array:
    """
    Return the map from roller speeds to the motion of an object that keeps contacts.

    The first three rows solve J_h(q) qdot = G^T nu for the twist, the others are what is left of
    it: a motion keeps the contacts where they are zero.

    :param rows: of all contacts.
    :param kept: (k,) numbers of the contacts that are kept, all if None.
    :return: (2 k, r) for 1 m/s at each roller, robot frame: rows vx, vy [m/s] and omega [rad/s]
        of the object, then 2 k - 3 rows [m/s]; the first of these is the rate of the distance
        between two members, or twice that with which each of three moves away from the object.
    :raises GraspError: the contacts are all in one point.
    """
    contacts, hand, rigid = rows
    points, owners, normals = contacts.points, contacts.owners, contacts.normals
    if kept is not None:
        points, owners, normals = points[kept], owners[kept], normals[kept]
        both = (2 * kept[:, None] + (0, 1)).ravel()
        hand, rigid = hand[both], rigid[both]
    if len(points) == 2:
        return _two_points(points.tolist(), rigid).dot(hand)
    square = np.concatenate([rigid, _misfits(rigid, points, owners, normals)], axis=1)
    return np.asarray(lapack.dgesv(square, hand)[2])


class GripRows(NamedTuple):
    """
    What roller speeds do to an object that keeps all its contacts; not to be written to.

    :ivar jacobian: (2 k, r) of k contacts, see `motion_rows`.
    :ivar rows: both sides of the constraint; None of two contacts, whose rows are solved by hand.
    """

    jacobian: Array
    rows: ContactRows | None


@functools.lru_cache(maxsize=8)
def grip_rows(config: Configuration, grip: Grip) -> GripRows:
    """
    Return the map from roller speeds to the motion of an object; the last few are kept.

    :param config: configuration of the robot.
    :param grip: the grip.
    :raises GraspError: see `find_contacts`; or the contacts are all in one point.
    :raises ConfigurationError: the configuration is singular.
    """
    touches, rows = find_touches(config, grip), None
    if len(touches.points) == 2:
        jacobian = _pair_jacobian(config, grip.center, touches)
    else:
        rows = _contact_rows(config, grip, touches.contacts())
        jacobian = motion_rows(rows)
    jacobian.flags.writeable = False
    return GripRows(jacobian, rows)


def grip_jacobian(config: Configuration, grip: Grip) -> Array:
    """
    Return the map from roller speeds to the motion of an object that keeps all its contacts.

    :param config: configuration of the robot.
    :param grip: the grip.
    :return: (2 k, r) of k contacts, see `motion_rows`; not to be written to.
    :raises GraspError: see `find_contacts`; or the contacts are all in one point.
    :raises ConfigurationError: the configuration is singular.
    """
    return grip_rows(config, grip).jacobian


def _pair_jacobian(config: Configuration, center: complex, touches: Touches) -> Array:
    """
    Return `motion_rows` of two contacts, (4, r): those of `_two_points` before (12) is solved.

    A gradient h stands for the row Re(conj(h) v) on the velocity v of a contact.

    :raises GraspError: the contacts are in one point.
    """
    one, other = touches.points
    apart = other - one
    distance = abs(apart)
    if distance < MIN_DIAMETER:
        raise GraspError(ONE_POINT)
    along = apart / distance
    # conj(along) (v2 - v1) = opening + i omega distance; omega moves the middle of both as i arm.
    around, arm = 1j * along / distance, center - 0.5 * (one + other)
    entries: list[complex] = []
    rolls: list[float] = []
    _, starts, spans, axes, points, *_ = touches
    for sign, start, span, axis, point in zip(
        (-1.0, 1.0), starts, spans, axes, points, strict=True
    ):
        # The material moves with the member's start, with its turning and along it.
        lever, turn, back = (point - start).conjugate(), 1j / span.conjugate(), axis.conjugate()
        by_omega, by_opening = sign * around, sign * along
        x, y = arm.imag * by_omega, arm.real * by_omega
        turned, opened = (by_omega * lever).imag, (by_opening * lever).imag
        end_x = (0.5 * lever.imag - arm.imag * turned) * turn
        end_y = (0.5 * lever.real + arm.real * turned) * turn
        end_omega, end_opening = turned * turn, opened * turn
        entries += (0.5 - x - end_x, end_x, 0.5j + y - end_y, end_y)
        entries += (by_omega - end_omega, end_omega, by_opening - end_opening, end_opening)
        rolled, opens = (by_omega * back).real, (by_opening * back).real
        rolls += (
            0.5 * axis.real - arm.imag * rolled,
            0.5 * axis.imag + arm.real * rolled,
            rolled,
            opens,
        )
    nodes, count = touches.nodes, len(config.points)
    rows = np.zeros(4 * count, dtype=np.complex128)
    rows[nodes.motion_places] = entries
    jacobian = config.roller_rows(rows.view(np.float64).reshape(4, -1))
    jacobian.reshape(-1)[nodes.motion_rolled] += np.array(rolls).take(nodes.motion_driven)
    return jacobian


def _two_points(points: list[complex], rigid: Array) -> Array:
    """
    Return the rates of the object and of the distance by the velocities of two contacts, (4, 4).

    With D from one to the other and e = D/|D|, conj(e) (v2 - v1) = opening + i omega |D|.

    :raises GraspError: the contacts are in one point.
    """
    apart = points[1] - points[0]
    distance = abs(apart)
    if distance < MIN_DIAMETER:
        raise GraspError(ONE_POINT)
    x, y = apart.real / distance, apart.imag / distance
    wx, wy = x / distance, y / distance
    # The middle of both, seen from the object's origin; omega moves it as i times this arm.
    up = 0.5 * (rigid.item(0, 2) + rigid.item(2, 2))
    right = 0.5 * (rigid.item(1, 2) + rigid.item(3, 2))
    return np.array(
        [
            [0.5 - up * wy, up * wx, 0.5 + up * wy, -up * wx],
            [-right * wy, 0.5 + right * wx, right * wy, 0.5 - right * wx],
            [wy, -wx, -wy, wx],
            [-x, -y, x, y],
        ]
    )


def _misfits(rigid: Array, points: Points, owners: Indices, normals: Points) -> Array:
    """
    Return what no twist does to the contacts: (2 k, 2 k - 3), at right angles to G^T.

    With two members the first is that these move apart by 1 m/s, with three that each moves away
    from the object by half of that, without the part of it that would carry the object along.

    :raises GraspError: the contacts are all in one point.
    """
    places, count = points.tolist(), len(points)
    if max(abs(place - places[0]) for place in places) < MIN_DIAMETER:
        raise GraspError(ONE_POINT)
    if owners[-1] > 1:
        opening = 0.5 * normals
    else:
        first = int(owners.searchsorted(1))
        apart = sum(places[first:]) / (count - first) - sum(places[:first]) / first
        half = 0.5 * apart / abs(apart)
        opening = np.array([-half] * first + [half] * (count - first))
    # QR factorization, all columns of the first factor.
    tall = np.zeros((len(rigid), len(rigid)), order='F')
    tall[:, :3], tall[:, 3] = rigid, opening.view(float)
    factored, scales, _, _ = lapack.dgeqrf(tall[:, :4])
    size = factored[3, 3]
    tall[:, :4] = factored
    basis = lapack.dorgqr(tall, scales)[0]
    basis[:, 3] *= size
    return basis[:, 3:]
