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

import numpy as np
import pytest
from repository import REPOSITORY

from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS, RowValues, parameter_table


def test_the_docs_show_the_table_of_parameters() -> None:
    assert parameter_table() in (REPOSITORY / "docs" / "explanation" / "mechanics.md").read_text()


def test_every_parameter_has_its_own_name_and_a_textbook_value_in_range() -> None:
    assert len(BY_NAME) == len(PARAMETERS)
    for parameter in PARAMETERS:
        assert parameter.low <= parameter.textbook <= parameter.high
        assert 0.0 < parameter.spread <= parameter.high - parameter.low
        assert parameter.unit and parameter.meaning
        assert parameter.part in ("contact", "pressure", "measurement", "world")


def test_missing_values_are_the_textbooks_and_single_values_apply_to_all_pushes() -> None:
    values = RowValues({"centre_x": 0.01, "centre_y": np.array([0.0, 0.0, 0.02])}, 3, {})
    assert values.of("contact_friction").tolist() == [0.3, 0.3, 0.3]
    assert values.pair("centre_x", "centre_y").tolist() == [[0.01, 0.0], [0.01, 0.0], [0.01, 0.02]]
    assert values.active("centre_y") and not values.active("slope_x", "slope_y")


def test_rejects_a_name_that_is_no_parameter() -> None:
    with pytest.raises(KeyError, match="'friction' is no parameter of the mechanics: contact_friction"):
        RowValues({"friction": 0.3}, 1, {})
