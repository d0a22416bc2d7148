# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Sphinx extension that generates parts of the pages from the code.

A fenced block whose info string is one of `BLOCKS` is replaced before the page is parsed. So
headings in the generated text are headings of the page.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import re

import equations
import isotruss_ros
from isotruss_ros.cli import replay
import node_pages
import promises
import reference
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

TOP = Path(isotruss_ros.__file__).resolve().parents[1]
FENCE = re.compile(r'^```\{([\w-]+)\}(.*)\n((?:(?!```).*\n)*?)```$', re.MULTILINE)

#: Recording that the page of a carry plays, below the sources.
CARRY = Path('images', 'carry.mcap')

#: Functions that generate the blocks, from a block's argument and its lines.
BLOCKS: dict[str, Callable[[str, str], str]] = {
    'node-interface': lambda node, text: node_pages.node_tables(node, notes(text)),
    'quality-of-service': lambda _argument, _text: node_pages.quality_table(),
    'plausible-ranges': lambda _argument, _text: reference.range_table(),
    'dataset-columns': lambda _argument, _text: reference.column_table(),
    'newton-steps': lambda _argument, _text: reference.newton_table(),
    'core-names': lambda _argument, _text: reference.facade_table(),
    'promised-tests': lambda path, _text: promises.appendix(TOP / path, TOP / 'test'),
    'source-file': lambda path, _text: source_file(TOP / path),
    'repository-page': lambda path, _text: repository_page(TOP / path),
}


def notes(text: str) -> dict[str, str]:
    """Return the notes of lines `name: note` by name; an indented line continues a note."""
    found: dict[str, str] = {}
    for line in text.splitlines():
        if line.startswith(' '):
            found[next(reversed(found))] += f' {line.strip()}'
        elif line.strip():
            name, _, note = line.partition(': ')
            found[name] = note.strip()
    return found


def source_file(path: Path) -> str:
    """Return a file of the repository as a code block, without its licence notice."""
    language = {'.py': 'python', '.yaml': 'yaml'}.get(path.suffix, 'text')
    text = path.read_text(encoding='utf-8')
    if text.startswith('# Copyright'):
        text = text.partition('\n\n')[2]
    return f'```{language}\n{text.strip()}\n```'


def repository_page(path: Path) -> str:
    """Return a page of the repository's top folder, with its links relative to the site."""
    return path.read_text(encoding='utf-8').replace('](docs/', '](').strip()


def expand(text: str, page: str) -> str:
    """
    Return a page with its blocks generated.

    :param text: source of the page.
    :param page: name of the page, for messages.
    :raises ExtensionError: a block cannot be generated.
    """

    def replace(match: re.Match[str]) -> str:
        kind, argument, lines = match.groups()
        if kind not in BLOCKS:
            return match[0]
        try:
            return BLOCKS[kind](argument.strip(), lines)
        except (ValueError, KeyError, OSError) as error:
            raise ExtensionError(f'{page}: {kind} {argument.strip()}: {error}') from error

    return equations.link_reference(promises.link_roles(FENCE.sub(replace, text)))


def _read(_app: Sphinx, page: str, source: list[str]) -> None:
    source[0] = expand(source[0], page)


def _begin(app: Sphinx) -> None:
    reference.write_pages(Path(app.srcdir) / 'api')


def _write_carry(app: Sphinx, failed: Exception | None) -> None:
    """Write the page that plays the recorded carry."""
    recording, page = Path(app.srcdir) / CARRY, Path(app.outdir) / 'carry_recording.html'
    arguments = [str(recording), '--speed', '2', '--port', '0', '--page', str(page)]
    if failed is None and app.builder.format == 'html' and replay.main(arguments) != 0:
        raise ExtensionError(f'{recording}: cannot be played')


def _docstring(
    _app: Sphinx, _what: str, _name: str, _thing: object, _options: object, lines: list[str]
) -> None:
    reference.escape_docstring(lines)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the extension to Sphinx."""
    app.connect('builder-inited', _begin)
    app.connect('source-read', _read)
    app.connect('autodoc-process-docstring', _docstring)
    app.connect('build-finished', _write_carry)
    return {'parallel_read_safe': False, 'parallel_write_safe': True}
