"""The quality of service that the nodes ask of the middleware is the one that is written down."""

from pathlib import Path
import re

from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.grasp_planner import GraspPlanner
from isotruss_ros.nodes.manipulation import Manipulation
from isotruss_ros.nodes.path_follower import PathFollower
from isotruss_ros.nodes.roller_trajectory import RollerTrajectory
from isotruss_ros.nodes.simulator import Simulator
from isotruss_ros.nodes.teleop import Teleop
from probe import overrides, world
import pytest

pytestmark = pytest.mark.nodes

DOCUMENT = Path(__file__).parents[1] / 'docs' / 'safety.md'
KINDS = (
    Simulator,
    Manipulation,
    GraspAnalysisNode,
    PathFollower,
    RollerTrajectory,
    GraspPlanner,
    Teleop,
)
#: Of rclpy.
OTHERS = ('/rosout', '/parameter_events', '/transition_event')


def written():
    """Return (reliability, durability) of what is given and what is taken, by topic."""
    section = DOCUMENT.read_text().split('## Quality of service')[1].split('\n## ')[0]
    rows = [line.strip('| ').split(' | ') for line in section.splitlines() if line[:3] == '| `']
    found = {}
    for topics, given, taken, _why in rows:
        for topic in re.findall('`/?(.+?)`', topics):
            assert topic not in found
            found[topic] = (profiles(given), profiles(taken))
    return found


def profiles(words):
    """Return the profiles of a cell, without their depths: nobody tells those."""
    if words == 'by nobody':
        return set()
    return {tuple(profile.split(', ')[:2]) for profile in words.split('; ')}


def asked(w):
    """Return the same of what the nodes have; others, of tests before, may not be gone yet."""
    found, ours = {}, {node.get_name() for node in w.nodes} - {'probe'}
    for topic, _ in w.probe.get_topic_names_and_types():
        if topic.endswith(OTHERS):
            continue
        ends = (
            w.probe.get_publishers_info_by_topic(topic),
            w.probe.get_subscriptions_info_by_topic(topic),
        )
        found[topic[1:]] = tuple({named(e) for e in end if e.node_name in ours} for end in ends)
    return {topic: ends for topic, ends in found.items() if any(ends)}


def named(end):
    """Return the profile of an end of a topic in words."""
    policies = end.qos_profile.reliability, end.qos_profile.durability
    reliability, durability = (policy.name.lower() for policy in policies)
    return reliability.replace('_', '-'), durability.replace('_', ' ')


def test_topics_are_as_the_document_says():
    expected = written()
    assert len(expected) > 15
    with world(*(lambda kind=kind: kind(overrides(use_sim_time=True)) for kind in KINDS)) as w:
        w.until(lambda: asked(w).keys() >= expected.keys(), period=0.1)
        assert asked(w) == expected
