# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The belief of a held object against drawn robots, poses, loads and walks."""

from copy import deepcopy
from dataclasses import replace
from functools import cache
from itertools import product

from carries import make_robot, place
from grips import gripped
from isotruss_ros.core import (
    Grip,
    HoldStatus,
    place_between,
    Polygon,
    Pose,
    Robot,
    settle_grasp,
)
from isotruss_ros.core.estimation.contact_walk import ContactWalk, PoseNoise
from isotruss_ros.core.estimation.grip_belief import DELAY_DEVIATION, GripBelief, MAX_DEVIATIONS
from isotruss_ros.core.estimation.grip_model import (
    attach_model,
    shift_deviations,
    shift_rates,
    SHIFTS,
)
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import MAX_FIRST_ORDER_TRAVEL
from nightly import some_now
import numpy as np
import pytest
from scipy.stats import chi2

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
GRIP = Grip.at_module(CONFIG.robot, 'north/Z', CYLINDER)
MODEL = attach_model(CONFIG, GRIP)
ARM = np.array([1.0, 1.0, MODEL.arm])
BOX_HOME = make_robot().home
PERIOD, FILTER_TIME = 0.05, 0.25
#: Travel of the rollers in a second [m].
TRAVEL = np.array([8e-3, -5e-3, 4e-3, -6e-3, 3e-3, -7e-3])


def believed(**settings):
    """Return a belief that begins at the equilibrium."""
    return GripBelief(MODEL, GRIP.moved_to(MODEL.pose), EstimatorSettings(**settings))


@cache
def rolled(count, period, speed):
    """Return the equilibrium after a count of periods of rolling there and back in a second."""
    if count == 0:
        return MODEL
    # There and back, faster and slower.
    way = np.sin(2.0 * np.pi * count * period) * speed * TRAVEL
    before = rolled(count - 1, period, speed)
    return roll_grip(before, CONFIG.moved_to(CONFIG.roller_positions + way))


def carry(
    belief,
    duration,
    noise=0.0,
    speed=0.0,
    late=0.0,
    away=None,
    encoders=0.0,
    period=PERIOD,
    age=0.0,
):
    """Roll, measure and correct; return the squared innovations."""
    rng, found, poses = np.random.default_rng(0), [], {}
    for k in range(1, round(duration / period) + 1):
        grasp = rolled(k % round(1.0 / period), period, speed)
        read = grasp.config.roller_positions + encoders * rng.normal(size=6)
        assert belief.follow(CONFIG.moved_to(read), period, None) is HoldStatus.HELD
        poses[k] = np.array(grasp.pose) if away is None else np.array(grasp.pose) + away
        seen = poses.get(k - round(late / period), poses[1])
        belief.observe(Pose(*seen + noise * rng.normal(size=3) / ARM), age)
        found.append(belief.state.innovation)
    return np.array(found)


@pytest.mark.parametrize(
    ('noise', 'speed'), some_now([*product((1e-3, 2e-4), (1.0, 0.0)), (3e-3, 1.0), (3e-3, 0.0)])
)
def test_median_squared_innovation_fits_three_degrees_of_freedom(noise, speed):
    found = carry(believed(), 8.0, noise, speed)
    assert (0.7 if noise > 3e-4 else 0.1) < np.median(found[60:]) < 5.0
    assert found.max() < 25.0


def test_error_of_the_squeeze_with_wrong_offsets_is_within_stated_deviations():
    surprises = []
    for seed in range(12):
        off = 0.005 * np.random.default_rng(seed).normal(size=6)
        model = attach_model(CONFIG.moved_to(CONFIG.roller_positions + off), GRIP)
        belief = GripBelief(model, GRIP, EstimatorSettings(zero_deviation=0.005, stiffness=0.0))
        surprises.append((belief.squeeze - MODEL.squeeze) / belief.squeeze_deviation)
    assert np.abs(surprises).max() < 3.0
    assert 0.3 < np.sqrt(np.mean(np.square(surprises))) < 1.5


def test_an_assumed_equilibrium_explains_no_part_of_the_measured_pose():
    measured = Pose(*np.add(MODEL.pose, (6e-3, -4e-3, 0.03)))
    belief = GripBelief(MODEL, GRIP.moved_to(measured), EstimatorSettings(), is_assumed=True)
    assert belief.pose == pytest.approx(measured, abs=1e-12)
    assert belief.squeeze == MODEL.squeeze


