# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Press a rigid cylinder into an inflated tube of membrane elements, beside the package's model.

`python -m studies.membrane` prints the cases of Fig. 6, then small cylinders, low pressure, and
tubes that are bent while the cylinder is pressed in. The tube is a membrane without bending
stiffness. Its stress is linear in the Green-Lagrange strain about the inflated cylinder (St.
Venant-Kirchhoff), with E t along the tube and around it, and G t in shear. The gauge pressure
follows the surface. The cylinder is across the tube, without friction; contact is a stiff
foundation at the nodes. Half of the tube is computed, y >= 0; x is along the tube, and the
cylinder is above, at positive z.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from isotruss_ros.calibration.pressed_tube import ClampedTube, press
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve
from studies.paper.default_tube import default_tube, wrinkling_moment
from studies.paper.parameters import (
    CYLINDERS,
    DEPTH,
    PRESSURE,
    PRESSURES,
    TUBE_DIAMETER,
    TUBE_LENGTH,
)

#: Elements from top to bottom, and along the tube [-]; with 30 and 120, the stiffness for the
#: smallest cylinder of Fig. 6 changes by 0.3 %.
AROUND, ALONG = 20, 80
RADIUS = 0.5 * TUBE_DIAMETER
#: Stiffness of the contact per area [Pa/m]: the pressure of the tube compresses it by 35 um.
FOUNDATION = 1e9
#: Largest motion of a node in a step of Newton's method, and in the last step [m].
MAX_STEP, LAST_STEP = 3e-3, 1e-7
MAX_STEPS = 100


class Response(NamedTuple):
    """Force of a cylinder pressed into the tube."""

    stiffness: float  #: force over depth [N/m]
    contact: float  #: length of the contact along the tube [m]
    moment: float  #: bending moment of the ends before the cylinder is pressed in [N m]


