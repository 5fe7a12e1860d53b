# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Up to which speed does the quasi-static assumption hold? Models without the speed, of growing top speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from push_predictor.reporting.canvas import Picture, draw
from push_predictor.types import Array
from push_predictor_paper.claims.quasi_static.facts import (
    FEWEST,
    GP,
    MAIN,
    SAME_SIZE,
    SERIES,
    WITH_SPEED,
    Facts,
    facts_of,
)
from push_predictor_paper.claims.quasi_static.rules import (
    NOTABLE,
    SLOW,
    breaks_beyond,
    departure,
    estimated,
    helps_then_harms,
    lower,
    turn_of,
    turning_bracket,
    turns_there,
)
from push_predictor_paper.claims.quasi_static.tables import bracket_table, single_table, speed_table, speed_text
from push_predictor_paper.data.time_scaled import TRAVEL
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.figures.quasi_static import Curve, paint_quasi_static
from push_predictor_paper.section import Finding, Section
from push_predictor_paper.study import Study


def section(study: Study) -> Section:
    """NMSE by the top speed of the training pushes, and the departure of outcomes from those of slow pushes."""
    facts = facts_of(study)
    if len(facts.judged.speeds) < 2:
        note = f"Fewer than two speeds gave {FEWEST} training windows in every fold."
        return Section("quasi_static", TITLE, (Finding(CLAIM_TURN, "not decided", note),), notes=(note,))
    departures = [departure(facts.equal[0], other, False)[0] for other in facts.equal]
    return Section(
        key="quasi_static",
        title=TITLE,
        findings=(
            _course(facts),
            _turn(facts),
            _direct(facts, departures),
            _speed_as_input(facts),
        ),
        tables=(bracket_table(facts), single_table(facts), speed_table(facts)),
        pictures=(_picture(study, facts, departures),),
        notes=_notes(study, facts),
        data=_json(facts, departures),
    )


TITLE = "The quasi-static assumption: pushes of all speeds scaled to 10 mm/s"
CLAIM_COURSE = "Adding faster pushes to a model without the speed as an input first helps, then harms"
CLAIM_TURN = "A model without the speed as an input is best with pushes of up to 50 to 80 mm/s"
CLAIM_DIRECT = "The quasi-static assumption does not hold beyond 50 to 80 mm/s"
CLAIM_INPUT = "The speed is a useful input"


def _course(facts: Facts) -> Finding:
    judged = facts.judged
    turn = turning_bracket(judged.speeds)
    if turn is None:
        return Finding(CLAIM_COURSE, "not decided", "No bracket of speeds ends at 50 to 80 mm/s.")
    gain, harm = _against(judged.same(MAIN), turn)
    equal_gain, equal_harm = _against(judged.same(SAME_SIZE), turn)
    slow_gain, slow_harm = _against(judged.slow(MAIN), turn)
    slow_equal = _against(judged.slow(SAME_SIZE), turn)
    sentence = (
        "NMSE of the VHGP on held-out pushes of its own speeds, minus that of the bracket up to "
        f"{speed_text(judged.speeds[turn])}: the slowest bracket {gain.text('+.3f')} (above 0: adding helped), the "
        f"bracket up to {speed_text(judged.speeds[-1])} {harm.text('+.3f')} (above 0: adding harmed). With "
        f"{facts.same_sizes} windows in every bracket: {equal_gain.text('+.3f')} and {equal_harm.text('+.3f')}; "
        f"a gain only in the first pair comes from more data, not from faster pushes. On slow pushes alone "
        f"(up to {speed_text(SLOW)}): "
        f"{slow_gain.text('+.3f')} and {slow_harm.text('+.3f')}; at equal n {slow_equal[0].text('+.3f')} and "
        f"{slow_equal[1].text('+.3f')}. {facts.judged_on} Rule: holds if both of the first pair lie above 0, in part "
        "if one does, does not hold if none does and one lies below."
    )
    number = f"NMSE {gain.text('+.3f')} and {harm.text('+.3f')}"
    return Finding(CLAIM_COURSE, helps_then_harms(gain, harm), sentence, number=number)


def _against(curve: Array, turn: int) -> tuple[Estimate, Estimate]:
    """NMSE of the slowest and of the widest bracket minus that of the bracket at the turn."""
    return estimated(curve[0] - curve[turn]), estimated(curve[-1] - curve[turn])


def _turn(facts: Facts) -> Finding:
    judged = facts.judged
    turn = turn_of(judged.speeds, judged.same(MAIN))
    others = {
        "the GP's": judged.same(GP),
        "the VHGP's at equal n": judged.same(SAME_SIZE),
        f"the VHGP's on pushes of up to {speed_text(SLOW)} only": judged.slow(MAIN),
    }
    elsewhere = "; ".join(f"{name} {_speeds(turn_of(judged.speeds, curve))}" for name, curve in others.items())
    sentence = (
        f"The VHGP's NMSE on its own speeds is lowest with pushes of up to {_speeds(turn)}; {elsewhere}. "
        f"{facts.judged_on} A minimum at the last speed means that there is no turn. Rule: holds if the interval of "
        "the first lies within 50 to 80 mm/s, in part if only the value does, does not hold if the interval lies "
        "outside."
    )
    return Finding(CLAIM_TURN, turns_there(turn), sentence, number=f"up to {_speeds(turn)}")