def test_the_slip_margin_is_that_of_contacts_before_they_slid():
    measured = np.add(MODEL.pose, (2e-3, -1e-3, 0.01))
    belief = GripBelief(MODEL, GRIP.moved_to(measured), EstimatorSettings())
    margin = MODEL.slip_margin(GRIP.friction)
    assert abs(belief.grasp.slip_margin(GRIP.friction) - margin) > 0.005 * margin
    assert belief.slip_margin == pytest.approx(margin, rel=1e-6)


@pytest.mark.parametrize(
    ('exists', 'hold'), [(True, HoldStatus.HELD), (False, HoldStatus.NO_BALANCE)]
)
def test_an_object_that_cannot_roll_is_held_if_a_search_finds_an_equilibrium(
    exists, hold, monkeypatch
):
    belief = believed()
    monkeypatch.setattr(belief.cache, 'roll', lambda *_: None)
    monkeypatch.setattr(belief, 'attach', lambda *_: exists)
    assert belief.follow(CONFIG, PERIOD, None) is HoldStatus.HELD
    assert belief.follow(CONFIG, PERIOD, None) is hold  # searched in the second cycle


def test_one_pose_tells_nothing_about_a_small_load():
    loads = np.diag(believed(load=0.03).state.covariance)[:3]
    assert np.sqrt(loads) == pytest.approx(0.03, rel=0.02)


def test_the_load_of_an_unmeasured_object_has_its_prior_deviation_again():
    belief = believed(load=1.3, load_time=0.2)
    variances = [np.diag(belief.state.covariance)[:3].max()]
    for duration in (0.1, 2.0):
        for _ in range(round(duration / PERIOD)):
            belief.follow(CONFIG, PERIOD, None)
        variances.append(np.diag(belief.state.covariance)[:3].max())
    assert variances[0] < variances[1] < variances[2]
    assert np.sqrt(np.diag(belief.state.covariance)[:3]) == pytest.approx(1.3, rel=1e-3)


def test_the_deviation_of_a_shift_is_twice_that_which_causes_slip():
    shifted = shift_rates(MODEL)
    friction = MODEL.required_friction + 0.05
    reserve = friction * MODEL.normal_forces - np.abs(MODEL.friction_forces)
    by_shift = shifted[MODEL.state.places.friction]
    for member, deviation in enumerate(shift_deviations(MODEL, shifted, friction)):
        assert 0.5 * deviation * abs(by_shift[member, member]) == pytest.approx(reserve[member])
        assert deviation < MODEL.arm


def test_a_slip_in_the_model_starts_a_search_after_the_correlation_time_of_loads(monkeypatch):
    slippery, times = replace(GRIP, friction=0.9 * MODEL.required_friction), []
    belief = GripBelief(MODEL, slippery, EstimatorSettings(load_time=0.3))
    monkeypatch.setattr(belief, 'attach', lambda *_: times.append(belief.lag.time))
    for _ in range(20):
        assert belief.follow(CONFIG, 0.02, None) is HoldStatus.HELD
    assert 0.3 < times[0] < 0.35


@pytest.mark.parametrize(('is_assumed', 'share'), [(False, 1.0), (True, 0.7)])
def test_an_assumed_start_shows_earlier_that_nothing_is_gripped(is_assumed, share):
    grip = GRIP.moved_to(MODEL.pose)
    belief = GripBelief(MODEL, grip, EstimatorSettings(), is_assumed=is_assumed)
    for deviations, slipped in ((0.99 * share, False), (1.01 * share, True)):
        belief.state.walk.deviations = deviations * MAX_DEVIATIONS
        assert belief.slipped is slipped


@pytest.mark.parametrize(('share', 'same'), [(0.9, True), (1.1, False)])
def test_derivatives_by_offsets_are_those_of_an_equilibrium_within_first_order(share, same):
    belief = believed()
    differentiated = belief.cache.by_offsets.grasp
    step = share * MAX_FIRST_ORDER_TRAVEL * np.sign(TRAVEL)
    belief.follow(CONFIG.moved_to(CONFIG.roller_positions + step), PERIOD, None)
    assert (belief.cache.by_offsets.grasp is differentiated) is same
    assert belief.grasp is not differentiated


def test_an_assumed_squeeze_is_an_error_of_the_squeeze():
    belief = believed(squeeze_error=0.0)
    known, belief.is_assumed = belief.geometric_deviation, True
    assert belief.geometric_deviation == pytest.approx(np.hypot(known, belief.squeeze))


