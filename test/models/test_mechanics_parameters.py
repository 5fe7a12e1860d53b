# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The table of parameters is consistent, and the docs show it."""

from __future__ import annotations

from repository import REPOSITORY

from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS, parameter_table


def test_the_docs_show_the_table_of_parameters() -> None:
    assert parameter_table() in (REPOSITORY / "docs" / "explanation" / "mechanics.md").read_text()


def test_every_parameter_has_its_own_name_and_a_textbook_value_in_range() -> None:
    assert len(BY_NAME) == len(PARAMETERS)
    for parameter in PARAMETERS:
        assert parameter.low <= parameter.textbook <= parameter.high
        assert 0.0 < parameter.spread <= parameter.high - parameter.low
        assert parameter.unit and parameter.meaning
        assert parameter.part in ("contact", "pressure", "measurement", "world")
