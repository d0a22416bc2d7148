# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where a grip of any members is when a command is carried out, later than it was measured."""

from __future__ import annotations

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_contacts import find_contacts
from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
from isotruss_ros.core.numerics.arrays import Array


def predict_grip(
    config: Configuration, grip: Grip, before: Array, travel: Array
) -> tuple[Configuration, Grip]:
    """
    Predict configuration and grip after some roller travel; the object rolls in its contacts.

    :param config: configuration when the rollers were measured.
    :param grip: the grip when the object was measured.
    :param before: (r,) roller travel from the measurement of the rollers to that of the object
        [m].
    :param travel: (r,) roller travel from the measurement of the rollers on [m].
    :return: configuration and grip after `travel`.
    :raises GraspError: a member does not touch the object, before or after.
    :raises ConfigurationError: there is no such configuration.
    """
    if not (before.any() or travel.any()):
        find_contacts(config, grip)
        return config, grip
    measured = config.predict(before) if before.any() else config
    predicted = config.predict(travel)
    return predicted, RollingGrip.attach(measured, grip).moved_to(predicted).grip
