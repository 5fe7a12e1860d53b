# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Numbers in the documents that are constants of the code: each phrase is on its page with today's value."""

from __future__ import annotations

import importlib
import re

import numpy as np
import pytest
from repository import REPOSITORY

from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS

DOCS = REPOSITORY / "docs"
WORDS = ("none", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
W, C, T = "recordings.windows.", "recordings.checks.", "residuals."
OPTIONS = W + "push_window"
# Page; phrase, where {} is a number and {w} one in words; module; expression of its names, in the phrase's unit.
NUMBERS = [
    ("explanation/windows", "constant length ({} s by default)", OPTIONS, "WindowOptions().duration"),
    ("explanation/windows", "`touch_gap` ({} mm)", OPTIONS, "1e3 * WindowOptions().touch_gap"),
    ("explanation/windows", "`touch_gap_alone` ({} mm)", OPTIONS, "1e3 * WindowOptions().touch_gap_alone"),
    ("explanation/windows", "`least_force` ({} N)", OPTIONS, "WindowOptions().least_force"),
    ("explanation/windows", "`least_speed` ({} mm/s)", OPTIONS, "1e3 * WindowOptions().least_speed"),
    ("explanation/windows", "`lift` ({} mm)", OPTIONS, "1e3 * WindowOptions().lift"),
    ("explanation/windows", "`bounce` ({} ms)", OPTIONS, "1e3 * WindowOptions().bounce"),
    ("explanation/windows", "A push ends after {} s without", OPTIONS, "WindowOptions().push_pause"),
    ("explanation/windows", "{w} standard deviations of its noise. The free", W + "push_segmenter", "NOISE_FACTOR"),
    ("explanation/windows", "at least {} mm away from the slider", W + "push_segmenter", "1e3 * FREE_GAP"),
    ("explanation/windows", "less than {} % of the tip's speed", W + "push_segmenter", "100 * CLOSING_SHARE"),
    ("explanation/windows", "last {} samples in which the tip was", W + "force", "TARE_SAMPLES"),
    ("explanation/windows", "the gap has noise below {} mm", W + "force", "1e3 * GAP_NOISE"),
    ("explanation/windows", "none of the last {w}", W + "force", "UNSEEN"),
    ("explanation/windows", "at over {} % of them", W + "force", "100 * MISSING"),
    ("explanation/windows", "above {} ms or below", W + "force", "1e3 * LATEST"),
    ("explanation/windows", "below −{} ms", W + "force", "1e3 * EARLIEST"),
    ("explanation/windows", "over the last {}, is above", W + "force", "RECENT"),
    ("explanation/windows", "usual interval is over {} ms", W + "contact", "1e3 * SLOWEST"),
    ("explanation/windows", "has a gap of over {} s", W + "contact", "LONGEST_BREAK"),
    ("explanation/windows", "positions over the first {} ms", W + "contact", "1e3 * FIT_SPAN"),
    ("explanation/windows", "reaches {} % of that over", W + "contact", "100 * NEAR_SHARE"),
    ("explanation/windows", "over its first {w} samples", W + "cut", "FIT_SAMPLES"),
    ("explanation/windows", "over its first {} intervals", W + "track", "PERIOD_SAMPLES"),
    ("explanation/windows", "moves by more than {} mm plus", W + "track", "1e3 * JUMP_DISTANCE"),
    ("explanation/windows", "mm plus {} m/s times", W + "track", "JUMP_SPEED"),
    ("explanation/windows", "turns by more than {} rad plus", W + "track", "JUMP_ANGLE"),
    ("explanation/windows", "rad plus {} rad/s times", W + "track", "JUMP_TURN_RATE"),
    ("explanation/windows", "are over {} s apart, it has", W + "finder", "1e-9 * LONGEST_GAP"),
    ("explanation/windows", "blocks of {} samples", W + "regular_stamps", "DECIDING"),
    ("explanation/windows", "jitter exceeds {} % of the period", W + "regular_stamps", "100 * SHARE"),
    ("explanation/windows", "of the period and {} ms", W + "regular_stamps", "1e3 * LEAST"),
    ("explanation/windows", "correlation below −{}", W + "regular_stamps", "-CORRELATION"),
    ("explanation/windows", "over {} % of the intervals of a block", W + "regular_stamps", "100 * LEAST_TOGETHER"),
    ("explanation/windows", "the {}th percentile of the deviations", W + "regular_stamps", "LOW"),
    ("explanation/windows", "exceeds {} mm and 1.5 times", W + "unmeasured", "1e3 * HARMLESS"),
    ("explanation/windows", "mm and {} times what the body moves", W + "unmeasured", "MARGIN"),
    ("explanation/windows", "A line of over {} s is a motion", W + "unmeasured", "1e-9 * LONGEST"),
    ("explanation/windows", "slider more than {} ms apart", W + "slow", "1e3 * SLOW"),
    ("explanation/windows", "contact is evaluated every {} ms", W + "slow", "1e-6 * FINE"),
    ("explanation/windows", "stream that is over {} s late", W + "clock_session", "LONGEST_LAG"),
    ("explanation/windows", "passed it by {} ms", W + "contact", "1e3 * REACH"),
    ("explanation/residual_loop", "Every third block of {w} pushes", T + "evidence.standardised", "HELD_OUT_BLOCK"),
    ("explanation/residual_loop", "up to {w} neighbouring pushes", T + "evidence.standardised", "BLOCK"),
    ("explanation/residual_loop", "divided into {w} folds", T + "candidates.joint_fit", "FOLDS"),
    ("explanation/residual_loop", "(one-sided {} %)", T + "selection.naming", "100 * REJECTED"),
    ("explanation/residual_loop", "than {} % of the gain of both", T + "selection.naming", "100 * MOST_UNEXPLAINED"),
    ("explanation/residual_loop", "or after {w}.", T + "selection.search", "MOST_ADDITIONS"),
    ("explanation/residual_loop", "**Measurement** ({} %)", T + "question", "100 * ALPHA_SHARES['measurement']"),
    ("explanation/residual_loop", "**Motion** ({} %)", T + "question", "100 * ALPHA_SHARES['motion']"),
    ("explanation/residual_loop", "**Noise** ({} %)", T + "question", "100 * ALPHA_SHARES['noise']"),
    ("explanation/residual_loop", "**Force** ({} %)", T + "question", "100 * ALPHA_SHARES['force']"),
    ("explanation/residual_loop", "**Zero of the force sensor** ({} %)", T + "question", "100 * ALPHA_SHARES['zero']"),
    ("explanation/residual_loop", "at least {} % of the windows lie", T + "evidence.input_shift", "100 * NOTABLE"),
    ("explanation/residual_loop", "deviation of {} % for errors", T + "outcome", "100 * DISCREPANCY"),
    ("reference/check", "a speed over {} m/s", C + "units", "FASTEST"),
    ("reference/check", "the middle 90 % of the speeds are within a factor of {}", C + "coverage", "ONE_SPEED"),
    ("reference/check", "note; warning within {} degrees", C + "coverage", "np.degrees(NARROWEST_ANGLES)"),
    ("reference/check", "angles are within {} degrees", C + "coverage", "np.degrees(GOOD_ANGLES)"),
    ("reference/check", "note; warning below {} |", C + "coverage", "FEWEST_PUSHES"),
    ("reference/check", "fewer than {} pushes | accuracy", C + "coverage", "GOOD_PUSHES"),
    ("reference/check", "note; warning under {} %", C + "coverage", "100 * LEAST_SLIDING"),
    ("reference/check", "slides in under {} %", C + "coverage", "100 * GOOD_SLIDING"),
    ("reference/check", "over {} mm, or a turn that moves", C + "poses", "1e3 * NOISY"),
    ("reference/check", "uncertain by over {} mm/s", C + "poses", "1e3 * SPEED_NOISE"),
    ("reference/check", "refused over {} mm/s", C + "poses", "1e3 * TOO_NOISY"),
    ("reference/check", "at least {} times | the samples elsewhere", C + "places", "FEWEST_RETURNS"),
    ("reference/check", "refused over {} % of the time", C + "places", "100 * HALF"),
    ("reference/check", "of its centre, to {} degrees", C + "force_direction", "np.degrees(ALLOWED)"),
    ("reference/check", "or over {} degrees, only", C + "force_direction", "np.degrees(ALLOWED_FEW)"),
    ("reference/check", "no force in over {} % of the contacts", C + "force", "100 * MISSING"),
]  # fmt: skip


@pytest.mark.parametrize("page", sorted({row[0] for row in NUMBERS}))
def test_the_numbers_of_a_page_are_those_of_the_code(page: str) -> None:
    text = " ".join((DOCS / f"{page}.md").read_text().split())
    for _, phrase, module, expression in filter(lambda row: row[0] == page, NUMBERS):
        number = eval(expression, {**vars(importlib.import_module(f"push_predictor.{module}")), "np": np})
        shown = phrase.format(f"{number:g}", w=WORDS[round(number)] if "{w}" in phrase else "")
        assert shown in text, f"{page}: {shown!r}, {module}: {expression}"


def test_the_table_of_mechanisms_gives_the_largest_values() -> None:
    page = (DOCS / "reference" / "trace.md").read_text()
    rows = re.findall(r"^\| `(\w+)` \| [^|]+ \| ([\d.]+)\b", page, re.MULTILINE)
    largest = {one.name: one.parameters[0].largest for one in (*LIBRARY, *REFINEMENTS)}
    assert rows and {name: float(number) for name, number in rows} == {name: largest[name] for name, _ in rows}
    assert {one.name for one in LIBRARY} <= {name for name, _ in rows}