@pytest.mark.parametrize('stiffness', [0.6, 1.5])
def test_stiffness_of_the_tubes_scales_the_squeeze_at_most_in_proportion_and_moves_little(
    stiffness,
):
    given = MODEL.statics.body, 0.5, (0.0, 0.0, 0.0), None, MODEL.member_names
    robot = Robot(replace(CONFIG.robot.description, stiffness_scale=stiffness))
    stiffer = settle_grasp(robot.home.moved_to(CONFIG.roller_positions), *given).equilibrium
    assert tuple(stiffer.pose) == pytest.approx(tuple(MODEL.pose), abs=1e-3)
    share = (stiffer.squeeze / MODEL.squeeze - 1.0) / (stiffness - 1.0)
    assert 0.5 < share <= 1.0


@pytest.mark.parametrize('stiffness', [0.6, 1.5])
def test_error_of_the_squeeze_with_unmeasured_stiffness_is_within_stated_deviations(stiffness):
    belief = believed(zero_deviation=1e-3)
    error = (stiffness - 1.0) * belief.squeeze
    assert abs(error) < 2.0 * belief.squeeze_deviation
    assert abs(error) > 4.0 * believed(zero_deviation=1e-3, stiffness=0.02).squeeze_deviation


def test_calibrations_of_the_robot_file_state_the_deviations_of_stiffness_and_offsets():
    zeros = {'south/P': 1e-3, 'south/Q': 2e-3}
    calibration = {'stiffness_deviation': 0.02, 'zero_deviations': zeros}
    known = replace(CONFIG.robot.description, calibration=calibration)
    found = EstimatorSettings().calibrated(known)
    assert (found.stiffness, found.zero_deviation) == (0.02, 2e-3)
    assert EstimatorSettings().calibrated(known, 0.005).zero_deviation == 0.005
    unknown = replace(known, calibration={})
    assert EstimatorSettings().calibrated(unknown) == EstimatorSettings()


def test_the_delay_of_poses_is_estimated_where_the_speed_changes():
    belief = believed()
    carry(belief, 4.0, 1e-4, 4.0, late=PERIOD)
    assert belief.state.delay == pytest.approx(PERIOD, abs=0.015)
    belief = believed()
    carry(belief, 3.0, 1e-4, 4.0)
    assert belief.state.delay < 0.01


def test_poses_that_are_newer_than_their_stamps_have_no_negative_delay():
    belief = believed()
    carry(belief, 3.0, 1e-4, 4.0, age=PERIOD)
    assert belief.state.delay == 0.0


def test_noise_of_encoders_is_no_delay_of_poses():
    belief = believed()
    carry(belief, 3.0, 2e-4, 1.0, encoders=1e-4, period=0.02)
    assert belief.state.delay < 0.01


def test_a_long_delay_of_poses_counts_in_the_test_for_slip_and_is_no_slip():
    belief = believed()
    carry(belief, 2.0, 1e-4, 4.0, late=2.0 * PERIOD)
    assert 2.0 < belief.state.delay / DELAY_DEVIATION < belief.slip_deviations < MAX_DEVIATIONS


