# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Panels with status texts, and with plots of squeeze and pose error over time."""

from __future__ import annotations

import html
import re

from isotruss_ros.viewer.arrows import arrow_of
from isotruss_ros.viewer.camera import STATE_CLASS
from isotruss_ros.viewer.picture import (
    EMPTY_CURVE,
    HISTORY_DURATION,
    Hold,
    Picture,
    trim_start,
)
import numpy as np
import viser
from viser import uplot

#: Number of updates of the texts for each update of the plots, which cause most of the network
#: traffic [-].
PLOT_INTERVAL = 5
LEGEND = """\
A truss robot of inflated tubes, seen from above; roller modules at its corners drive along them.

- tubes: blue, grey, orange from 0.8 of the moment at which they wrinkle, red where they do
- object: green held, red not held, lilac free (it touches nothing), grey unknown
- arrows: forces of the tubes on it; yellow stripes: where they touch
- margin of the hold: the least further force at which a tube slips, along its arrow; ↺ ↻: moments
- brown: supports; a box cannot move, a ball slides
- teal: obstacles, pale if no message has them any more; pink: planned path
- with *control* on: drag the blue ball; the object or joint moves to it, also after you let go;
  the orange ball turns the object
- *add obstacle*, then a click: places an obstacle; drag it by its dark ball
- *stop* works always; *release the stop* only with *control* on
- *resume* continues after the object has slipped
- *reset* begins anew: the simulated robot at home, the object held
"""


class Panels:
    """Panels with status texts and plots beside the scene."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._state = server.gui.add_html('')
        self._words = server.gui.add_markdown('')
        self._squeeze = self._add_plot(server, 'squeeze', 'N')
        self._error = self._add_plot(server, 'pose error', 'mm')
        with server.gui.add_folder('what is shown', expand_by_default=False):
            server.gui.add_markdown(LEGEND)
        self._shown, self._count = ('', ''), 0

    def update(self, picture: Picture, now: float) -> None:
        """Show the status texts and plots of a displayed state."""
        shown = describe_state(picture, now), describe(picture, now)
        if shown != self._shown:
            self._state.content, self._words.content = self._shown = shown
        picture.sample(now)
        self._count += 1
        if self._count % PLOT_INTERVAL:
            return
        time, squeeze, error = np.array(
            [s for s in picture.samples if now - s[0] <= HISTORY_DURATION]
        ).T
        self._squeeze.data = trim_start(time - now, squeeze)
        self._error.data = trim_start(time - now, 1e3 * error)

    def _add_plot(self, server: viser.ViserServer, name: str, unit: str) -> viser.GuiUplotHandle:
        return server.gui.add_uplot(
            EMPTY_CURVE,
            (uplot.Series(label='t'), uplot.Series(label=name, stroke='#1f4fd9', width=2)),
            title=f'{name} [{unit}]',
            scales={'x': uplot.Scale(time=False, auto=True), 'y': uplot.Scale(auto=True)},
            axes=(uplot.Axis(label='time [s]'), uplot.Axis(label=unit)),
            legend=uplot.Legend(show=False),
            aspect=2.4,
        )


def describe_state(picture: Picture, now: float) -> str:
    """Return a text in HTML with hold, slip margin and squeeze, and the next step after a halt."""
    step = html.escape(picture.describe_next_step(now))
    parts = [_describe_hold(picture, now), html.escape(picture.describe_squeeze(now))]
    lines = [', '.join(filter(None, parts)), step and f'<strong>{step}</strong>']
    return f'<div class="{STATE_CLASS}">{"<br>".join(filter(None, lines))}</div>'


def _describe_hold(picture: Picture, now: float) -> str:
    state = picture.state
    if not picture.is_fresh('state', now):
        return '<b>no grasp analysis</b>'
    hold = picture.hold(now)
    if hold is Hold.HELD:
        arrow = arrow_of(state.slip_direction)
        chance = f' with a chance of {state.chance:.2f}' if state.chance > 0.0 else ''
        return f'<b>held</b>{chance}, slip margin {state.slip_margin:.1f} N {arrow}'.rstrip()
    why = state.hold_message if hold is Hold.NOT_HELD else state.message
    return f'<b>{hold.value}</b>: {html.escape(why)}'


def describe(picture: Picture, now: float) -> str:
    """Return a text in Markdown with details of grasp and manipulation."""
    parts = [*_describe_grasp(picture, now), escape(picture.describe_manipulation(now))]
    parts.append(escape(picture.goal_report))
    if picture.is_fresh('object_pose', now):
        x, y, angle = picture.pose
        parts.append(f'object at ({x:.3f}, {y:.3f}) m, {np.degrees(angle):.1f}°')
    return '  \n'.join(filter(None, parts))


def _describe_grasp(picture: Picture, now: float) -> list[str]:
    state, hold = picture.state, picture.hold(now)
    parts: list[str] = []
    if hold in (Hold.UNKNOWN, Hold.FREE):
        return parts
    if hold is Hold.NOT_HELD:
        closed = {True: 'yes', False: 'no', None: 'unknown'}[state.force_closure]
        parts.append(f'force closure: {closed}')
    if state.utilisation is not None:
        used = max(state.utilisation, default=0.0)
        parts.append(f'utilisation {used:.2f} of the wrinkling moment')
    return [*parts, escape(state.message)]


def escape(text: str) -> str:
    """Return a text escaped for Markdown and HTML."""
    return re.sub(r'([!-/:-@\[-`{-~])', r'\\\1', text)
