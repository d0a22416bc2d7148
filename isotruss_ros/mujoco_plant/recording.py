# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Recordings of the states of a MuJoCo plant, from which pictures are rendered later.

A file contains the model as text and a sequence of states. A state consists of the time, MuJoCo's
coordinates, and the lengths and positions of the tube segments, which change with roller travel.
The file can be read after each written state.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.mujoco_plant.options import PlantError
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np

#: Number of recorded states per second of simulated time [Hz].
STATE_RATE = 25.0


class PlantRecorder:
    """
    Recorder of a plant's states to a file.

    :param plant: the plant.
    :param path: path of the file; an existing file is replaced.
    :param rate: number of recorded states per second of simulated time [Hz].
    :raises PlantError: the file cannot be written.
    """

    def __init__(self, plant: MujocoPlant, path: Path, rate: float = STATE_RATE) -> None:
        self._plant, self._period, self._next = plant, 1.0 / rate, -np.inf
        try:
            self._file: BinaryIO = path.open('wb')
        except OSError as error:
            raise PlantError(f'the recording cannot be written: {error}') from error
        np.save(self._file, np.frombuffer(plant.text.encode(), dtype=np.uint8))

    def record(self, time: float) -> None:
        """
        Write the plant's current state if a record is due.

        :param time: time of the state [s].
        """
        if time < self._next:
            return
        self._next = time + self._period
        model, data = self._plant.model, self._plant.data
        pieces = (model.geom_size[:, 1], model.geom_pos[:, 0])
        np.save(self._file, np.concatenate([[time], data.qpos, *pieces]))
        self._file.flush()

    def close(self) -> None:
        """Close the file of the recording."""
        self._file.close()


@dataclass(frozen=True, eq=False)
class PlantRecording:
    """Recorded states of a MuJoCo plant."""

    text: str  #: text of the model (MJCF)
    times: Array  #: (n,) times of the states, increasing [s]
    #: (n, k) states as rows; each consists of MuJoCo's coordinates, the second component of the
    #: size of each geom, and the first component of the position of each geom
    states: Array

    def at(self, time: float) -> Array:
        """
        Return the last state (k,) at or before a time; the first state if none is earlier.

        :param time: time on the clock of the recording [s].
        """
        place = int(np.searchsorted(self.times, time, side='right')) - 1
        return self.states[max(place, 0)]


def read_recording(path: Path) -> PlantRecording:
    """
    Read a recording, without its last state if the last state is incomplete.

    :param path: path of the file.
    :raises PlantError: the file cannot be read, or has no state.
    """
    rows: list[Array] = []
    try:
        with path.open('rb') as file:
            text = np.load(file).tobytes().decode()
            while file.peek(1):
                try:
                    rows.append(np.load(file))
                except (ValueError, EOFError):
                    break
    except (OSError, ValueError, EOFError) as error:
        raise PlantError(f'{path} is not a recording of a plant: {error}') from error
    if not rows:
        raise PlantError(f'{path}: the recording contains no state')
    states = np.array(rows)
    return PlantRecording(text, states[:, 0], states[:, 1:])
