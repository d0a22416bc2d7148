# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The public calls answer as they did before the short forms went."""

import numpy as np
import pytest
import recorded_answers

QUESTIONS = recorded_answers.load()
CALLS = list(recorded_answers.ANSWERS)
#: Of a number, and as such: processors differ by 8e-8 in twists that a limit slows.
TOLERANCE = 3e-7


@pytest.mark.parametrize('call', CALLS)
def test_answers_are_those_recorded(call):
    different = []
    for number, question in enumerate(QUESTIONS):
        if question['call'] != call:
            continue
        word, numbers = question['answer']
        own_word, own = recorded_answers.answer(question)
        same = word == own_word and len(numbers) == len(own)
        if not same:
            different.append((number, word, own_word))
        elif numbers:
            close = np.isclose(own, numbers, rtol=TOLERANCE, atol=TOLERANCE)
            if not close.all():
                different.append((number, word, numbers, own))
    assert not different
