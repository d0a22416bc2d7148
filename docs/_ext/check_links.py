# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Check that each internal link of the built site has its page and its anchor."""

from __future__ import annotations

from functools import cache
from html.parser import HTMLParser
from pathlib import Path
import sys
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """The links and anchors of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors = {''}
        self.feed(path.read_text(encoding='utf-8'))

    def handle_starttag(self, _tag: str, attributes: list[tuple[str, str | None]]) -> None:
        """Record the links of an element, and its anchors."""
        for name, value in attributes:
            if name in ('href', 'src') and value:
                self.links.append(value)
            elif name in ('id', 'name') and value:
                self.anchors.add(value)


@cache
def load(path: Path) -> Page:
    """Return a page from a cache."""
    return Page(path)


def broken_links(site: Path) -> list[str]:
    """
    Return the broken internal links, as `page: link`.

    :param site: folder of the built site.
    """
    broken = []
    for path in sorted(site.rglob('*.html')):
        for link in load(path).links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = path.parent / unquote(parts.path) if parts.path else path
            found = target.exists()
            if found and target.suffix == '.html':
                found = unquote(parts.fragment) in load(target.resolve()).anchors
            if not found:
                broken.append(f'{path.relative_to(site)}: {link}')
    return broken


if __name__ == '__main__':
    problems = broken_links(Path(sys.argv[1]))
    print(*problems, sep='\n', end='', file=sys.stderr)
    sys.exit(bool(problems))
