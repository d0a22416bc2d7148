# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How long the analysis of a grasp takes, how it grows, and the same frame in other programs.

Grasps are those of the nine-member preset at its top module, contact points every 5 mm, with
tubes that flatten and with the paper's round ones. "Cold" is all of it: assembly, factorization,
contact, closure, stiffness, wrinkling; "warm" is the same configuration with the object moved.
Peers solve one linear frame (the members of the nine-member robot, all ends fixed, one load),
model building included, in the same run; those not installed are left out:
pip install openseespy anastruct PyNiteFEA, OpenSeesPy needs libblas3 and liblapack3.

    python benchmarks/statics.py
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import importlib.util
import os

os.environ.update(OPENBLAS_NUM_THREADS='1', OMP_NUM_THREADS='1')  # before NumPy comes in

from isotruss_ros import core
from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.statics.frame import Frame
from isotruss_ros.core.statics.frame_pattern import Members
from isotruss_ros.core.statics.structure import structure_of
from large_robots import nested_triangles, SIZES, TOP_JOINT
from measuring import median_time, part, print_machine, print_table, timed
import numpy as np

STATES, SHAPE_STATES = part(500), part(100)
DIAMETER = 0.3
MODULE = 'north/Z'
#: How far the object is pressed toward the corner [m].
DEPTHS = (0.002, 0.02)
COLD_TARGET, WARM_TARGET = 2e-3, 1e-3
LOAD = -10.0


def pressed(config: core.Configuration, module: str, depth: float) -> core.ConvexObject:
    """Return an object that is pressed toward the corner at a module."""
    robot = config.robot
    tangent = np.array(core.tangent_center(config, module, DIAMETER))
    pinch = [config.nodes[robot.node_names.index(f'{module}/{node}')] for node in 'BC']
    outward = np.mean(pinch, axis=0) - tangent
    return core.ConvexObject.disc(
        tuple(tangent + depth * outward / np.linalg.norm(outward)), DIAMETER
    )


def print_grasps() -> None:
    """Measure whole analyses of random states."""
    robot = core.load_robot('nine_member')
    rows: list[list[str]] = []
    for model, paper_model in (('bent', False), ("paper's model", True)):
        random = np.random.default_rng(1)
        cold, warm, contacts = [], [], []
        while len(cold) < STATES:
            config = robot.configuration(random.uniform(-0.15, 0.15, len(robot.roller_names)))
            cylinder = pressed(config, MODULE, random.uniform(*DEPTHS))
            seconds, analysis = timed(partial(analyze, config, cylinder, paper_model))
            cold.append(seconds)
            contacts.append(len(analysis.points))
            x, y, angle = cylinder.pose
            moved = cylinder.moved_to((x + 1e-4, y - 1e-4, angle))
            warm.append(timed(partial(analyze, config, moved, paper_model, analysis))[0])
        for name, times, target in (('cold', cold, COLD_TARGET), ('warm', warm, WARM_TARGET)):
            median, tail = np.percentile(times, [50.0, 99.0])
            verdict = 'pass' if median < target else 'FAIL'
            milliseconds = f'{1e3 * median:.2f}', f'{1e3 * tail:.2f}', f'< {1e3 * target:.0f}'
            points = f'{np.median(contacts):.0f}'
            rows.append([f'{model}, {name}', points, *milliseconds, verdict])
    print(f'{STATES} random states; ms')
    print_table(['whole analysis', 'contact points', 'median', 'p99', 'target', ''], rows)


