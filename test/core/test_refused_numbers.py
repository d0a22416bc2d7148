# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers that are not finite or out of range are refused with their names and ranges."""

from dataclasses import replace
import inspect
import math
import warnings

from isotruss_ros import core
from isotruss_ros.calibration.home import calibrate_home
from isotruss_ros.calibration.home_fit import Posture
from isotruss_ros.calibration.oscillation import fit_oscillation
from isotruss_ros.calibration.roller_check import judge_roller
from isotruss_ros.calibration.stiffness_scale import calibrate_stiffness
from isotruss_ros.core.contact.wrench_space import wrench_space
from isotruss_ros.core.errors import ArgumentError, GraspError
from isotruss_ros.core.estimation.state_estimator import StateEstimator
from isotruss_ros.core.holding.grasp_gradient import GraspGradient
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.numerics.argument_kinds import EXAMPLES
from isotruss_ros.core.numerics.arrays import MAX_LOAD
from isotruss_ros.core.paths.path_tracking import TrackingSettings
from isotruss_ros.core.planning.foresee_path import foresee_grip, foresee_path
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.mujoco_plant.options import PlantOptions
import numpy as np
import pytest

ROBOT = core.load_robot('nine_member')
HOME, NONE = ROBOT.home, np.zeros(len(ROBOT.roller_names))
BODY = core.ConvexObject.disc(core.tangent_center(HOME, 'north/Z', 0.3, 0.02), 0.3)
TRIANGLE = core.ConvexObject(core.Polygon([(0.0, 0.0), (0.1, 0.0), (0.0, 0.1)]), BODY.pose)
GRIP = core.Grip.at_module(ROBOT, 'north/Z', BODY, 0.8)
POST = core.Obstacle('post', BODY.moved_to((1.5, 0.0, 0.0)))
PATH = core.ObjectPath([(0, 0, 0), (0.1, 0, 0)], 0.05, 0.5)
TRACKER = core.PathTracker(PATH, TrackingSettings(), 0.01)
POSES = np.array([BODY.pose, BODY.pose])
SERVO = core.TwistServo(ROBOT, ServoSettings(GRIP, 0.01, 0.2))
TIMES, SWING = np.linspace(0.0, 3.0, 40), np.zeros((40, 3))


def put(values, value):
    """Return values (n, 3), one of which is another number."""
    changed = np.array(values, dtype=float)
    changed[-1, -1] = value
    return changed


CALLS = {
    'pose of a path': lambda value: TRACKER.update(core.Pose(0.0, 0.0, value), 0.0, 0.01),
    'pose to reach': lambda value: core.reach_pose(HOME, GRIP, (0.7, value, 0.0)),
    'path in the model': lambda value: foresee_grip(HOME, BODY, 0.8, put(POSES, value)),
    'oscillation': lambda value: fit_oscillation(TIMES, put(SWING, value), 0.15),
    'joints': lambda value: calibrate_home(ROBOT, [Posture(NONE, {'P': (0.0, value)})]),
    'pull': lambda value: calibrate_stiffness(
        HOME, {'Z': (value, 0.0)}, {'Z': (0.0, 0.0)}, {'Z': (0.01, 0.0)}
    ),
    'displacement': lambda value: judge_roller(HOME, 'north/R', 0.01, {'Z': (value, 0.0)}, 1e-3),
}


@pytest.mark.parametrize('what', CALLS)
@pytest.mark.parametrize('value', [np.inf, -np.inf, np.nan, 1e300])
def test_numbers_that_are_not_finite_are_refused(what, value):
    with pytest.raises(core.IsotrussError, match='finite'):
        CALLS[what](value)


#: Calls with a coefficient of friction.
FRICTION_CALLS = {
    'object': lambda mu: core.ConvexObject.disc((0.0, 0.0), 0.3, friction=mu),
    'object file': lambda mu: core.read_object(f'{{shape: disc, diameter: 0.3, friction: {mu}}}'),
    'settled grasp': lambda mu: core.settle_grasp(HOME, BODY, mu),
    'analysis': lambda mu: core.analyze_grasp(HOME, BODY, mu),
    'grip': lambda mu: core.Grip.at_module(ROBOT, 'north/Z', BODY, mu),
    'requirements': lambda mu: core.GraspRequirements(friction=mu),
    'MuJoCo plant': lambda mu: PlantOptions(friction=mu),
    'wrench space': lambda mu: wrench_space([(0.1, 0.0)], [(1.0, 0.0)], mu, 0.1),
    'path of an equilibrium': lambda mu: foresee_path(
        core.settle_grasp(HOME, BODY).equilibrium, mu, POSES
    ),
    'elastic object': lambda mu: core.ElasticObject(BODY, mu),
}