@pytest.mark.parametrize('age', [0.5, 2.0])
def test_a_late_pose_is_compared_with_the_motion_up_to_its_stamp(age):
    belief, grasp, poses = believed(), MODEL, [MODEL.pose]
    carry(belief, 0.5)
    for k in range(1, round(2.0 * age / PERIOD) + 1):
        way = np.sin(0.5 * np.pi * k * PERIOD / age) * TRAVEL
        grasp = roll_grip(grasp, CONFIG.moved_to(CONFIG.roller_positions + way))
        belief.follow(grasp.config, PERIOD, None)
        poses.append(grasp.pose)
    there = poses[len(poses) // 2]
    assert np.linalg.norm(np.subtract(there, poses[-1])) > 5e-3
    before = np.array(belief.pose)
    belief.observe(there, age)
    assert np.array(belief.pose) == pytest.approx(before, abs=1e-5)


def test_a_pose_is_compared_with_the_estimate_before_the_delay():
    belief = believed()
    carry(belief, 10 * PERIOD, speed=1.0)
    belief.state.delay = 2.0 * PERIOD
    estimate, earlier = np.array(belief.pose), rolled(8, PERIOD, 1.0).pose
    assert np.linalg.norm(estimate - earlier) > 1e-3
    belief.observe(earlier, 0.0)
    assert np.array(belief.pose) == pytest.approx(estimate, abs=1e-5)


def test_a_constant_offset_of_the_pose_is_no_squeeze():
    belief = believed()
    carry(belief, 3.0, 1e-4)
    before = belief.squeeze
    carry(belief, 3.0, 1e-4, away=np.array([3e-3, 0.0, 0.0]))
    assert belief.squeeze == pytest.approx(before, rel=0.03)


def test_corrections_reach_the_loop_behind_two_low_passes():
    belief = believed()
    carry(belief, 2.0, 1e-5)
    still = belief.regulated[:3]
    off = Pose(*np.add(MODEL.pose, (2e-3, 0.0, 0.0)))
    belief.observe(off, 0.0)
    assert belief.pose[0] - still[0] > 5e-4
    assert belief.regulated[:3] == pytest.approx(still, abs=1e-9)
    for _ in range(60):
        belief.follow(CONFIG, PERIOD, None)
        belief.lag.advance(PERIOD, FILTER_TIME)
        belief.observe(off, 0.0)
    assert belief.regulated[:3] == pytest.approx(belief.pose, abs=3e-4)


def test_corrections_beyond_their_covariance_are_slip_and_others_are_not():
    for step, slipped in ((5e-4, False), (3e-3, True)):
        walk, noise, zeros = ContactWalk(), 1e-6 * np.eye(3), np.zeros((3, 1))
        for k in range(40):
            walk.spread(1e-7 * np.eye(3))
            moved = np.array([step if k > 30 else 0.0, 0.0, 0.0])
            walk.add(0.05 * k, moved, noise, noise, zeros, np.eye(1))
        assert (walk.deviations > MAX_DEVIATIONS) is slipped


@pytest.mark.parametrize('away', [(0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.06, -0.08, 0.5)])
def test_length_of_a_jump_counts_all_coordinates(away):
    belief = believed()
    carry(belief, 0.5, 1e-5)
    belief.observe(Pose(*belief.pose + away), 0.0)
    assert belief.state.jump == pytest.approx(np.linalg.norm(ARM * away), rel=0.05)


def test_one_of_60000_valid_poses_is_inconsistent():
    """The squared innovation of a valid pose has a chi-square distribution."""
    belief = believed()
    carry(belief, 0.5, 1e-5)
    innovations, jumps = [], []
    for away in np.linspace(0.0, 0.02, 200):
        moved = deepcopy(belief)
        moved.observe(Pose(*np.add(moved.pose, (away, 0.0, 0.0))), 0.0)
        innovations.append(moved.state.innovation)
        jumps.append(moved.state.jump > 0.0)
    least = min(np.array(innovations)[jumps])
    assert max(np.array(innovations)[np.logical_not(jumps)]) < least
    assert least == pytest.approx(chi2.isf(1.0 / 60000.0, 3), rel=0.05)


@pytest.mark.parametrize('attached', [False, True])
def test_another_equilibrium_explains_no_corrections(attached):
    """Only an error of the offsets with other derivatives moves the pose, not the search."""
    walk, noise, spread = ContactWalk(), 1e-6 * np.eye(3), 1e-2 * np.eye(1)
    change = np.array([[1.0], [0.0], [0.0]])
    for k in range(24):
        rates = change if k > 20 else 0.0 * change
        if attached and k == 21:
            walk.exclude_jump(change)
        moved = np.array([4e-3 if k > 20 else 0.0, 0.0, 0.0])
        walk.add(0.05 * k, moved, noise, noise, rates, spread)
    assert (walk.deviations > MAX_DEVIATIONS) is attached


@pytest.mark.parametrize(('deviation', 'slipped'), [(1e-3, True), (2e-2, False)])
def test_corrections_explained_by_wrong_offsets_are_no_slip(deviation, slipped):
    walk, noise = ContactWalk(), 1e-6 * np.eye(3)
    for k in range(40):
        rates = np.array([[0.02 * k], [0.0], [0.0]])
        moved = np.array([1e-3 if k > 20 else 0.0, 0.0, 0.0])
        walk.add(0.05 * k, moved, noise, noise, rates, deviation**2 * np.eye(1))
    assert (walk.deviations > MAX_DEVIATIONS) is slipped


@pytest.mark.parametrize('deviation', [3e-4, 2e-3])
def test_noise_of_poses_is_estimated_from_their_steps(deviation):
    noise, rng = PoseNoise(np.full(3, 1e-3)), np.random.default_rng(0)
    for k in range(300):
        noise.add(np.array([1e-4 * k, 0.0, 0.0]) + deviation * rng.normal(size=3))
    assert np.sqrt(noise.variances) == pytest.approx(deviation, rel=0.35)


def test_corrections_of_the_offsets_leave_the_motion_by_travel():
    corrected, other, offset = believed(), believed(), np.zeros(6)
    for number in range(1, 9):
        way = CONFIG.roller_positions + 0.2 * number * TRAVEL
        step = 2e-4 * (-1.0) ** number * np.arange(6.0)
        corrected.correct_zeros(step)
        offset = offset + step
        for belief, travel in ((corrected, way + offset), (other, way)):
            assert belief.follow(CONFIG.moved_to(travel), PERIOD, None) is HoldStatus.HELD
    moved = np.abs(other.pose - MODEL.pose).max()
    assert moved > 5e-3
    assert corrected.pose == pytest.approx(other.pose, abs=0.1 * moved)


def test_a_small_correction_of_the_offsets_moves_no_object_and_needs_no_search(monkeypatch):
    belief, moved = believed(), 2e-4 * np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0])
    monkeypatch.delattr(GripBelief, 'attach')
    pose, squeeze = belief.pose, belief.squeeze
    belief.correct_zeros(moved)
    corrected = belief.squeeze
    assert abs(corrected - squeeze) > 0.01
    assert belief.pose.tolist() == pose.tolist()
    config = CONFIG.moved_to(CONFIG.roller_positions + moved)
    assert belief.follow(config, PERIOD, None) is HoldStatus.HELD
    assert belief.pose == pytest.approx(pose, abs=1e-9)
    assert belief.squeeze == pytest.approx(corrected, abs=0.05 * abs(corrected - squeeze))


