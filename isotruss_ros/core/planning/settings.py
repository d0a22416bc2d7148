# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Settings of the search for grasps."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchSettings:
    """
    How the search for grasps proceeds; lengths are relative, so that they fit robots of any size.

    :ivar random_cones: smallest and largest friction cones of random grips, as shares of all of
        them.
    :ivar random_posture: standard deviation of the nominal roller positions, against the mean
        length of members at home.
    :ivar max_rounds: number of rounds.
    :ivar standoff: gap of the grasping members at the end of the approach, against the tube's
        diameter.
    :ivar standoff_tolerance: of that gap, against the tube's diameter.
    :ivar max_approach_steps: number of steps of an approach.
    :ivar max_idle_steps: an approach ends after more steps in a row than this without progress.
    :ivar min_progress: of such steps, in diameters of the tube plus radians of turning.
    :ivar max_step: longest step of a roller, against the mean length of members at home.
    :ivar max_gap_step: largest change of a gap in a step, against the same.
    :ivar max_turn_step: largest turn of a member in a step [rad].
    :ivar motion_weight: weight of the rollers' motion against that of the gaps.
    :ivar turning_arm: a gap of 1 m weighs as much as this many metres times a turn of 1 rad [m].
    :ivar bound_share: a step uses at most this share of the distance from a bound.
    :ivar clearance: of parts that must not touch the object, against the tube's diameter.
    :ivar self_clearance: of parts of the robot, against the mean length of members at home.
    :ivar near: parts of the robot closer than this are constrained, against the same.
    :ivar modes: number of singular values that are constrained.
    :ivar kept_clearance: share of the clearance that remains after a step of finite length.
    :ivar overshoot: of a grasping member beyond its target, against the tube's diameter.
    :ivar max_halvings: how often a step that violates a requirement is halved.
    :ivar first_contact: indentation with which an object is held first, against the tube's
        diameter.
    :ivar face_contact: the same where a face is to lie on a member: it is touched at both ends.
    :ivar max_displacement: of the object while a grip closes whose robot has not the rollers to
        keep it in place, against the tube's diameter.
    :ivar max_depth: deepest mean indentation on the ground, against the tube's diameter.
    :ivar max_balance_steps: number of steps that balance the members at one mean indentation.
    :ivar max_press_steps: number of steps to one set of indentations.
    :ivar max_share: largest indentation of a member against the mean one; the inverse is the
        smallest.
    :ivar same_share: grasps of the same members are the same where no roller differs by more than
        this, against the mean length of members at home.
    :ivar max_grips: that are tried in a round, the easiest first.
    :ivar cone_share: of the friction cones that grips are to use at most as they close.
    :ivar used_share: of the friction cones that they use at most where they are open.
    :ivar turning_price: angle of friction that is given up for a smaller turn of the members [-].
    :ivar closing_step: by how much two members close from waypoint to waypoint, on the ground
        every member, against the tube's diameter.
    :ivar squeeze_growth: of three members from waypoint to waypoint, at most this factor ...
    :ivar squeeze_rise: ... and this much more [N].
    :ivar refinement: such steps become shorter by this factor where a bound ends them ...
    :ivar least_share: ... while they are longer than this share of themselves.
    :ivar poll_interval: how often a request to stop is checked while workers compute [s].
    """

    random_cones: tuple[float, float] = (0.5, 1.0)
    random_posture: float = 0.3
    max_rounds: int = 5
    standoff: float = 0.06
    standoff_tolerance: float = 0.02
    max_approach_steps: int = 100
    max_idle_steps: int = 12
    min_progress: float = 0.02
    max_step: float = 0.035
    max_gap_step: float = 0.027
    max_turn_step: float = 0.1
    motion_weight: float = 1e-4
    turning_arm: float = 0.3
    bound_share: float = 0.5
    clearance: float = 0.1
    self_clearance: float = 0.01
    near: float = 0.15
    modes: int = 2
    kept_clearance: float = 0.5
    overshoot: float = 0.015
    max_halvings: int = 5
    first_contact: float = 1e-3
    face_contact: float = 1e-2
    max_displacement: float = 0.25
    max_depth: float = 0.8
    max_balance_steps: int = 6
    max_press_steps: int = 15
    max_share: float = 10.0
    same_share: float = 0.02
    max_grips: int = 8
    cone_share: float = 0.75
    used_share: float = 0.85
    turning_price: float = 0.3
    closing_step: float = 0.12
    refinement: float = 0.34
    least_share: float = 0.3
    squeeze_growth: float = 2.0
    squeeze_rise: float = 4.0
    poll_interval: float = 0.05


DEFAULT = SearchSettings()
