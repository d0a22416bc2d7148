# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Configuration of the documentation: `make docs`, or rosdoc2 by `rosdoc2.yaml`.

Both need what requirements-docs.txt names, and viser, mcap and rosbags.
"""

from pathlib import Path
import sys
import xml.etree.ElementTree as ElementTree

import isotruss_ros

TOP = Path(isotruss_ros.__file__).resolve().parents[1]
# rosdoc2 executes a copy of this file from a folder of its own.
sys.path.insert(0, str(TOP / 'docs' / '_ext'))

_manifest = ElementTree.parse(TOP / 'package.xml').getroot()
project = _manifest.findtext('name')
author = _manifest.findtext('maintainer')
copyright = f'{author}; {_manifest.findtext("license")}'
version = release = _manifest.findtext('version')

extensions = [
    'myst_parser',
    'sphinx.ext.autodoc',
    'sphinx.ext.viewcode',
    'sphinx.ext.mathjax',
    'sphinx-mathjax-offline',  # brings MathJax along: formulas need no network
    'sphinx_copybutton',
    'isotruss_site',
]
source_suffix = {'.md': 'markdown', '.rst': 'restructuredtext'}
# From the third on: what rosdoc2 adds; the reference and the pages of this site have it already.
exclude_patterns = ['_build', '_ext', 'isotruss_ros*.rst', 'modules.rst', 'standard*', '__*']
smartquotes_action = 'D'
html_theme = 'furo'
html_title = f'{project} {version}'
html_static_path = ['_static']
html_css_files = ['site.css']
html_js_files = ['fit_formulas.js']
copybutton_exclude = '.linenos, .gp, .go'

# Formulas as a code host reads them: $x$ in lines, fenced blocks of `math`.
myst_enable_extensions = ['dollarmath']
myst_fence_as_directive = ['math']
myst_heading_anchors = 3

# Docstrings write names in single backticks.
default_role = 'code'
autodoc_default_options = {'members': True}
autodoc_member_order = 'bysource'
autodoc_preserve_defaults = True
# A source page links back to where a name is documented, not to a constant of its type elsewhere.
viewcode_follow_imported_members = False
autodoc_typehints_format = 'short'
autodoc_type_aliases = {name: name for name in ('Array', 'ArrayLike', 'Flags', 'Indices')}
add_module_names = False
# Types of other packages are not linked, nor type variables; links to names of this one must hold.
nitpick_ignore_regex = [('py:.*', r'(?!isotruss_ros\.).*'), ('py:class', r'.*\.(GripT|R|P|F|S|T)')]
