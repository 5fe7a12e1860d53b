# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The table of parameters is consistent, and as long as the kernel's rows."""

from __future__ import annotations

import re

from repository import REPOSITORY

from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS


def test_every_parameter_has_its_own_name_and_a_textbook_value_in_range() -> None:
    assert len(BY_NAME) == len(PARAMETERS)
    for parameter in PARAMETERS:
        assert parameter.low <= parameter.textbook <= parameter.high
        assert 0.0 < parameter.spread <= parameter.high - parameter.low
        assert parameter.unit and parameter.meaning
        assert parameter.part in ("contact", "pressure", "measurement", "world")


def test_the_kernel_has_as_many_parameters() -> None:
    """It checks no bounds: with another number it would read and write past its rows."""
    source = (REPOSITORY / "push_predictor/models/mechanics/kernel/push.py").read_text()
    numbers = re.findall(r"PARAMETERS = cython.declare\(cython.int, (\d+)\)|own: cython.double\[(\d+)\]", source)
    assert [int(one or other) for one, other in numbers] == [len(PARAMETERS)] * 2
