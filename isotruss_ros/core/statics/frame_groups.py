# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The unknowns of a robot's frame, tube by tube: where entries go in the matrices of (4)."""

from __future__ import annotations

from dataclasses import dataclass
import functools

from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.beam_stack import beam_stack
from isotruss_ros.core.statics.structure import (
    bisection_gradients,
    frame_layout,
    frame_points,
    section_values,
)
from isotruss_ros.core.statics.tube_stiffness import tube_stiffness
import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

#: Which of the ten different entries of a member's matrix in the plane stands where, and its sign.
PLACE = np.array(
    [
        [0, 1, 3, 0, 1, 5],
        [1, 2, 4, 1, 2, 6],
        [3, 4, 7, 3, 4, 8],
        [0, 1, 3, 0, 1, 5],
        [1, 2, 4, 1, 2, 6],
        [5, 6, 8, 5, 6, 9],
    ]
)
ONE_END, OTHER_END = np.array([1.0, 1.0, 1.0, -1.0, -1.0, 1.0]), np.array([1, 1, 1, -1, -1, 1])
SIGN = np.outer(ONE_END, OTHER_END)


@dataclass(frozen=True, eq=False)
class FrameGroups:
    """
    The unknowns of the frames of a robot: displacements, then multipliers; t tubes.

    Matrices have d rows for each tube, w columns for its joints and j rows for all joints; what a
    shorter tube does not need is the identity.

    :ivar places: (k, 6) numbers of the displacements of each member's ends.
    :ivar unknowns: (3 p,) number of each displacement among the unknowns, -1 if it is none.
    :ivar solved: (f,) the displacements that are unknowns.
    :ivar position: (u,) where each unknown is: those of tube after tube, d each, then joints.
    :ivar joints: (t, w) numbers of the unknowns of each tube's joints; j where it has fewer.
    :ivar scale: (u,) factors with which stiffnesses become about 1.
    :ivar probe: (d,) a load that no motion is likely to be orthogonal to.
    :ivar operator: (t d d + t d w + j j, e) from the different entries to the matrices.
    """

    places: Indices
    unknowns: Indices
    solved: Indices
    position: Indices
    joints: Indices
    scale: Array
    probe: Array
    operator: csr_matrix

    def assemble(self, values: Array) -> tuple[Array, Array, Array]:
        """
        Return the scaled matrices of tubes (n, t, d, d), (n, t, d, w) and joints (n, j, j).

        :param values: (e, n) entries of members' matrices, of the bisection rows, and a one.
        """
        tubes, width = self.joints.shape
        size, n = len(self.probe), values.shape[1]
        filled = self.operator @ values
        inner = tubes * size * size
        rest = inner + tubes * size * width
        count = round(np.sqrt(len(filled) - rest))
        return (
            filled[:inner].reshape(tubes, size, size, n).transpose(3, 0, 1, 2),
            filled[inner:rest].reshape(tubes, size, width, n).transpose(3, 0, 1, 2),
            filled[rest:].reshape(count, count, n).transpose(2, 0, 1),
        )


