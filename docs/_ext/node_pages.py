# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Interface tables for the pages of the nodes, in Markdown."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
import functools
from pathlib import Path
import re
from typing import Any

from interfaces import Entity, Interface, interfaces

INTERFACES_HEAD = """\
<!-- Written by `make docs` from msg_defs/. -->
# Messages, services and actions

These are the files of the interface package `isotruss_msgs`, in `msg_defs/`. A field `message`
contains a sentence that says what is wrong and what would be right. An action has succeeded only
if its code is 0. The name `t/j` belongs to a module, `t/j-k` to a member ([names](robot_file.md)).

Everything is planar. A pose is refused if it is tilted by more than 5 degrees, or more than 0.3 m,
out of the robot's plane, and a twist if it has components other than linear.x, linear.y and
angular.z. Of wrenches only these components are used, of joint markers only x and y; obstacles may
have any height."""

#: Notes on topics, for pages that have no other note on them.
COMMON_NOTES = {
    'joint_states': 'roller travel since home [m] by roller name',
    'state_estimate': 'roller offsets by [state_estimator](state_estimator.md), if that node runs',
    'object_pose': 'measured pose of the object, in a frame that [tf2 connects](index.md#frames)',
    'joint_markers': 'measured joints, in a frame that [tf2 connects](index.md#frames)',
    'tube_pressures': 'pressure of the tube named by `frame_id` [Pa]; see `ambient_pressure`',
}

#: Headings of sections, and the attributes of an interface in each.
SECTIONS = {
    'Subscribed topics': 'subscribed',
    'Published topics': 'published',
    'Services': 'services',
    'Actions': 'actions',
}


@functools.cache
def all_interfaces() -> dict[str, Interface]:
    """Return the interfaces of all nodes from a cache."""
    return interfaces()


def node_tables(node: str, notes: dict[str, str]) -> str:
    """
    Return the sections of a node: topics, services, actions, parameters.

    :param node: name of the node's executable.
    :param notes: notes on topics, services and actions besides `COMMON_NOTES`; if a name is both
        subscribed and published, both rows get its note.
    :raises ValueError: a name has no note, or a note has an unknown name.
    """
    interface = all_interfaces()[node]
    names = {name for part in SECTIONS.values() for name in getattr(interface, part)}
    common = {name: COMMON_NOTES[name] for name in names & COMMON_NOTES.keys()}
    notes = common | notes
    if names != notes.keys():
        wrong = ', '.join(sorted(names ^ notes.keys()))
        raise ValueError(f'node {node}: notes and declared names differ by {wrong}')
    parts = []
    for heading, attribute in SECTIONS.items():
        entities = getattr(interface, attribute)
        if entities:
            parts += [f'## {heading}', _entities(entities, notes)]
    rows = (
        (f'`{p.name}`', f'`{_shown(p.default)}`', p.range, p.when, p.description)
        for p in interface.parameters
    )
    head = ('parameter', 'default', 'range', 'can be set', 'meaning')
    return '\n\n'.join([*parts, '## Parameters', markdown_table(head, rows)])


def quality_table() -> str:
    """Return the qualities of service of all topics, for publishers and subscribers."""
    published: dict[str, list[str]] = {}
    subscribed: dict[str, list[str]] = {}
    for interface in all_interfaces().values():
        for entities, found in (
            (interface.published, published),
            (interface.subscribed, subscribed),
        ):
            for name, entity in entities.items():
                kept = found.setdefault(name, [])
                kept += [words for words in entity.qos if words not in kept]
    rows = (
        (f'`{name}`', '; '.join(published.get(name, ())), '; '.join(subscribed.get(name, ())))
        for name in sorted({*published, *subscribed})
    )
    return markdown_table(('topic', 'publishers', 'subscribers'), rows)


def interface_files(folder: Path) -> str:
    """
    Return the page of messages, services and actions, with a section for each.

    :param folder: folder of the interface package.
    """
    parts = [INTERFACES_HEAD]
    for path in sorted(folder.glob('*/*.*')):
        if path.suffix in ('.msg', '.srv', '.action'):
            text = path.read_text(encoding='utf-8').strip()
            parts += [f'## {path.stem}', f'`isotruss_msgs/{path.parent.name}/{path.stem}`']
            parts.append(f'```text\n{text}\n```')
    return '\n\n'.join(parts) + '\n'


def markdown_table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown; bars in cells are escaped."""
    lines = [list(head)]
    lines.append(['---'] * len(lines[0]))
    lines += [[str(cell).replace('|', '\\|') for cell in row] for row in rows]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def _entities(entities: dict[str, Entity], notes: dict[str, str]) -> str:
    """Return the table of a section."""
    rows = (
        (f'`{name}`<br>{" or ".join(map(_type, entity.types))}', notes[name])
        for name, entity in sorted(entities.items())
    )
    return markdown_table(('name and type', 'meaning'), rows)


def _type(full: str) -> str:
    """Return the name of a type, linked if it is a type of this package."""
    package, name = full.split('/')
    if package != 'isotruss_msgs':
        return f'`{full}`'
    anchor = re.sub(r'\W', '', name).lower()
    return f'[`{full}`](/interfaces.md#{anchor})'


def _shown(value: Any) -> str:
    """Return a value as in a parameter file."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f'{value:g}' if value != int(value) else f'{value:.1f}'
    if isinstance(value, array):
        return repr(value.tolist())
    return repr(value) if isinstance(value, str | list) else str(value)
