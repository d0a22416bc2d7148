# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Promises of the safety page, and the tests of them."""

from __future__ import annotations

from pathlib import Path
import re

from ruamel.yaml import YAML

#: Role after a promise in the text: {promise}`name`.
ROLE = re.compile(r'\{promise\}`([\w-]+)`')


def promised(page: str) -> list[str]:
    """Return the names of the promises on a page, in its order."""
    return ROLE.findall(page)


def load(path: Path) -> dict[str, list[str]]:
    """
    Return the tests, `file::function`, of each promise.

    :param path: path of the YAML file that maps promises to tests.
    """
    return YAML(typ='safe').load(path)


def link_roles(page: str) -> str:
    """Return a page whose promises are linked to their tests in the appendix."""
    return ROLE.sub(lambda match: f'<sup>[tests](#tests-{match[1]})</sup>', page)


def appendix(path: Path, tests: Path) -> str:
    """
    Return the promises with their tests, as Markdown.

    :param path: path of the YAML file that maps promises to tests.
    :param tests: folder of the tests.
    """
    files = {file.stem: file.relative_to(tests.parent) for file in tests.rglob('test_*.py')}
    parts = []
    for name, held_by in load(path).items():
        parts.append(f'(tests-{name})=\n**{name}**\n')
        for test in held_by:
            file, _, function = test.partition('::')
            parts.append(f'- `{files[file].as_posix()}::{function}`')
        parts.append('')
    return '\n'.join(parts)