def print_shapes() -> None:
    """Measure cold analyses of objects that are no discs against those of a disc."""
    robot, random = core.load_robot('nine_member'), np.random.default_rng(2)
    members = members_at(robot, MODULE)
    corners = [(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)]
    shapes = {
        'disc': core.Disc(DIAMETER),
        'box, corners of 2 cm': core.Polygon(corners, corner_radius=0.02),
        'box, sharp corners': core.Polygon(corners),
        'ellipse': core.Ellipse((0.15, 0.1)),
    }
    times: dict[str, list[float]] = {name: [] for name in shapes}
    while len(times['disc']) < SHAPE_STATES:
        travel = random.uniform(-0.15, 0.15, len(robot.roller_names))
        angle, depth = random.uniform(0.0, 2.0 * np.pi), random.uniform(*DEPTHS)
        for name, shape in shapes.items():
            config = robot.configuration(travel)
            try:
                held = core.place_between(config, members, shape, angle, depth)
                config = robot.configuration(travel)
                times[name].append(timed(partial(core.analyze_grasp, config, held.body))[0])
            except GraspError:
                continue  # a narrow corner of the robot has no room for it
    least = {name: float(np.median(values)) for name, values in times.items()}
    rows = [[name, f'{1e3 * t:.2f}', f'{t / least["disc"]:.2f}'] for name, t in least.items()]
    print(f'\n{SHAPE_STATES} random states, cold; ms')
    print_table(['object', 'median', 'over the disc'], rows)


def analyze(
    config: core.Configuration,
    cylinder: core.ConvexObject,
    paper_model: bool = False,
    previous: GraspAnalysis | None = None,
) -> GraspAnalysis:
    """Analyse a grasp; the last two arguments by place."""
    return core.analyze_grasp(config, cylinder, paper_model=paper_model, previous=previous)


def print_growth() -> None:
    """Measure how the analysis grows with the robot at fixed contact."""
    rows, first = [], None
    for size in SIZES:
        robot = core.Robot(nested_triangles(size))
        module = next(name for name in robot.roller_names if name.endswith(f'/{TOP_JOINT}'))
        home = robot.home
        cylinder = pressed(home, module, 0.01)

        def cold(
            home: core.Configuration = home, cylinder: core.ConvexObject = cylinder
        ) -> object:
            # A new object, for which no structure is cached.
            return analyze(
                core.Configuration(home.robot, home.roller_positions, home.points), cylinder
            )

        times = median_time(cold, 1.0), median_time(partial(analyze, home, cylinder), 1.0)
        first = first or times
        displacements = 3 * len(structure_of(home).node_names)
        rows.append(
            [str(size), str(displacements), str(len(analyze(home, cylinder).points))]
            + [
                text
                for t, t0 in zip(times, first, strict=True)
                for text in (f'{1e3 * t:.2f}', f'{t / t0:.1f}')
            ]
        )
    print('\nGrowth at one grasp; ms, and ratio to 3 modules (linear growth would be 101)')
    print_table(['modules', 'displacements', 'contact points', 'cold', '/ 3', 'warm', '/ 3'], rows)


def all_fixed(config: core.Configuration) -> tuple[Points, Members, Array]:
    """Return nodes, members and supports of a frame that any program knows."""
    frame = structure_of(config).frame
    members = frame.members
    fixed = np.zeros(len(members.start), dtype=bool)
    return (
        frame.points,
        Members(
            members.start,
            members.end,
            members.axial,
            members.flexural,
            np.full_like(members.shear, np.inf),
            fixed,
            fixed,
        ),
        config.robot.topology.grounded,
    )


