# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Pages that are generated and committed, because a code host shows only committed pages.

`python docs/_ext/committed_pages.py` writes them. A test compares them with the generated text.
"""

from __future__ import annotations

from pathlib import Path

import equations
import node_pages

TOP = Path(__file__).resolve().parents[2]


def pages() -> dict[Path, str]:
    """Return the text of the pages by their files."""
    statements = Path(__file__).with_name('paper_equations.yaml')
    return {
        TOP / 'docs' / 'equations.md': equations.page(TOP / 'isotruss_ros' / 'core', statements),
        TOP / 'docs' / 'interfaces.md': node_pages.interface_files(TOP / 'msg_defs'),
    }


if __name__ == '__main__':
    for path, text in pages().items():
        # What is as it should be stays as it is: `make colcon` may copy it at this moment.
        if not path.exists() or path.read_text(encoding='utf-8') != text:
            path.write_text(text, encoding='utf-8')