def test_contacts_of_another_number_of_members_may_be_anywhere_on_the_object():
    body, members = place(make_robot(), 'three members', 0.5)
    numbers = [BOX_HOME.robot.member_names.index(name) for name in members]
    belief, three = believed(), attach_grip(BOX_HOME, body, np.array(numbers))
    belief.take(three)
    shifts = np.diag(belief.state.covariance)[SHIFTS:]
    assert np.sqrt(shifts) == pytest.approx(np.full(3, three.arm))


@pytest.mark.parametrize('shifts', [(-2.7e-3, -2.9e-3), (-2e-3, -2e-3)])
def test_a_box_tilted_off_its_face_has_the_squeeze_of_its_contacts(shifts):
    x, y = 0.093, 0.111
    box = Polygon([(-x, -y), (x, -y), (x, y), (-x, y)], corner_radius=0.02)
    body = place_between(BOX_HOME, ('north/Z-R', 'north/P-Z'), box, 0.995, 0.01).body
    grip = Grip(('north/Z-R', 'north/P-Z'), body, 0.8)
    tilted = attach_model(BOX_HOME, grip)
    for _ in range(4):
        moved = 0.25 * np.array(shifts)[tilted.contacts.owners]
        tilted = roll_grip(replace(tilted, anchors=tilted.anchors + moved), BOX_HOME)
    measured = grip.moved_to(tilted.pose)
    laid = attach_model(BOX_HOME, measured, zero_deviation=0.01)
    assert (len(tilted.anchors), len(laid.anchors)) == (2, 3)
    belief = GripBelief(laid, measured, EstimatorSettings())
    assert belief.squeeze == pytest.approx(tilted.squeeze, rel=0.01)
    assert np.abs(belief.state.bias).max() < 2e-4


def test_pose_and_squeeze_between_equilibria_are_extrapolated_from_the_last_motion():
    belief, grasp, equilibria, poses, squeezes = believed(), MODEL, set(), [], []
    for k in range(1, 41):
        way = np.sin(2.0 * np.pi * 0.005 * k) * 2.0 * TRAVEL
        grasp = roll_grip(grasp, CONFIG.moved_to(CONFIG.roller_positions + way))
        assert belief.follow(grasp.config, 0.005, None) is HoldStatus.HELD
        equilibria.add(id(belief.grasp.config))
        poses.append(ARM * (belief.pose - grasp.pose))
        squeezes.append(belief.squeeze / grasp.squeeze - 1.0)
    assert len(equilibria) <= 12
    # Before the second equilibrium there is no motion to extrapolate.
    assert np.abs(poses[8:]).max() < 2e-5
    assert np.abs(squeezes[8:]).max() < 2e-3