def _direct(facts: Facts, departures: Sequence[Estimate]) -> Finding:
    error = estimated(facts.judged.slow(SAME_SIZE)[0])
    by_speed = dict(zip(facts.speeds[1:], departures[1:], strict=True))
    found = ", ".join(f"{speed_text(speed)} {d.text('.3f')}" for speed, d in by_speed.items())
    sentence = (
        f"Departure from the outcome at {speed_text(facts.speeds[0])}, in units of its variance, sum of 3, interval by "
        f"push: {found}. It is the mean squared distance of the outcomes of the same {facts.pushes} pushes after "
        f"{1e3 * TRAVEL:.0f} mm from the first contact. The VHGP of the slowest pushes has an error of "
        f"{error.text('.3f')} on slow pushes (n = {facts.same_size}). Rule: a departure is notable from "
        f"{NOTABLE:.0%} of that. Holds if it is notable at all speeds above 80 mm/s and at none up to 50; in part if "
        "at all above, but perhaps at some up to 50; does not hold if at some speed above it is not."
    )
    number = f"{departures[-1].text('.3f')} at {speed_text(facts.speeds[-1])}"
    return Finding(CLAIM_DIRECT, breaks_beyond(by_speed, error.value), sentence, number=number)


def _speed_as_input(facts: Facts) -> Finding:
    judged = facts.judged
    difference = estimated(judged.same(WITH_SPEED)[-1] - judged.same(MAIN)[-1])
    slowest = estimated(judged.same(WITH_SPEED)[0] - judged.same(MAIN)[0])
    sentence = (
        f"NMSE of the VHGP with the speed as an input minus that without it, same windows: {difference.text('+.3f')} "
        f"with pushes of up to {speed_text(judged.speeds[-1])}, {slowest.text('+.3f')} at "
        f"{speed_text(judged.speeds[0])} alone. {facts.judged_on} Rule: holds if the first lies below 0, does not "
        "hold if above."
    )
    return Finding(CLAIM_INPUT, lower(difference), sentence, number=f"NMSE {difference.text('+.3f')}")


def _picture(study: Study, facts: Facts, departures: Sequence[Estimate]) -> Picture:
    judged = facts.judged
    same, slow = (
        [Curve(series, tuple(map(estimated, of(series)))) for series in SERIES] for of in (judged.same, judged.slow)
    )
    count = len(judged.speeds)
    single = np.array([[judged.single(MAIN, k, place)[0] for k in range(count)] for place in range(count)])
    error = estimated(judged.slow(SAME_SIZE)[0]).value
    levels = {"error of the slowest VHGP": error, f"{NOTABLE:.0%} of it: notable": NOTABLE * error}
    path = draw(
        study.out / "quasi_static.png",
        (10.0, 8.2),
        lambda figure: paint_quasi_static(figure, judged.speeds, same, slow, single, facts.speeds, departures, levels),
    )
    return Picture(
        path,
        "NMSE by the top speed of the training pushes, map of NMSE by speed, departure from quasi-static outcomes",
        f"Simulated, {' on '.join(study.simulated.reference)}. Above: NMSE (sum of 3) by the top speed of the "
        f"training pushes, on held-out pushes of the same speeds, and on those of up to {speed_text(SLOW)} only; "
        f"{facts.rows} windows of every speed, or {facts.same_sizes} in every bracket (equal n). Below left: the "
        "VHGP without the speed, trained up to one speed, tested at another. Below right: departure of the outcome "
        f"from that at {speed_text(facts.speeds[0])} after equal travel. Grey: the paper's turn, 50 to 80 mm/s. "
        f"{facts.judged_on}",
    )


def _notes(study: Study, facts: Facts) -> tuple[str, ...]:
    skipped = [speed for k, speed in enumerate(facts.speeds) if k not in facts.judged.numbers]
    return (
        f"Windows are {1e3 * TRAVEL:.0f} mm of the tip's path at every speed, end to end from the first contact. They "
        "come from the simulator's true motion, because at 500 mm/s they last 10 ms, one sample of its tracker. They "
        "therefore have no sensor noise. The robot reaches its speed at least 2 mm before the contact.",
        "As we read the paper, each bracket is tested on pushes of its own speeds: faster pushes make the task "
        "harder as well as the data more. The slow pushes alone, and equal n, separate the two.",
        "Windows at high speed are those of pushes that stayed in contact, a selection; the departure is of all "
        "pushes.",
        "Inertia matters through the mass, friction and contact of our simulator. The turn depends on them, on the "
        "noise, on the number of windows at each speed, and on the length of a window: the slider is at rest at the "
        "first contact, so short windows see more of its acceleration. None of this proves anything about a real "
        "rig.",
        *([f"Too few training windows at {', '.join(map(speed_text, skipped))}."] if skipped else []),
        *(
            f"{corpus.title}: its windows have equal duration, not equal travel, so they are not used here."
            for corpus in study.measured
        ),
        *(() if study.measured else ("No measured pushes of several speeds were given.",)),
    )


def _speeds(turn: Estimate) -> str:
    return f"{Estimate(*(1e3 * v for v in (turn.value, turn.low, turn.high))).text('.0f')} mm/s"


def _json(facts: Facts, departures: Sequence[Estimate]) -> dict[str, Any]:
    judged = facts.judged
    count = range(len(judged.speeds))
    return {
        "speeds": list(facts.speeds),
        "top_speeds": list(judged.speeds),
        "windows": [len(table) for table in facts.windows],
        "rows_of_a_speed": facts.rows,
        "equal_n": [facts.size(SAME_SIZE, k) for k in count],
        "own_bracket": {s: [estimated(draws).json() for draws in judged.same(s)] for s in SERIES},
        "slow_pushes": {s: [estimated(draws).json() for draws in judged.slow(s)] for s in SERIES},
        "single_speeds": [[estimated(judged.single(MAIN, k, place)).json() for place in count] for k in count],
        "turn": {s: turn_of(judged.speeds, judged.same(s)).json() for s in SERIES},
        "departure": [d.json() for d in departures],
    }