@pytest.mark.parametrize('what', FRICTION_CALLS)
def test_friction_out_of_range_is_refused_with_the_range(what):
    with pytest.raises(GraspError, match=r'80.*: must be from 0 to 10; if it is in percent, it '):
        FRICTION_CALLS[what](80.0)
    with pytest.raises(core.IsotrussError, match=r'friction.*-1.*: must be '):
        FRICTION_CALLS[what](-1.0)
    with pytest.raises(core.IsotrussError, match=r'friction.*nan.*: must be '):
        FRICTION_CALLS[what](math.nan)


@pytest.mark.parametrize(
    ('pose', 'words'),
    [
        ((0.7, 0.5, 90.0), 'angle must be .* in magnitude; if it is in degrees, it is 1.571 rad'),
        ((0.7, 0.5, -6.3), 'angle must be finite, at most 6.283 rad in magnitude'),
        ((700.0, 0.0, 0.0), 'x must be .* in magnitude; .* if it is in mm, it is 0.7 m'),
        ((0.0, -1450.0, 0.0), 'y must be .* in magnitude; .* if it is in mm, it is -1.45 m'),
    ],
)
def test_poses_in_another_unit_are_refused_with_the_unit(pose, words):
    with pytest.raises(GraspError, match=words):
        core.ConvexObject(core.Disc(0.3), pose)
    with pytest.raises(GraspError, match=words):
        core.reach_pose(HOME, GRIP, pose)


#: Public functions and methods, with a parameter for an object of this package each.
DOORS = [
    (door, parameter)
    for door in (
        *filter(inspect.isfunction, (getattr(core, name) for name in core.__all__)),
        *(foresee_grip, foresee_path, core.ConvexObject, core.Grip.at_module, core.SimulatedRobot),
        *(core.ElasticObject, core.PathTracker, core.RigidObject, core.ShapeGuard),
        core.RollingGrip.attach,
        *(StateEstimator, core.TwistServo, core.Uncertainty.of, core.Uncertainty.chance),
        *(core.Uncertainty.covariance, SettledGrasp.chance, GraspGradient.chance),
    )
    for parameter, entry in inspect.signature(door).parameters.items()
    if not EXAMPLES.keys().isdisjoint(str(entry.annotation).split(' | '))
]


@pytest.mark.parametrize(('door', 'parameter'), DOORS, ids=lambda x: getattr(x, '__qualname__', x))
@pytest.mark.parametrize('given', [core.Disc, 0.3], ids=repr)
def test_arguments_of_another_kind_are_refused_with_an_example(door, parameter, given):
    if given is core.Disc and 'Callable' in str(inspect.signature(door).parameters[parameter]):
        given = True  # a class can be called
    with pytest.raises(ArgumentError, match=f'{parameter}: .*: must be an? .*, such as `'):
        door(**{parameter: given})


