# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rows of a grip of any members: against the paper's, and against simulated rolling."""

from dataclasses import replace

from hypothesis import assume, given, strategies
from isotruss_ros.core import Disc, Ellipse
from isotruss_ros.core.manipulation.grip_rows import contact_rows, grip_jacobian
from isotruss_ros.core.numerics.arrays import as_xy
import numpy as np
import pytest
import random_grips
import robots
from scipy.integrate import quad


def rolled_lengths(config, grip, pose, contacts):
    """
    Return what an object that rolls without slip on its members keeps, two numbers by contact [m].

    Its distance from the member; and where the material of the tube that it touches lies along
    the tube, less the arc of the object that has been unrolled on it.

    :param contacts: of the grip at the pose of its body: their members, sides, and points.
    """
    found = []
    center, turn = complex(*pose[:2]), np.exp(1j * pose[2])
    travel = dict(zip(config.robot.roller_names, config.roller_positions, strict=True))
    for owner, side, point in zip(contacts.owners, contacts.sides, contacts.points, strict=True):
        name = grip.members[owner]
        start, end = robots.member_ends(config, name)
        axis = (end - start) / abs(end - start)
        normal = -1j * side * axis
        offset, unrolled = unroll(grip, point, normal, turn)
        place = axis.conjugate() * (center + turn * offset - start)
        # What the roller at its start has moved into the member.
        material = place.real - travel.get(name.split('-')[0], 0.0)
        found += [side * place.imag, material - side * unrolled]
    return np.array(found)


def unroll(grip, point, normal, turn):
    """
    Return the point of contact in the object, where it began, and the arc from there.

    :param point: where the object is touched in its place in the grip.
    :param normal: out of the object now.
    :param turn: of the object now.
    """
    body = grip.body
    shape, began = body.shape, (point - body.center) / body.turn
    now = normal / turn
    if isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        direction = began.real / a**2 + 1j * began.imag / b**2
        before, turned = np.angle(direction), np.angle(now / direction)

        def radius(angle):
            return (a * b) ** 2 / np.hypot(a * np.cos(angle), b * np.sin(angle)) ** 3

        arc, _ = quad(radius, before, before + turned, epsabs=1e-14, epsrel=1e-12)
        return shape.support_points(np.array([now]))[0], arc
    if isinstance(shape, Disc):
        return 0.5 * shape.diameter * now, 0.5 * shape.diameter * np.angle(now / began)
    distance = np.abs(np.abs(began - shape.arc_centers) - shape.radii)
    inner = np.where(distance < 1e-9, np.abs(began - shape.corners), np.inf)
    corner = int(inner.argmin())
    center, radius = shape.arc_centers[corner], shape.radii[corner]
    arc = radius * np.angle(now * radius / (began - center)) if radius > 0.0 else 0.0
    return center + radius * now, arc


#: Central differences of fourth order.
STENCIL = ((-2.0, 1.0 / 12.0), (-1.0, -8.0 / 12.0), (1.0, 8.0 / 12.0), (2.0, -1.0 / 12.0))
STEP = 1e-4
#: What the members have in common, and how many there are.
KINDS = (('module', 2), ('tube', 2), ('tubes', 2), ('module', 3), ('tubes', 3))


def constraint_of(config, grip):
    """Return J_h and -G^T side by side, and the contacts."""
    hand, rigid = contact_rows(config, grip)
    return np.hstack([hand, -rigid]), random_grips.contacts_of(config, grip)


def along(contacts):
    """Return normals and axes of contacts, by which vx, vy become the two of each contact."""
    each = np.arange(len(contacts.owners))
    turned = np.zeros((len(each), 2, len(each), 2))
    turned[each, 0, each] = as_xy(-contacts.normals)
    turned[each, 1, each] = as_xy(1j * contacts.sides * contacts.normals)
    return turned.reshape(2 * len(each), -1)


def differences(config, grip, pose, contacts):
    """Return the derivatives by rollers and pose of what rolling keeps constant."""
    count = len(config.roller_positions)
    columns = []
    for change in np.eye(count + 3):
        column = 0.0
        for step, weight in STENCIL:
            moved = config.moved_to(config.roller_positions + STEP * step * change[:count])
            there = np.array(pose) + STEP * step * change[count:]
            kept = rolled_lengths(moved, grip, there, contacts)
            column += weight / STEP * kept
        columns.append(column)
    return np.stack(columns, axis=1)


@pytest.mark.parametrize('flat', [None, False, True])
@pytest.mark.parametrize(('kind', 'count'), KINDS)
@robots.examples(10)
@given(strategies.data(), robots.generators())
def test_rows_are_the_differences_of_rolling_shapes(flat, kind, count, data, rng):
    """Of discs, of any shapes, and of polygons on a face."""
    robot = data.draw(random_grips.robots_with(kind))
    config, grip = random_grips.random_convex_grip(robot, rng, kind, count, flat)
    assume(grip is not None)
    found, contacts = constraint_of(config, grip)
    assert (len(contacts.owners) > count) >= bool(flat)
    kept = differences(config, grip, grip.body.pose, contacts)
    assert along(contacts) @ -found == pytest.approx(kept, abs=1e-7)


@pytest.mark.parametrize('flat', [False, True])
@pytest.mark.parametrize('kind', ['module', 'tube', 'tubes'])
@robots.examples(25)
@given(strategies.data(), robots.generators(), strategies.booleans())
def test_an_object_moves_with_the_middle_of_two_contacts(kind, flat, data, rng, swapped):
    """Whatever the rollers do, and it turns with the first member on which a face lies."""
    robot = data.draw(random_grips.robots_with(kind))
    config, grip = random_grips.random_convex_grip(robot, rng, kind, 2, flat)
    assume(grip is not None)
    grip = replace(grip, members=grip.members[::-1]) if swapped else grip
    contacts, jacobian = random_grips.contacts_of(config, grip), grip_jacobian(config, grip)
    rollers = rng.standard_normal((jacobian.shape[1], 5))
    scale = 1e-10 * np.abs(jacobian).max()
    speeds = np.ascontiguousarray((contact_rows(config, grip)[0] @ rollers).T).view(complex).T
    own = [contacts.owners == member for member in (0, 1)]
    points = [contacts.points[k].mean() for k in own]
    moved = [speeds[k].mean(0) for k in own]
    turning = jacobian[2] @ rollers
    middle = jacobian[0] @ rollers + 1j * (jacobian[1] @ rollers)
    middle += 1j * turning * (sum(points) / 2.0 - grip.center)
    assert middle == pytest.approx(sum(moved) / 2.0, abs=scale)
    apart = points[1] - points[0]
    opening = ((moved[1] - moved[0]) * apart.conjugate()).real / abs(apart)
    assert jacobian[3] @ rollers == pytest.approx(opening, abs=scale)
    turned = [k for k in own if k.sum() == 2][:1] or [slice(None)]
    ends = contacts.points[turned[0]]
    by_ends = (speeds[turned[0]][1] - speeds[turned[0]][0]) / (ends[1] - ends[0])
    assert turning == pytest.approx(by_ends.imag, abs=100.0 * scale)
