# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Layouts of Foxglove, PlotJuggler, RViz and diagnostics name existing topics and fields."""

import importlib
import json
from pathlib import Path
import re

from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.runner import find_node
from node_pages import all_interfaces
import pytest
from ruamel.yaml import YAML

CONFIG = Path(__file__).parents[2] / 'config'
FOXGLOVE = json.loads((CONFIG / 'foxglove.json').read_text(encoding='utf-8'))
PANELS = FOXGLOVE['configById']


@pytest.fixture(scope='module')
def topics():
    """Return the types of all topics that the nodes publish, by their absolute name."""
    return {'/diagnostics': 'diagnostic_msgs/DiagnosticArray'} | {
        '/' + name.lstrip('/'): entity.types[0]
        for interface in all_interfaces().values()
        for name, entity in interface.published.items()
    }


def message(kind):
    """Return a message of a type such as sensor_msgs/JointState."""
    package, name = kind.split('/')[0], kind.split('/')[-1]
    return getattr(importlib.import_module(f'{package}.msg'), name)()


def check_path(path, topics):
    """Check that a path such as /grasp/state.squeeze[0] leads to a field of a topic."""
    topic, *fields = path.split('.')
    assert topic in topics, path
    value = message(topics[topic])
    for field in fields:
        name, indexed = re.fullmatch(r'(\w+)(\[\d+\])?', field).groups()
        assert hasattr(value, name), path
        value = getattr(value, name)
        assert not indexed or hasattr(value, '__len__'), path


def test_foxglove_shows_existing_topics_fields_and_services(topics):
    for panel in PANELS.values():
        for line in panel.get('paths', []):
            check_path(line['value'], topics)
        shown = [*panel.get('topics', {}), panel.get('topicPath'), panel.get('topicToRender')]
        assert {*filter(None, shown)} <= topics.keys()
    services = {name for part in all_interfaces().values() for name in part.services}
    assert PANELS['CallService!stop']['serviceName'].lstrip('/') in services


def test_plotjuggler_plots_existing_topics(topics):
    text = (CONFIG / 'plotjuggler.xml').read_text(encoding='utf-8')
    for curve in re.findall(r'<curve name="([^"]+)"', text):
        assert any(curve.startswith(f'{topic}/') for topic in topics), curve


def test_rviz_shows_relative_topics_of_the_nodes():
    layout = YAML(typ='safe').load((CONFIG / 'isotruss.rviz').read_text('utf-8'))
    displays = layout['Visualization Manager']['Displays']
    shown = {display['Topic']['Value'] for display in displays if 'Topic' in display}
    # RViz resolves relative names in its namespace, as the nodes do.
    published = set().union(*(interface.published for interface in all_interfaces().values()))
    assert 'grasp/markers' in shown
    assert shown <= published


def test_aggregator_has_every_managed_node_in_one_group():
    file = YAML(typ='safe').load(CONFIG / 'nodes' / 'diagnostic_aggregator.yaml')
    groups = [g for g in file['/**']['ros__parameters'].values() if isinstance(g, dict)]
    assert {group['type'] for group in groups} == {'diagnostic_aggregator/GenericAnalyzer'}
    names = [name for group in groups for name in group['contains']]
    managed = {name for name in all_interfaces() if issubclass(find_node(name), ManagedNode)}
    assert sorted(names) == sorted(managed - {'calibration'})
