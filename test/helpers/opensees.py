# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""OpenSees: plane frames of large displacements, to compare with."""

import ctypes
import importlib.util
import itertools
from pathlib import Path

import numpy as np
import pytest

#: What its shared object needs, from its own wheel.
LIBRARIES = (
    'libquadmath.so.0',
    'libgfortran.so.4',
    'libgomp.so.1',
    'libblas.so.3',
    'liblapack.so.3',
)


def load():
    """Return the program, or skip the test where it is not installed."""
    found = importlib.util.find_spec('openseespylinux')
    if found is None:
        pytest.skip('compares with it: pip install openseespylinux')
    folder = Path(found.submodule_search_locations[0]) / 'lib'
    for name in LIBRARIES:
        ctypes.CDLL(str(folder / name), mode=ctypes.RTLD_GLOBAL)
    from openseespylinux import opensees

    return opensees


def bent(points, found, held, loads, parts=8, steps=4):
    """
    Return how the nodes (n, 3) of a frame move by large displacements.

    Members are chains of co-rotational Timoshenko beams, pins are nodes of their own.

    :param parts: of each member.
    :param steps: in which the loads grow.
    """
    ops, n = load(), len(points)
    ops.wipe()
    ops.model('basic', '-ndm', 2, '-ndf', 3)
    ops.geomTransf('Corotational', 1)
    for i, point in enumerate(points.tolist()):
        ops.node(i, point.real, point.imag)
        ops.fix(i, *(int(flag) for flag in held[i]))
    count = n
    for k in range(len(found.start)):
        ends = int(found.start[k]), int(found.end[k])
        chain = []
        for end, pinned in zip(ends, (found.pinned_start[k], found.pinned_end[k]), strict=True):
            if pinned:
                ops.node(count, points[end].real, points[end].imag)
                ops.fix(count, *(int(flag) for flag in held[end, :2]), 0)
                free = (1 + np.flatnonzero(~held[end, :2])).tolist()
                if free:
                    ops.equalDOF(end, count, *free)
            chain.append(count if pinned else end)
            count += bool(pinned)
        inner = np.linspace(points[ends[0]], points[ends[1]], parts + 1)[1:-1]
        for place in inner.tolist():
            ops.node(count, place.real, place.imag)
            chain.insert(-1, count)
            count += 1
        axial, flexural, shear = (float(x[k]) for x in found[2:5])
        # E = G = 1: areas and moments of area are rigidities.
        ops.section('Elastic', k + 1, 1.0, axial, flexural, 1.0, shear / axial)
        ops.beamIntegration('Lobatto', k + 1, k + 1, 3)
        for i, pair in enumerate(itertools.pairwise(chain)):
            ops.element('forceBeamColumn', parts * k + i, *pair, 1, k + 1)
    ops.timeSeries('Linear', 1)
    ops.pattern('Plain', 1, 1)
    for i, load_ in enumerate(loads.tolist()):
        ops.load(i, *load_)
    ops.constraints('Transformation')
    ops.numberer('RCM')
    ops.system('UmfPack')
    ops.test('NormDispIncr', 1e-10, 50)
    ops.algorithm('Newton')
    ops.integrator('LoadControl', 1.0 / steps)
    ops.analysis('Static')
    assert ops.analyze(steps) == 0
    return np.array([ops.nodeDisp(i) for i in range(n)])
