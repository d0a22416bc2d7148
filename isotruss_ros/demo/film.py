# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Animation of the demonstration, rendered by MuJoCo from recorded states of its plant."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from isotruss_ros.demo.figures import FRAMES_PER_SECOND, PULL_SCALE, SPEED_UP
from isotruss_ros.demo.record import PhaseRecord
from isotruss_ros.mujoco_plant.recording import read_recording
from isotruss_ros.mujoco_plant.rendering import ARROW_COLOR, LINE_COLOR, PlantRenderer
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

#: Width and height of a frame, height of the letters, and margin of the text [pixels].
WIDTH, HEIGHT, LETTER_HEIGHT, TEXT_MARGIN = 560, 500, 18, 10
TEXT_COLOR = (40, 40, 40)
#: Number of colours of the animation, and number of frames from which they are chosen [-].
COLORS, SAMPLES = 128, 12
SHADES = (0.4, 0.55, 0.7, 0.85, 1.0)
#: Smallest distance between the measured positions that are connected to draw the path [m].
MIN_PATH_SPACING = 0.005


def film(recording: Path, records: Sequence[PhaseRecord], path: Path) -> None:
    """Write the whole motion as an animated GIF, rendered by MuJoCo."""
    states = read_recording(recording)
    frames: list[Image.Image] = []
    passed: list[tuple[float, float]] = []
    with PlantRenderer(states, WIDTH, HEIGHT) as renderer:
        for record in records:
            times = np.array([snap.time for snap in record.snapshots])
            step = max(1, round(SPEED_UP / FRAMES_PER_SECOND / _period(times)))
            for snap in record.snapshots[::step]:
                here, arrow = np.array(snap.pose[:2]), None
                if not passed or np.hypot(*(here - passed[-1])) > MIN_PATH_SPACING:
                    passed.append(snap.pose[:2])
                if record.pull is not None and record.pulled[0] <= snap.time <= record.pulled[1]:
                    tip = here + PULL_SCALE * np.array(record.pull[:2])
                    arrow = (tuple(here), tuple(tip))
                picture = renderer.draw(snap.time, [*passed, snap.pose[:2]], arrow)
                frames.append(_label(picture, record, arrow is not None))
    palette = _palette(frames)
    pages = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    duration = 1000.0 / FRAMES_PER_SECOND
    pages[0].save(path, save_all=True, append_images=pages[1:], duration=duration, loop=0)


def _palette(frames: Sequence[Image.Image]) -> Image.Image:
    """Return a picture with a colour palette for the whole animation."""
    chosen = frames[:: max(1, len(frames) // SAMPLES)]
    together = np.concatenate([np.asarray(frame) for frame in chosen])
    # The quantizer leaves out what is thin: path and arrow, in light and in shade.
    thin = np.outer(SHADES, [*LINE_COLOR[:3], *ARROW_COLOR[:3]]).ravel()
    own = (255.0 * thin).astype(int).tolist()
    common = COLORS - len(own) // 3
    colors = Image.fromarray(together).quantize(common).getpalette()[: 3 * common]
    palette = Image.new('P', (1, 1))
    palette.putpalette(colors + own)
    return palette


def _period(times: NDArray[np.float64]) -> float:
    """Return the mean time between two measurements [s]."""
    return float(times[-1] - times[0]) / max(1, len(times) - 1) or 1.0


def _label(picture: NDArray[np.uint8], record: PhaseRecord, pulled: bool) -> Image.Image:
    """Return a frame with the name of the phase, and a text while an external force acts."""
    frame = Image.fromarray(picture)
    draw, font = ImageDraw.Draw(frame), ImageFont.load_default(LETTER_HEIGHT)
    words = record.name
    if pulled and record.pull is not None:
        words += f', pulled with {np.hypot(*record.pull[:2]):g} N'
    draw.text((TEXT_MARGIN, TEXT_MARGIN), words, TEXT_COLOR, font)
    speed = f'MuJoCo, {SPEED_UP:g} times as fast'
    draw.text((WIDTH - TEXT_MARGIN, TEXT_MARGIN), speed, TEXT_COLOR, font, anchor='ra')
    return frame