def ours(points: Points, members: Members, grounded: Array, node: int) -> float:
    """Return how far the loaded node sinks."""
    held = np.zeros((len(points), 3), dtype=bool)
    held.reshape(-1)[3 * (grounded // 2) + grounded % 2] = True
    loads = np.zeros((len(points), 3))
    loads[node, 1] = LOAD
    names = [str(i) for i in range(len(points))]
    return float(Frame(points, members, held, names).solve(loads).displacements[node, 1])


def opensees(points: Points, members: Members, grounded: Array, node: int) -> float:
    """Solve it with OpenSeesPy."""
    import openseespy.opensees as ops

    ops.wipe()
    ops.model('basic', '-ndm', 2, '-ndf', 3)
    for i, point in enumerate(points):
        ops.node(i, point.real, point.imag)
    held = {int(i // 2): [0, 0, 0] for i in grounded}
    for i in grounded:
        held[int(i // 2)][int(i % 2)] = 1
    for i, flags in held.items():
        ops.fix(i, *flags)
    ops.geomTransf('Linear', 1)
    for k in range(len(members.start)):
        ends = int(members.start[k]), int(members.end[k])
        section = float(members.axial[k]), 1.0, float(members.flexural[k])  # A, E, I
        ops.element('elasticBeamColumn', k, *ends, *section, 1)
    ops.timeSeries('Linear', 1)
    ops.pattern('Plain', 1, 1)
    ops.load(node, 0.0, LOAD, 0.0)
    ops.system('BandSPD')
    ops.numberer('RCM')
    ops.constraints('Plain')
    ops.integrator('LoadControl', 1.0)
    ops.algorithm('Linear')
    ops.analysis('Static')
    ops.analyze(1)
    return float(ops.nodeDisp(node, 2))


def anastruct(points: Points, members: Members, grounded: Array, node: int) -> float:
    """Solve it with anastruct."""
    from anastruct import SystemElements

    system = SystemElements()
    for k in range(len(members.start)):
        start, end = points[members.start[k]], points[members.end[k]]
        system.add_element(
            location=[[start.real, start.imag], [end.real, end.imag]],
            EA=float(members.axial[k]),
            EI=float(members.flexural[k]),
        )
    ids = {
        i: system.find_node_id([points[i].real, points[i].imag]) for i in {*grounded // 2, node}
    }
    for i in set(grounded // 2):
        both = (grounded // 2 == i).sum() == 2
        system.add_support_hinged(ids[i]) if both else system.add_support_roll(ids[i], 'x')
    system.point_load(ids[node], Fy=LOAD)
    system.solve()
    return float(system.get_node_displacements(ids[node])['uy'])


def pynite(points: Points, members: Members, grounded: Array, node: int) -> float:
    """Solve it with PyNiteFEA, in space, with the plane held."""
    from Pynite import FEModel3D

    model = FEModel3D()
    model.add_material('unit', 1.0, 1.0, 0.3, 1.0)
    held = {int(i): [False, False] for i in grounded // 2}
    for i in grounded:
        held[int(i // 2)][int(i % 2)] = True
    for i, point in enumerate(points):
        model.add_node(str(i), point.real, point.imag, 0.0)
        model.def_support(str(i), *held.get(i, [False, False]), True, True, True, False)
    for k in range(len(members.start)):
        flexural = float(members.flexural[k])
        model.add_section(str(k), float(members.axial[k]), flexural, flexural, 1.0)
        model.add_member(str(k), str(members.start[k]), str(members.end[k]), 'unit', str(k))
    model.add_node_load(str(node), 'FY', LOAD)
    model.analyze_linear()
    return float(model.nodes[str(node)].DY['Combo 1'])


def print_peers() -> None:
    """Solve one frame with all programs that are installed."""
    robot = core.load_robot('nine_member')
    # Not at home, where tubes lie in line: PyNiteFEA joins a node to every member that it is on.
    travel = 0.05 * np.cos(np.arange(len(robot.roller_names)))
    points, members, grounded = all_fixed(robot.configuration(travel))
    node = robot.node_names.index('Z')
    peers: dict[str, tuple[str, Callable[..., float]]] = {
        'OpenSeesPy': ('openseespy', opensees),
        'anastruct': ('anastruct', anastruct),
        'PyNiteFEA': ('Pynite', pynite),
    }
    own = median_time(lambda: ours(points, members, grounded, node), 1.0)
    reference = ours(points, members, grounded, node)
    rows = [['isotruss_ros', f'{1e3 * own:.2f}', '1.0', f'{1e3 * reference:.6f}']]
    for name, (module, solve) in peers.items():
        if importlib.util.find_spec(module) is None:
            print(f'{name} is not installed')
            continue
        taken = median_time(lambda: solve(points, members, grounded, node), 1.0)  # noqa: B023
        sunk = solve(points, members, grounded, node)
        rows.append([name, f'{1e3 * taken:.2f}', f'{taken / own:.1f}', f'{1e3 * sunk:.6f}'])
    print(f'\nOne linear frame, {len(points)} nodes, {len(members.start)} members, ends fixed')
    print_table(['program', 'ms', '/ ours', 'the load sinks by mm'], rows)


def main() -> None:
    """Print the tables."""
    print_machine()
    print_grasps()
    print_shapes()
    print_growth()
    print_peers()


if __name__ == '__main__':
    main()
