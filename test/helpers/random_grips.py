"""Random discs between any members, and what rolling without slip keeps constant of them."""

import itertools

from isotruss_ros.core import Cylinder, Grip
import numpy as np
import robots


def member_ends(config, name):
    """Return B where a member starts and C where it ends, found by their names."""
    place = dict(zip(config.robot.node_names, config.points, strict=True))
    module, end = name.split('-')
    return place[f'{module}/B'], place[f'{module.split("/")[0]}/{end}/C']


def travel_into(config, name):
    """Return the travel of the tube into a member at its start [m]."""
    rollers = dict(zip(config.robot.roller_names, config.roller_positions, strict=True))
    return rollers.get(name.split('-')[0], 0.0)


def local_center(config, name, center):
    """Return a point along and left of a member, from its start [m]."""
    start, end = member_ends(config, name)
    axis = (end - start) / abs(end - start)
    return axis.conjugate() * (center - start), axis


def kind_of(robot, members):
    """Return whether members are of different tubes, meet at a module, or neither."""
    topology = robot.topology
    numbers = [robot.member_names.index(name) for name in members]
    if len(set(topology.tube[numbers])) > 1:
        return 'tubes'
    meet = any(topology.following[i] == j for i, j in itertools.permutations(numbers, 2))
    return 'module' if meet else 'tube'


def random_grip(robot, rng, kind, count=2, tries=400):
    """
    Return a random state and a disc that touches members of a kind there, somewhat pressed in.

    :return: the grip is None where none was found.
    """
    config = robots.random_state(robot, rng)
    tube = robot.description.tube_diameter
    combinations = [
        names
        for names in itertools.combinations(robot.member_names, count)
        if kind_of(robot, names) == kind
    ]
    for _ in range(tries if combinations else 0):
        names = combinations[rng.integers(len(combinations))]
        names = [names[i] for i in rng.permutation(count)]
        ends = [member_ends(config, name) for name in names]
        share = rng.uniform(0.05, 0.95, count)
        touched = np.array([a + s * (b - a) for (a, b), s in zip(ends, share, strict=True)])
        center = complex(rng.dirichlet(np.full(count, 3.0)) @ touched)
        if count == 3:
            center = equally_far(ends, center)
            center += 0.5 * tube * complex(*rng.uniform(-1.0, 1.0, 2))
        places = [local_center(config, name, center)[0] for name in names]
        lengths = [abs(b - a) for a, b in ends]
        offs = np.array([abs(place.imag) for place in places])
        on = all(0.0 < p.real < n for p, n in zip(places, lengths, strict=True))
        diameter = offs.min() + offs.max() - tube
        if on and np.ptp(offs) < 1.8 * tube and 0.02 < diameter < 2.0:
            return config, Grip(names, Cylinder((center.real, center.imag), float(diameter)))
    return config, None


def equally_far(ends, near):
    """Return the point as far from three lines, on the sides of them on which a point is."""
    rows, right = [], []
    for start, end in ends:
        inward = 1j * (end - start) / abs(end - start)
        if (inward.conjugate() * (near - start)).real < 0.0:
            inward = -inward
        rows.append([inward.real, inward.imag, -1.0])
        right.append((inward.conjugate() * start).real)
    x, y, _ = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]
    return complex(x, y)


def rolled_lengths(config, grip, pose, sides):
    """
    Return what a disc that rolls without slip on its members keeps, two numbers by contact [m].

    Its distance from the member; and where the material of the tube that it touches lies along
    the tube, less the arc of the disc that has been unrolled on it.
    """
    found = []
    for name, side in zip(grip.members, sides, strict=True):
        place, axis = local_center(config, name, complex(*pose[:2]))
        turned = pose[2] - np.angle(axis)
        material = place.real - travel_into(config, name)
        found += [side * place.imag, material + side * 0.5 * grip.body.diameter * turned]
    return np.array(found)


def side_of(config, grip):
    """Return +1 for each member that has the disc on its left, -1 for the others."""
    center = complex(*grip.body.center)
    return [np.sign(local_center(config, name, center)[0].imag) for name in grip.members]
