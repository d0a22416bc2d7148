# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Whether an object is held, and if not, why."""

from __future__ import annotations

import enum


class HoldStatus(enum.Enum):
    """Whether an object is held; if not, which condition has no solution."""

    HELD = 'held'
    NO_CONTACT = 'fewer than two members press on the object'
    NO_BALANCE = 'no pose near the given one balances the forces'
    FAR = 'the pose that balances the forces is too far from the given one'
    SLIPS = 'the balance needs more friction than there is'
    UNSTABLE = 'the balance is unstable'
    OFF_MEMBER = 'a contact is beyond the end of its member'
    OTHER_CONTACT = 'another member presses on the object'
    WRINKLES = 'a tube wrinkles, outside of the model'

    @property
    def at_rest(self) -> bool:
        """Return whether the linear model holds the object, even if a tube wrinkles."""
        return self in (HoldStatus.HELD, HoldStatus.WRINKLES)
