# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The table of parameters is consistent, and the docs show it."""

from __future__ import annotations

from repository import REPOSITORY

from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS


def parameter_table() -> str:
    """All parameters as a Markdown table."""
    head = ["| parameter | unit | range | prior sd | meaning |", "|" + " --- |" * 5]
    rows = [
        f"| `{p.name}` | {p.unit} | {f'±{p.high:g}' if p.high == -p.low else f'{minus(p.low)} to {minus(p.high)}'} "
        f"| {p.spread:g} | {p.meaning}{' *' if p.needs else ''} |"
        for p in PARAMETERS
    ]
    return "\n".join([*head, *rows])


def minus(value: float) -> str:
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")


def test_the_docs_show_the_table_of_parameters() -> None:
    assert parameter_table() in (REPOSITORY / "docs" / "explanation" / "mechanics.md").read_text()


def test_every_parameter_has_its_own_name_and_a_textbook_value_in_range() -> None:
    assert len(BY_NAME) == len(PARAMETERS)
    for parameter in PARAMETERS:
        assert parameter.low <= parameter.textbook <= parameter.high
        assert 0.0 < parameter.spread <= parameter.high - parameter.low
        assert parameter.unit and parameter.meaning
        assert parameter.part in ("contact", "pressure", "measurement", "world")