class Membrane:
    """Half of an inflated tube of n nodes, as e triangles of a membrane."""

    def __init__(self, pressure: float, around: int = AROUND, along: int = ALONG) -> None:
        self.pressure = pressure
        # Indices of the nodes, along and around; finer in the middle and at the top.
        self.grid = np.arange((along + 1) * (around + 1)).reshape(along + 1, around + 1)
        share = np.linspace(-1.0, 1.0, along + 1)
        x = 0.5 * TUBE_LENGTH * (1.0 + 0.3 * share + 0.7 * share**3)
        arc = np.pi * RADIUS * np.linspace(0.0, 1.0, around + 1) ** 1.35
        #: (n, 2) material coordinates along and around [m], and (n, 3) nodes of the round tube [m]
        self.surface = np.stack(np.meshgrid(x, arc, indexing='ij'), axis=-1).reshape(-1, 2)
        angle = self.surface[:, 1] / RADIUS
        self.nodes = np.column_stack(
            [self.surface[:, 0], RADIUS * np.sin(angle), RADIUS * np.cos(angle)]
        )
        # (e, 3) nodes of the triangles; the diagonals of the rectangles alternate.
        grid = self.grid
        corners = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], -1)
        odd = np.indices(corners.shape[:2]).sum(axis=0) % 2 == 1
        one, other = [0, 1, 2, 0, 2, 3], [0, 1, 3, 1, 2, 3]
        self.triangles = np.concatenate([corners[odd][:, one], corners[~odd][:, other]])
        self.triangles = self.triangles.reshape(-1, 3)
        # (e,) areas [m^2], and (e, 3, 2) gradients of the shape functions of the nodes [1/m].
        corner = self.surface[self.triangles]
        edges = (corner[:, 1:] - corner[:, :1]).swapaxes(1, 2)
        self.areas, inverse = 0.5 * np.linalg.det(edges), np.linalg.inv(edges)
        self.gradients = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        self.node_areas = np.bincount(self.triangles.ravel(), np.repeat(self.areas / 3.0, 3))
        fabric = default_tube().fabric
        stretch, shear = fabric.membrane_modulus, fabric.membrane_shear_modulus
        self.moduli = np.diag([stretch, stretch, shear])
        # The strains of the plane elements of the round tube count as zero.
        self.first_strain = _strain(self._slopes(self.nodes))
        # Free motions (3 n, q): none at the ends, none across the plane of symmetry; the last one
        # shifts the right end.
        free = np.ones((len(self.nodes), 3), dtype=bool)
        free[grid[[0, -1]]] = False
        free[grid[:, [0, -1]], 1] = False
        shift = np.zeros((free.size, 1))
        shift[3 * grid[-1]] = 1.0
        columns = sparse.eye(free.size, format='csc')[:, np.flatnonzero(free)]
        self.motions = sparse.hstack([columns, shift], format='csc')

    def _slopes(self, nodes: Array) -> Array:
        """Return the derivatives (e, 3, 2) of the position by the material coordinates."""
        return nodes[self.triangles].swapaxes(1, 2) @ self.gradients

    def wall_forces(self, nodes: Array) -> tuple[Array, Array]:
        """Return the forces (e, 9) of the elements on their nodes, and their derivatives."""
        slopes, hoop = self._slopes(nodes), self.pressure * RADIUS
        stretched = (_strain(slopes) - self.first_strain) @ self.moduli
        stress = np.array([0.5 * hoop, hoop, 0.0]) + stretched
        # Derivatives (e, 3, 9) of the strains by the positions of the nodes.
        along, around = slopes[:, None, :, 0], slopes[:, None, :, 1]
        by_along, by_around = self.gradients[:, :, None, 0], self.gradients[:, :, None, 1]
        shear = by_along * around + by_around * along
        rates = np.stack([by_along * along, by_around * around, shear], 1).reshape(-1, 3, 9)
        weighted = self.areas[:, None, None] * rates.swapaxes(1, 2)
        # Geometric stiffness: the stress turns with the element.
        tensor = self.areas[:, None, None] * stress[:, [[0, 2], [2, 1]]]
        turning = self.gradients @ tensor @ self.gradients.swapaxes(1, 2)
        turning = np.einsum('eab,ij->eaibj', turning, np.eye(3)).reshape(-1, 9, 9)
        return (weighted @ stress[:, :, None])[:, :, 0], weighted @ self.moduli @ rates + turning

    def gas_forces(self, nodes: Array) -> tuple[Array, Array]:
        """Return the forces (e, 9) of the gas on the nodes, and their derivatives."""
        a, b, c = nodes[self.triangles].swapaxes(0, 1)
        third = self.pressure * np.cross(b - a, c - a) / 6.0
        rates = [_cross_matrix(c - b), _cross_matrix(a - c), _cross_matrix(b - a)]
        rates = self.pressure * np.concatenate(rates, axis=2) / 6.0
        return np.tile(third, 3), np.tile(rates, (1, 3, 1))

    def contact_forces(self, nodes: Array, center: Array, radius: float) -> tuple[Array, Array]:
        """Return the forces (n, 3) of a cylinder on the nodes, and their derivatives."""
        away = (nodes - center) * [1.0, 0.0, 1.0]
        distance = np.linalg.norm(away, axis=1)[:, None]
        normals = away / distance
        tangents = normals[:, [2, 1, 0]] * [1.0, 0.0, -1.0]
        touching = (distance < radius) & (self.nodes[:, 2:] > -0.3 * RADIUS)
        stiffness = np.where(touching, FOUNDATION * self.node_areas[:, None], 0.0)
        forces = stiffness * (radius - distance)
        inward, turning = stiffness * normals, forces / distance * tangents
        rates = turning[:, :, None] * tangents[:, None] - inward[:, :, None] * normals[:, None]
        return forces * normals, rates

    def settle(self, nodes: Array, slides: bool, center: Array, radius: float) -> list[Array]:
        """
        Return the nodes in equilibrium, and the forces of the cylinder and of the ends on them.

        The right end slides along x under the pressure on its cap, or is fixed.
        """
        motions = self.motions if slides else self.motions[:, :-1]
        places = (3 * self.triangles[:, :, None] + np.arange(3)).reshape(-1, 9)
        entries = np.repeat(places, 9, axis=1).ravel(), np.tile(places, 9).ravel()
        cap = np.zeros(nodes.shape)
        cap[self.grid[-1, 0], 0] = 0.5 * self.pressure * np.pi * RADIUS**2
        for count in range(MAX_STEPS):
            wall, wall_rates = self.wall_forces(nodes)
            gas, gas_rates = self.gas_forces(nodes)
            pushes, push_rates = self.contact_forces(nodes, center, radius)
            inner = np.bincount(places.ravel(), (wall - gas).ravel()).reshape(-1, 3)
            missing = pushes + cap - inner
            stiffness = sparse.coo_matrix(((wall_rates - gas_rates).ravel(), entries)).tocsc()
            stiffness = stiffness - sparse.block_diag(push_rates, format='csc')
            reduced = (motions.T @ stiffness @ motions).tocsc()
            step = motions @ spsolve(reduced, motions.T @ missing.ravel())
            largest = np.abs(step).max()
            # Nodes that enter and leave the contact in turn settle by shorter steps.
            share = min(1.0 if count < 30 else 0.5, MAX_STEP / largest)
            nodes = nodes + share * step.reshape(-1, 3)
            if largest < LAST_STEP:
                return [nodes, pushes, -missing]
        raise RuntimeError(f'no equilibrium in {MAX_STEPS} steps')

    def press(self, cylinder: float, angle: float | None = None) -> Response:
        """
        Press a cylinder into the middle of the tube.

        If an angle is given, the right end slides, and both ends are rotated by this angle before,
        which compresses the top [rad].
        """
        nodes, slides, left, right = self.nodes, angle is not None, self.grid[0], self.grid[-1]
        for share in (0.0, 0.5, 1.0) if angle else (0.0,):
            turn = share * (angle or 0.0)
            for end, side in ((left, 1.0), (right, -1.0)):
                nodes = nodes.copy()
                nodes[end, 0] = nodes[end, 0].mean() + side * np.sin(turn) * self.nodes[end, 2]
                nodes[end, 2] = np.cos(turn) * self.nodes[end, 2]
            nodes, _, ends = self.settle(nodes, slides, np.array([0.0, 0.0, 1.0]), 0.1)
        moment = 2.0 * (nodes[left, 2] * ends[left, 0] - nodes[left, 0] * ends[left, 2]).sum()
        line = self.grid[:, 0]
        x, _, z = nodes[line[len(line) // 2]]
        steps = 1 + math.ceil(4.0 * DEPTH / cylinder)
        for share in np.arange(1, steps + 1) / steps:
            center = np.array([x, 0.0, z + 0.5 * cylinder - share * DEPTH])
            nodes, pushes, _ = self.settle(nodes, slides, center, 0.5 * cylinder)
        touched = np.gradient(self.surface[line, 0])[pushes[line, 2] < 0.0]
        return Response(-2.0 * pushes[:, 2].sum() / DEPTH, float(touched.sum()), float(moment))


def _strain(slopes: Array) -> Array:
    """Return the Green-Lagrange strains (e, 3): along, around, and twice the shear."""
    products = slopes.swapaxes(1, 2) @ slopes
    stretches = 0.5 * products[:, [0, 1], [0, 1]] - 0.5
    return np.column_stack([stretches, products[:, 0, 1]])


def _cross_matrix(vectors: Array) -> Array:
    """Return the matrices (e, 3, 3) of the cross products with vectors (e, 3)."""
    x, y, z = vectors.T
    zero = np.zeros(len(vectors))
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


def main() -> None:
    """Print tables of stiffnesses, for membrane elements and for the package."""
    model = default_tube()
    tube = ClampedTube(model, RADIUS, TUBE_LENGTH)
    print('| pressure [kPa] | cylinder [cm] | membrane [N/m] | package | contact [mm] | package |')
    print('| ---: | ---: | ---: | ---: | ---: | ---: |')
    figure_6 = [(pressure, cylinder) for pressure in PRESSURES for cylinder in CYLINDERS]
    others = [(PRESSURE, 0.01), (PRESSURE, 0.05), *((8e3, cylinder) for cylinder in CYLINDERS)]
    for pressure, cylinder in figure_6 + others:
        mesh = (30, 160) if cylinder < CYLINDERS[0] else (AROUND, ALONG)
        membrane = Membrane(pressure, *mesh).press(cylinder)
        own = press(tube, pressure, 0.5 * TUBE_LENGTH, cylinder, DEPTH)
        print(
            f'| {1e-3 * pressure:.3g} | {100.0 * cylinder:.3g} | {membrane.stiffness:.0f} | '
            f'{own.stiffness:.0f} | {1e3 * membrane.contact:.0f} | {1e3 * own.contact:.0f} |',
            flush=True,
        )
    print('\n| cylinder [cm] | moment / wrinkling moment | stiffness over that without moment |')
    print('| ---: | ---: | ---: |')
    limit = wrinkling_moment(PRESSURE, RADIUS)
    flexural = model.section_stiffness(TUBE_LENGTH, PRESSURE).flexural[0]
    for cylinder in CYLINDERS:
        straight = Membrane(PRESSURE).press(cylinder, 0.0)
        for share in (0.5, 0.9):
            angle = 0.5 * share * limit * TUBE_LENGTH / flexural
            bent = Membrane(PRESSURE).press(cylinder, angle)
            used, ratio = abs(bent.moment) / limit, bent.stiffness / straight.stiffness
            print(f'| {100.0 * cylinder:.3g} | {used:.2f} | {ratio:.3f} |', flush=True)


if __name__ == '__main__':
    main()
