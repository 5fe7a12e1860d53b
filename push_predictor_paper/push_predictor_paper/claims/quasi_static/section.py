"""How fast may a push be for the quasi-static assumption: models that are not told the speed, of growing top speed."""

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
    TOLD,
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
from push_predictor_paper.claims.quasi_static.tables import bracket_table, single_table, speed_table, told
from push_predictor_paper.data.time_scaled import TRAVEL
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.figures.quasi_static import Curve, paint_quasi_static
from push_predictor_paper.section import Finding, Section
from push_predictor_paper.study import Study


def section(study: Study) -> Section:
    """NMSE against the top speed of the training pushes, and how far outcomes depart from the slow ones."""
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
            _told(facts),
        ),
        tables=(bracket_table(facts), single_table(facts), speed_table(facts)),
        pictures=(_picture(study, facts, departures),),
        notes=_notes(study, facts),
        data=_json(facts, departures),
    )


TITLE = "The quasi-static assumption: pushes of all speeds scaled to 10 mm/s"
CLAIM_COURSE = "Adding faster pushes to a model that is not told the speed first helps, then harms"
CLAIM_TURN = "It is best with pushes of up to 50 to 80 mm/s"
CLAIM_DIRECT = "The quasi-static assumption does not hold beyond 50 to 80 mm/s"
CLAIM_TOLD = "There is value in the speed as an input"


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
        f"NMSE of the VHGP on held-out pushes of its own bracket, against that of the bracket up to "
        f"{told(judged.speeds[turn])}: the slowest alone has {gain.text('+.3f')} (above 0: adding helped), all up "
        f"to {told(judged.speeds[-1])} {harm.text('+.3f')} (above 0: adding harmed). With {facts.same_sizes} windows "
        f"in every bracket instead: {equal_gain.text('+.3f')} and {equal_harm.text('+.3f')}; what helps in the first "
        "pair only comes of more data, not of faster pushes. On the slow pushes alone (up to "
        f"{told(SLOW)}): {slow_gain.text('+.3f')} and {slow_harm.text('+.3f')}, at equal n "
        f"{slow_equal[0].text('+.3f')} and {slow_equal[1].text('+.3f')}. {facts.judged_on} Holds if both of the first "
        "pair lie above 0, in part if one does; does not hold if none does and one lies below."
    )
    return Finding(CLAIM_COURSE, helps_then_harms(gain, harm), sentence)


def _against(curve: Array, turn: int) -> tuple[Estimate, Estimate]:
    """The slowest bracket and the widest less that at the turn."""
    return estimated(curve[0] - curve[turn]), estimated(curve[-1] - curve[turn])


def _turn(facts: Facts) -> Finding:
    judged = facts.judged
    turn = turn_of(judged.speeds, judged.same(MAIN))
    others = {
        "the GP's": judged.same(GP),
        "the VHGP's at equal n": judged.same(SAME_SIZE),
        f"the VHGP's on pushes of up to {told(SLOW)} only": judged.slow(MAIN),
    }
    elsewhere = "; ".join(f"{name} {_speeds(turn_of(judged.speeds, curve))}" for name, curve in others.items())
    sentence = (
        f"The VHGP's NMSE on its own bracket is lowest with pushes of up to {_speeds(turn)}; {elsewhere}. "
        f"{facts.judged_on} At the last speed means: it never turns. "
        "Holds if the interval of the first lies within 50 to 80 mm/s, in part if the value alone does, does not hold "
        "if the interval lies outside."
    )
    return Finding(CLAIM_TURN, turns_there(turn), sentence)


def _direct(facts: Facts, departures: Sequence[Estimate]) -> Finding:
    error = estimated(facts.judged.slow(SAME_SIZE)[0])
    by_speed = dict(zip(facts.speeds[1:], departures[1:], strict=True))
    found = ", ".join(f"{told(speed)} {d.text('.3f')}" for speed, d in by_speed.items())
    sentence = (
        f"The same {facts.pushes} pushes (contact, angle, place, draws) at every speed, outcome after "
        f"{1e3 * TRAVEL:.0f} mm from the touch: mean squared distance from the outcome at {told(facts.speeds[0])}, in "
        f"units of its variance, sum of 3, interval by push: {found}. The VHGP of the slowest pushes itself errs by "
        f"{error.text('.3f')} on slow pushes (n = {facts.same_size}). Notable is {NOTABLE:.0%} of that. Holds "
        "if all speeds above 80 mm/s are notable and none up to 50; in part if all above are, but some up to 50 may "
        "be too; does not hold if some above is not."
    )
    return Finding(CLAIM_DIRECT, breaks_beyond(by_speed, error.value), sentence)


def _told(facts: Facts) -> Finding:
    judged = facts.judged
    difference = estimated(judged.same(TOLD)[-1] - judged.same(MAIN)[-1])
    slowest = estimated(judged.same(TOLD)[0] - judged.same(MAIN)[0])
    sentence = (
        f"NMSE of the VHGP that is told the speed less that of the one that is not, same windows, pushes of up to "
        f"{told(judged.speeds[-1])}: {difference.text('+.3f')}; at {told(judged.speeds[0])} alone "
        f"{slowest.text('+.3f')}. {facts.judged_on} Holds if the first lies below 0, does not if above."
    )
    return Finding(CLAIM_TOLD, lower(difference), sentence)


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
        "NMSE against the top speed of the training pushes, map of NMSE by speed, departure from quasi-static outcomes",
        f"Simulated, {' on '.join(study.simulated.reference)}. Above: NMSE (sum of 3) against the top speed of the "
        f"training pushes, on held-out pushes of the same speeds, and on those of up to {told(SLOW)} only; "
        f"{facts.rows} windows of every speed, or {facts.same_sizes} in every bracket (equal n). Below left: the VHGP "
        "that is not told, trained up to one speed, judged at one. Below right: departure of the same push's outcome "
        "from that "
        f"at {told(facts.speeds[0])} after equal travel. Grey: the paper's turn, 50 to 80 mm/s. {facts.judged_on}",
    )


def _notes(study: Study, facts: Facts) -> tuple[str, ...]:
    left_out = [speed for k, speed in enumerate(facts.speeds) if k not in facts.judged.numbers]
    return (
        f"Windows are {1e3 * TRAVEL:.0f} mm of the tip's way at every speed, end to end from the first touch, taken "
        "from the simulator's true motion: at 500 mm/s they last 10 ms, one sample of its tracker. So they carry no "
        "sensor noise, and the robot reaches its speed at least 2 mm before the touch at any speed.",
        "As we read the paper, each bracket is judged on pushes of its own speeds: faster pushes make the task harder "
        "as well as the data more. The slow pushes alone, and equal n, take the two apart.",
        "Windows at high speed are those of pushes that kept in touch, a selection; the departure is of all pushes.",
        "That inertia matters follows from mass, friction and contact of our simulator. Where the turn comes depends "
        "on them, on the noise, on how many windows each speed gives, and on a window's length: the slider is at "
        "rest at the first touch, so short windows see more of its setting in motion. It proves nothing about the "
        "world.",
        *([f"Too few windows to learn from at {', '.join(map(told, left_out))}."] if left_out else []),
        *(
            f"{corpus.title}: its windows are of equal duration, not of equal travel, and are not judged here."
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
