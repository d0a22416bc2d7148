# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Run a notebook without Jupyter: its cells in order, and what each prints, returns and draws.

`python tools/notebooks.py NOTEBOOK` runs it and writes it again, with these outputs.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
from pathlib import Path
import re
import sys
from typing import Any

import matplotlib as mpl


def run(path: str | Path) -> dict[str, Any]:
    """Return a notebook with the outputs of its cells."""
    mpl.use('Agg')
    notebook, names = json.loads(Path(path).read_text(encoding='utf-8')), {}
    count = 0
    for cell in notebook['cells']:
        if cell['cell_type'] == 'code':
            count += 1
            printed, value = _run_cell(''.join(cell['source']), names, f'{path}, cell {count}')
            cell['execution_count'] = count
            cell['outputs'] = [*_stream(printed), *_result(value, count)]
    return notebook


def _run_cell(source: str, names: dict[str, Any], place: str) -> tuple[str, Any]:
    """
    Return the printed text of a cell, and the value of its last line if it is an expression.

    Magic commands, such as `%matplotlib inline`, are for Jupyter alone.
    """
    source = re.sub('^%.*$', '', source, flags=re.MULTILINE)
    tree, last = ast.parse(source, place), None
    if isinstance(tree.body[-1], ast.Expr):
        last = ast.Expression(tree.body.pop().value)
    printed, value = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, place, 'exec'), names)
        if last is not None:
            value = eval(compile(last, place, 'eval'), names)
    return printed.getvalue(), value


def _stream(text: str) -> list[dict[str, Any]]:
    lines = text.splitlines(keepends=True)
    return [{'name': 'stdout', 'output_type': 'stream', 'text': lines}] if lines else []


def _result(value: Any, count: int) -> list[dict[str, Any]]:
    if value is None:
        return []
    data = {'text/plain': repr(value).splitlines(keepends=True)}
    if hasattr(value, 'savefig'):
        picture = io.BytesIO()
        value.savefig(picture, format='png', metadata={'Software': None})
        data = {'image/png': base64.b64encode(picture.getvalue()).decode(), **data}
        data['text/plain'] = ['<Figure>']
    elif hasattr(value, '_repr_html_'):
        data['text/html'] = value._repr_html_().splitlines(keepends=True)
    return [
        {'data': data, 'execution_count': count, 'metadata': {}, 'output_type': 'execute_result'}
    ]


if __name__ == '__main__':
    made = run(sys.argv[1])
    Path(sys.argv[1]).write_text(
        json.dumps(made, indent=1, ensure_ascii=False) + '\n', encoding='utf-8'
    )
