# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pages of the API reference: one for the public API, one for each package of the core."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path
import pkgutil
import re

from isotruss_ros import core
from isotruss_ros.core.holding import newton
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.model.robot_schema import ranged_numbers
from isotruss_ros.dataset.columns import COLUMNS
from node_pages import markdown_table

#: File with the example at the head of each page, one section for each.
EXAMPLES = Path(__file__).with_name('package_examples.md')
EXAMPLE = re.compile(r'^## (\w+)\n\n```python\n(.*?)\n```', re.MULTILINE | re.DOTALL)


def facade_table() -> str:
    """Return a table of the public names of `isotruss_ros.core` with their summaries."""
    rows = []
    for name in core.__all__:
        thing = getattr(core, name)
        target = f'{thing.__module__}.{thing.__qualname__}'
        summary = inspect.getdoc(thing).split('\n\n')[0].replace('\n', ' ')
        rows.append((f'[`core.{name}`](#{target})', summary))
    return markdown_table(('name', 'what it is'), rows)


def range_table() -> str:
    """Return a table of the ranges of a robot file's numbers, with reasons, from its schema."""
    rows = [
        (
            f'`{key}`',
            f'{entry.get("minimum", 0):g} to {entry["maximum"]:g} {entry["unit"]}'.rstrip(),
            entry['reason'],
        )
        for key, entry in ranged_numbers().items()
    ]
    return markdown_table(('key', 'range', 'reason'), rows)


def column_table() -> str:
    """Return a table of the columns of a data set of grasps."""
    rows = [
        (f'`{name}`', column.axis or '1', column.unit, column.words)
        for name, column in COLUMNS.items()
    ]
    return markdown_table(('column', 'values for each grasp', 'unit', 'quantity'), rows)


def newton_table() -> str:
    """Return the steps of Newton's method from straight tubes to the disc of the example."""
    config = core.load_robot('nine_member').home
    body = core.ConvexObject.disc(core.tangent_center(config, 'north/Z', 0.3, 0.02), 0.3)
    grip = attach_grip(config, body)
    g, at = grip.alone.g, newton.Iterate.straight(grip.alone.g, deforms=False)
    rows = []
    for number in range(1, 6):
        linear = newton.linearize_at(g, at)
        after = newton.step(g, linear)
        at, gap = after.iterate, after.error[0] * newton.LENGTH_TOLERANCE
        squeeze = at.unknowns[0, g.places.normal].mean()
        rows.append((f'{number}', f'{gap:.1e}', f'{after.motion[0]:.1e}', f'{squeeze:.9f}'))
    header = 'step', 'largest residual before it [m]', 'motion of the tubes [m]', 'squeeze [N]'
    return markdown_table(header, rows)


def write_pages(folder: Path) -> None:
    """
    Write a page for each package of the core: a sentence, an example, and all modules.

    :param folder: folder of the pages, which is created if necessary. Unchanged pages are not
        written.
    :raises ValueError: packages, pages and examples do not correspond.
    """
    folder.mkdir(exist_ok=True)
    packages = {info.name for info in pkgutil.iter_modules(core.__path__)}
    examples = dict(EXAMPLE.findall(EXAMPLES.read_text(encoding='utf-8')))
    if examples.keys() != packages:
        raise ValueError(
            f'{EXAMPLES.name} has no section, or a section without a package of the core: '
            f'{", ".join(sorted(examples.keys() ^ packages))}'
        )
    for name, example in examples.items():
        path = folder / f'{name}.rst'
        text = _page(f'{core.__name__}.{name}', example)
        if not path.exists() or path.read_text(encoding='utf-8') != text:
            path.write_text(text, encoding='utf-8')


def _page(package: str, example: str) -> str:
    """Return the page of a package or of a single module."""
    module = importlib.import_module(package)
    title = package.removeprefix('isotruss_ros.')
    code = [
        '.. code-block:: python',
        '',
        *(f'   {line}'.rstrip() for line in example.splitlines()),
    ]
    parts = [title, '=' * len(title), '']
    if not hasattr(module, '__path__'):
        parts += [*code, '', f'.. automodule:: {package}', '   :show-inheritance:', '']
        return '\n'.join(parts)
    parts += [inspect.getdoc(module), '', *code, '', f'.. py:module:: {package}', '']
    for info in pkgutil.iter_modules(module.__path__):
        parts += [info.name, '-' * len(info.name), '']
        parts += [f'.. automodule:: {package}.{info.name}', '']
    return '\n'.join(parts)


def escape_docstring(lines: list[str]) -> None:
    """
    Escape characters of docstrings that reStructuredText would interpret as markup.

    :param lines: lines of a docstring, which are changed in place. Indented blocks after `::` are
        not changed.
    """
    literal = False
    for i, line in enumerate(lines):
        if line and not line.startswith(' '):
            literal = False
        if not literal:
            pieces = line.split('`')
            pieces[::2] = [_escape(piece) for piece in pieces[::2]]
            lines[i] = '`'.join(pieces)
        if line.endswith('::'):
            literal = True


def _escape(text: str) -> str:
    for character in '|*':
        text = text.replace(character, f'\\{character}')
    return text.replace('_ ', '\\_ ')
