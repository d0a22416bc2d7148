# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Fit the slip margin of held discs by random features, and compare it with `settle_grasps`.

Usage: python fit_slip_margin.py [number of grasps].
"""

from pathlib import Path
import sys
import tempfile

from isotruss_ros import core
from isotruss_ros.dataset.grasp_dataset import DatasetRun, write_dataset
from isotruss_ros.dataset.random_grasps import GraspDistribution
import numpy as np

COUNT = int(sys.argv[1]) if len(sys.argv) == 2 else 2048
#: Share of the rows for the fit, number of random features and the penalty of their weights [-].
SHARE, FEATURES, PENALTY = 0.75, 1000, 0.3

discs = GraspDistribution(('disc',), depth=(0.005, 0.02), force=1.0)
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / 'discs.npz'
    write_dataset(DatasetRun(core.load_robot('triangle'), COUNT, discs, seed=0), path)
    with np.load(path) as file:
        held = file['held']
        names = ('semi_axes', 'given_pose', 'friction', 'external_wrench', 'roller_positions')
        columns = [file[name][held].reshape(held.sum(), -1) for name in names]
        margins = file['slip_margin'][held]
inputs, rng = np.hstack(columns), np.random.default_rng(0)
inputs = (inputs - inputs.mean(axis=0)) / (inputs.std(axis=0) + 1e-12)
layer = 0.3 * rng.normal(size=(inputs.shape[1], FEATURES))
features = np.tanh(inputs @ layer + rng.uniform(-2.0, 2.0, FEATURES))
features = np.column_stack([features, inputs, np.ones(len(inputs))])
n = int(SHARE * len(margins))
normal = features[:n].T @ features[:n] + PENALTY * np.eye(features.shape[1])
weights = np.linalg.solve(normal, features[:n].T @ margins[:n])
errors = np.abs(features[n:] @ weights - margins[n:])
print(f'fitted to {n} held discs, compared with settle_grasps for {len(errors)}')
print(
    f'error: median {np.median(errors):.1f} N, root mean square {(errors**2).mean() ** 0.5:.1f} N'
)
print(f'standard deviation of the margin: {margins[n:].std():.1f} N')
