# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The notebook runs from top to bottom and shows what it was saved with."""

import json
from pathlib import Path

import notebooks
import pytest

NOTEBOOK = Path(__file__).parents[2] / 'examples' / 'held_object.ipynb'


@pytest.fixture(scope='module')
def both():
    """Return the notebook as it is saved, and as it runs."""
    return json.loads(NOTEBOOK.read_text(encoding='utf-8')), notebooks.run(NOTEBOOK)


def outputs(notebook, kind):
    """Return the outputs of a kind, cell after cell."""
    found = [output for cell in notebook['cells'] for output in cell.get('outputs', [])]
    return [output['data'].get(kind) if 'data' in output else output['text'] for output in found]


def test_it_prints_and_returns_what_it_was_saved_with(both):
    saved, run = both
    assert outputs(run, 'text/plain') == outputs(saved, 'text/plain')
    assert outputs(run, 'text/html') == outputs(saved, 'text/html')


def test_it_draws_the_held_object(both):
    _, run = both
    (picture,) = (each for each in outputs(run, 'image/png') if isinstance(each, str))
    assert len(picture) > 10_000