@functools.lru_cache(maxsize=16)
def frame_groups(robot: Robot) -> FrameGroups:
    """
    Return the unknowns of a robot's frames; those of the last few robots are kept.

    :param robot: the robot.
    """
    topology, layout = robot.topology, frame_layout(robot)
    pattern, m, joints = layout.pattern, topology.n_modules, len(topology.joint_names)
    free, tubes = len(pattern.solved), len(topology.tube_names)
    node = pattern.solved // 3
    module = np.concatenate([(node - joints) // 4, np.arange(m)])
    of_tube = np.concatenate([node >= joints, np.ones(m, dtype=bool)])
    tube = np.where(of_tube, topology.tube[module], tubes)
    # One tube's unknowns after the other, then those of the joints.
    order = np.argsort(tube, kind='stable')
    counts = np.bincount(tube, minlength=tubes + 1)
    local = np.empty(len(tube), dtype=np.intp)
    local[order] = np.arange(len(tube)) - np.repeat(np.cumsum(counts) - counts, counts)
    size, n_joints = int(counts[:tubes].max()), int(counts[tubes])
    owned = [np.unique(topology.joint[topology.tube == t]) for t in range(tubes)]
    of_joint = pattern.unknowns[: 3 * joints].reshape(-1, 3)
    own = [of_joint[each][of_joint[each] >= 0] for each in owned]
    width = max(map(len, own))
    bound = np.full((tubes, width), n_joints)
    column = np.zeros((tubes, len(tube)), dtype=np.intp)
    for t, each in enumerate(own):
        bound[t, : len(each)] = local[each]
        column[t, each] = np.arange(len(each))

    k = len(layout.start)
    place = (PLACE[None] * k + np.arange(k)[:, None, None]).ravel()[pattern.entries]
    sign = np.tile(SIGN.ravel(), k)[pattern.entries]
    weights, one = 10 * k + pattern.weights, 10 * k + 10 * m
    source = np.concatenate([place, weights, weights])
    factor = np.concatenate([sign, np.ones(2 * len(weights))])
    rows, columns = pattern.matrix_rows, pattern.matrix_columns
    scale = _scale(robot, source, factor, rows, columns, free)
    factor = factor * scale[rows] * scale[columns]
    # Numbers of the entries in tubes' matrices, then beside them, then among joints.
    t, joint_row = tube[rows], tube[rows] == tubes
    joint_column = tube[columns] == tubes
    inner, rim = tubes * size * size, tubes * size * width
    inside = (t * size + local[rows]) * size + local[columns]
    beside = inner + (t * size + local[rows]) * width + column[np.minimum(t, tubes - 1), columns]
    among = inner + rim + local[rows] * n_joints + local[columns]
    target = np.where(joint_row, among, np.where(joint_column, beside, inside))
    used = joint_column | ~joint_row
    # The identity where a tube has fewer unknowns than the longest.
    idle = [(i * size + j) * size + j for i in range(tubes) for j in range(counts[i], size)]
    target = np.concatenate([target[used], np.array(idle, dtype=np.intp)])
    source = np.concatenate([source[used], np.full(len(idle), one)])
    factor = np.concatenate([factor[used], np.ones(len(idle))])
    shape = (inner + rim + n_joints**2, one + 1)
    return FrameGroups(
        pattern.places,
        pattern.unknowns,
        pattern.solved,
        np.where(of_tube, tube * size, tubes * size) + local,
        bound,
        scale,
        np.cos(np.arange(size)),
        coo_matrix((factor, (target, source)), shape=shape).tocsr(),
    )


def _scale(
    robot: Robot, source: Indices, factor: Array, rows: Indices, columns: Indices, free: int
) -> Array:
    """Return factors (u,) with which the stiffnesses of all unknowns are 1 at home."""
    file, layout = robot.description, frame_layout(robot)
    pressures = tuple(file.pressures.values())
    points = frame_points(robot, robot.home.points)
    sections = section_values(robot, tube_stiffness(file), pressures, robot.home.member_lengths)
    span = (points[layout.end] - points[layout.start])[:, None]
    beams = beam_stack(span, sections[..., None], layout.pinned_start[:, None])
    values = np.concatenate([beams.entries().ravel(), bisection_gradients(robot, points)])
    size = free + robot.topology.n_modules
    diagonal, entries = rows == columns, factor * values[source]
    scale = np.bincount(rows[diagonal], entries[diagonal], minlength=size)
    scale[:free] = 1.0 / np.sqrt(scale[:free])
    bound = (rows >= free) & (columns < free)
    weights = (entries * scale[columns])[bound] ** 2
    scale[free:] = 1.0 / np.sqrt(np.bincount(rows[bound], weights, minlength=size)[free:])
    return scale
