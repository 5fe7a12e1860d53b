# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The table of parameters is consistent."""

from __future__ import annotations

from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS


def test_every_parameter_has_its_own_name_and_a_textbook_value_in_range() -> None:
    assert len(BY_NAME) == len(PARAMETERS)
    for parameter in PARAMETERS:
        assert parameter.low <= parameter.textbook <= parameter.high
        assert 0.0 < parameter.spread <= parameter.high - parameter.low
        assert parameter.unit and parameter.meaning
        assert parameter.part in ("contact", "pressure", "measurement", "world")
