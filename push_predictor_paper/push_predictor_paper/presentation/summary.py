# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The opening of the report: how many claims hold, on which data, and what to do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from push_predictor_paper.section import VERDICTS, Origin, Section
from push_predictor_paper.study import Study

TOO_LITTLE = "too little data"
WORDS = {  # of one claim, of several
    "holds": ("holds", "hold"),
    "holds in part": ("holds in part", "hold in part"),
    "does not hold": ("does not hold", "do not hold"),
    "not decided": ("is not decided", "are not decided"),
    TOO_LITTLE: ("has too little data", "have too little data"),
}
CLAIMS: Mapping[Origin, str] = {"paper": "claims of the paper", "beyond the paper": "questions beyond the paper"}


def counts(sections: Sequence[Section], origin: Origin, lacking: Mapping[str, str]) -> dict[str, int]:
    """Number of findings by verdict; those of sections that lack data are counted apart."""
    found = Counter(
        TOO_LITTLE if section.key in lacking else finding.verdict
        for section in sections
        for finding in section.findings
        if finding.origin == origin
    )
    return {verdict: found[verdict] for verdict in (*VERDICTS, TOO_LITTLE)}


def opening_sentences(sections: Sequence[Section], study: Study, lacking: Mapping[str, str]) -> tuple[str, str, str]:
    """How many of the paper's claims hold, on which pushes that rests, what to do."""
    found = counts(sections, "paper", lacking)
    parts = [f"{number} {WORDS[verdict][number > 1]}" for verdict, number in found.items() if number]
    claims = f"Of {sum(found.values())} {CLAIMS['paper']}, {listed(parts)}."
    measured = (
        f", and on measured ones ({', '.join(c.name.removeprefix('measured: ') for c in study.measured)})"
        if study.measured
        else ""
    )
    sets = len(study.simulated.sets)
    data = f"They are checked on simulated pushes of {sets} sets of shape and surface{measured}."
    if lacking:
        return claims, data, "Run the report without `--quick`: grey verdicts do not count."
    return claims, data, "Read the number of each claim below; its section has the rule of the verdict."


def listed(parts: Sequence[str]) -> str:
    """Parts of a sentence: a, b and c; none: an empty text."""
    return " and ".join([part for part in (", ".join(parts[:-1]), *parts[-1:]) if part])