ESTIMATOR = StateEstimator(HOME.robot)
ESTIMATOR.set_grip(GRIP)
#: Calls with a list in another form, or with a text in place of a list.
FORMS = {
    'carry': lambda: core.GraspRequirements(carry=(0.7, 0.8, 0.0)),
    'carry, a list': lambda: core.GraspRequirements(carry=None),
    'direction': lambda: core.GraspRequirements(direction=1.0),
    'external_wrench': lambda: core.GraspRequirements(external_wrench=[(0.0, 0.0, 0.0)]),
    'max_utilisation': lambda: core.GraspRequirements(max_utilisation=None),
    "members 'north/P-Z'": lambda: core.settle_grasp(HOME, BODY, members='north/P-Z'),
    "members 'north/Z-R'": lambda: core.place_between(HOME, 'north/Z-R', BODY.shape),
    'poses of the path': lambda: foresee_grip(HOME, BODY, 0.8, 'north'),
    'speed': lambda: core.ObjectPath(POSES, '0.1', 0.5),
    'inputs poses': lambda: SERVO.receive(poses=None),
    'argument twist': lambda: SERVO.receive(twist=(0.0, 0.1, 0.0)),
    'argument rollers.value': lambda: SERVO.receive(rollers=StampedInput(NONE, 0.0)),
    'argument estimate.value': lambda: SERVO.receive(estimate=StampedInput(NONE, 0.0)),
    'argument failed': lambda: SERVO.receive(failed=None),
    'failed rollers': lambda: SERVO.receive(failed='north/Z'),
    'halt': lambda: SERVO.receive(halt='stop'),
    'argument grip': lambda: StateEstimator(HOME.robot).set_grip('north/Z'),
    'argument record': lambda: StateEstimator(HOME.robot).take_grip('north/Z'),
    'time of the measurement': lambda: ESTIMATOR.take_pose(math.nan, BODY.pose, np.ones(3)),
    'time of the cycle': lambda: SERVO.decide(math.nan),
    'roller velocities': lambda: SERVO.command([0.1], 0.0),
    'argument barriers': lambda: ServoSettings(GRIP, 0.01, 0.2, barriers=1),
    'argument limits': lambda: ServoSettings(GRIP, 0.01, 0.2, limits=1),
    r'argument obstacles\[0\]': lambda: ServoSettings(GRIP, 0.01, 0.2, obstacles=(BODY,)),
    r'argument obstacles\[1\]': lambda: core.plan_path(HOME, GRIP, BODY.pose, [POST, BODY]),
    "corners '1': .* for each of the 2 members": lambda: replace(GRIP, corners=1),
    r"corners '\(\(0,\), \(\)\)'": lambda: replace(GRIP, corners=((0,), ())),
    "corner on north/P-Z 'a'": lambda: replace(GRIP, corners=((0,), ('a',))),
    'corner 9: the object has no': lambda: replace(GRIP, body=TRIANGLE, corners=((0,), (9,))),
    'seed 0.5: must be an integer': lambda: core.settle_grasp(HOME, BODY).chance(
        core.Uncertainty(), 1, 0.5
    ),
    'seed -1: must be an integer': lambda: core.SimulatedRobot(
        HOME, core.ElasticObject(BODY, 0.8), core.RollerFaults(), -1
    ),
    'the loads are beyond the limit load': lambda: core.deform(HOME, {'Z': (MAX_LOAD, MAX_LOAD)}),
    'max_rounds None': lambda: core.plan_grasps(HOME, BODY, max_rounds=None),
}


@pytest.mark.parametrize('words', FORMS)
def test_lists_and_inputs_of_another_form_are_refused_with_their_name(words):
    with pytest.raises(core.IsotrussError, match=words):
        FORMS[words]()


LOST = BODY.moved_to((0.0, 0.8, 0.0))
LOAD_CALLS = {
    'analyze_grasp': lambda load: core.analyze_grasp(HOME, BODY, 0.5, load),
    'settle_grasp': lambda load: core.settle_grasp(HOME, BODY, 0.5, load),
    'settle_grasp of a lost object': lambda load: core.settle_grasp(HOME, LOST, 0.5, load),
    'grasp_gradient': lambda load: (
        core.grasp_gradient(core.settle_grasp(HOME, BODY, 0.5, load)).slip_margin
    ),
    'GraspRequirements': lambda load: core.GraspRequirements(external_wrench=tuple(load)),
    'elastic plant': lambda load: setattr(core.ElasticObject(BODY, 0.5), 'external_wrench', load),
    'joint': lambda load: core.deform(HOME, {'Z': load[:2]}, paper_model=True),
    'module': lambda load: core.deform(HOME, {}, module_loads={'north/Z': load}, paper_model=True),
    'tube': lambda load: core.deform(
        HOME, {}, tube_loads={'north/P-Z': [(0.5, *load)]}, paper_model=True
    ),
}


@pytest.mark.parametrize('name', LOAD_CALLS)
@pytest.mark.parametrize('size', [1.01 * MAX_LOAD, 1e160, 1.7e308])
def test_loads_out_of_range_are_refused(name, size):
    for load in [(size, 0.0, 0.0), (0.0, -size, 0.0)]:
        with pytest.raises(core.IsotrussError, match=r': must be . finite numbers, at most'):
            LOAD_CALLS[name](load)


@pytest.mark.parametrize('name', LOAD_CALLS)
@pytest.mark.parametrize('load', MAX_LOAD * np.array([(1, 0, 0), (0, -1, 0), (1, 1, -1)]))
def test_the_largest_loads_do_not_overflow(name, load):
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        LOAD_CALLS[name](load)
