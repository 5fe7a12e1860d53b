# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Up to which speed does the quasi-static assumption hold? Models without the speed, of growing top speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from push_predictor.evaluation.estimate import Estimate, of_draws, total_nmse
from push_predictor.evaluation.push_scores import PushScores, pooled
from push_predictor.evaluation.splits import FOLDS
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.canvas import Picture
from push_predictor.types import Array
from push_predictor_paper.claims import TURN
from push_predictor_paper.data.time_scaled import (
    TRAVEL,
    Bracket,
    equal_travel,
    number_of,
    score_bracket,
    speed_windows,
    training_rows,
)
from push_predictor_paper.estimate import fold_weights, of_ends
from push_predictor_paper.painters.curves import LOOKS, SPEED_TICKS, Line, Panel, paint_curves
from push_predictor_paper.section import Number, Section, Table, TooFewError, picture, speed_text
from push_predictor_paper.study import Study
from push_predictor_paper.verdict import Bound, Evidence, Figure

FEWEST, MOST = 10, 50  # training windows of a speed
EQUAL = 200  # training windows of the control, in every bracket
SERIES = MAIN, SAME_SIZE, WITH_SPEED = "VHGP", "VHGP, equal n", "VHGP with speed as input"
SLOW = 0.02  # m/s and below: the slowest pushes
NOTABLE = 0.1  # of a model's error
NOTES = (
    f"Windows are {1e3 * TRAVEL:.0f} mm of the tip's path at every speed, end to end from the first contact. They "
    "come from the simulator's true motion, because at 500 mm/s they last 10 ms, one sample of its tracker. They "
    "therefore have no sensor noise. The robot reaches its speed at least 2 mm before the contact.",
    "As we read the paper, each bracket is tested on pushes of its own speeds: faster pushes make the task "
    "harder as well as the data more. The slow pushes alone, and equal n, separate the two. Intervals resample folds "
    "with their models, and held-out pushes within.",
    "Windows at high speed are those of pushes that stayed in contact, a selection; the departure is of all pushes. "
    "Inertia matters through the simulator's mass, friction and contact, and through the length of a window, which "
    "begins at rest. None of this proves anything about a real rig.",
)


@dataclass(frozen=True, eq=False)
class Brackets:
    """Scores of models of growing brackets of speeds, all on the same held-out pushes.

    speeds: top speeds (m/s) of the brackets. numbers: their places in the plan. rows: training windows of each speed;
    same_size: of a bracket of the control. scores: by series, one per bracket.
    """

    speeds: tuple[float, ...]
    numbers: tuple[int, ...]
    rows: int
    same_size: int
    scores: Mapping[str, Sequence[PushScores]]

    def size(self, series: str, bracket: int) -> int:
        """The number of training windows of a bracket."""
        return _rows(series, bracket + 1, self.rows, self.same_size) * (bracket + 1)

    def same(self, series: str) -> Array:
        """NMSE (brackets, 1 + draws) of each bracket on held-out pushes of its own speeds; the first is the value."""
        return np.array([self._draws(series, k, self.numbers[: k + 1]) for k in range(len(self.speeds))])

    def slow(self, series: str) -> Array:
        """NMSE on the slowest pushes only."""
        slow = [n for n, speed in zip(self.numbers, self.speeds, strict=True) if speed <= 1.001 * SLOW]
        return np.array([self._draws(series, k, slow) for k in range(len(self.speeds))])

    def _draws(self, series: str, bracket: int, numbers: Sequence[int]) -> Array:
        """The value, then its resamples of folds with their models, and of pushes within."""
        push_scores = self.scores[series][bracket]
        speed, push = np.array([number_of(name) for name in push_scores.push_id.tolist()]).T
        weights = fold_weights(push, push % FOLDS) * np.isin(speed, numbers)
        with np.errstate(invalid="ignore", divide="ignore"):  # a draw without any such push
            return total_nmse(push_scores.totals(weights))


def section(study: Study) -> Section:
    """NMSE by the top speed of the training pushes, and the departure of outcomes from those of slow pushes."""
    plan, pair = study.plan, study.simulated.reference
    calls = [(plan, *pair, number) for number in range(len(plan.speeds))]
    windows = study.work.run("pushes of equal travel", speed_windows, calls)
    equal = study.work.run("the same pushes at every speed", equal_travel, calls)
    models = brackets_of(study, windows)
    departures = {speed: departure(equal[0], other) for speed, other in zip(plan.speeds, equal, strict=True)}
    error = estimated(models.slow(SAME_SIZE)[0]).value
    return Section(
        {
            "course": course(models),
            "turn": turn(models),
            "beyond": beyond({speed: d for speed, d in departures.items() if speed > plan.speeds[0]}, error),
            "speed_input": speed_as_input(models),
        },
        (_bracket_table(models),),
        (_picture(study, models, departures, error),),
        NOTES,
    )


def brackets_of(study: Study, windows: Sequence[PushTable]) -> Brackets:
    """Train and score all models. Raises TooFewError unless two speeds have enough windows."""
    plan, folds = study.plan, range(study.plan.seeds)
    least = [min(len(training_rows(w, Bracket(MAIN, 1, len(w), False, fold))) for fold in folds) for w in windows]
    numbers = tuple(k for k, count in enumerate(least) if count >= FEWEST)
    if len(numbers) < 2:
        raise TooFewError(f"Fewer than two speeds gave {FEWEST} training windows in every fold.")
    rows = min([MOST, *(least[k] for k in numbers)])
    same_size = min([EQUAL, *(least[k] * (place + 1) for place, k in enumerate(numbers))])
    brackets = {
        (series, k, fold): Bracket("vhgp", k + 1, _rows(series, k + 1, rows, same_size), series == WITH_SPEED, fold)
        for series in SERIES
        for k in range(len(numbers))
        for fold in folds
    }
    usable, rig = [windows[k] for k in numbers], study.simulated.sets[study.simulated.reference].rig
    done = study.work.run("models of time-scaled pushes", score_bracket, [(usable, rig, b) for b in brackets.values()])
    found = dict(zip(brackets, done, strict=True))
    scores = {s: [pooled([found[s, k, f] for f in folds]) for k in range(len(numbers))] for s in SERIES}
    return Brackets(tuple(plan.speeds[k] for k in numbers), numbers, rows, same_size, scores)


def course(models: Brackets) -> Evidence:
    """Do faster pushes first help, then harm? Against the last bracket whose top speed is in the paper's range."""
    within = [k for k, speed in enumerate(models.speeds) if TURN[0] <= speed <= TURN[1]]
    if not within:
        return Evidence(note="No bracket of speeds ends at 50 to 80 mm/s.")
    gain, harm = _against(models.same(MAIN), within[-1])
    figures = [Figure("slowest bracket", gain), Figure(f"bracket up to {speed_text(models.speeds[-1])}", harm)]
    equal = " and ".join(e.text("+.3f") for e in _against(models.same(SAME_SIZE), within[-1]))
    return Evidence(figures, f"At equal n {equal}: a gain that vanishes there comes from more data.")


def turn(models: Brackets) -> Evidence:
    """With pushes of up to which speed is a model best?"""
    others = {SAME_SIZE: models.same(SAME_SIZE), "slow pushes only": models.slow(MAIN)}
    found = (f"{n} {turn_of(models.speeds, curve).times(1e3).text('.0f')} mm/s" for n, curve in others.items())
    note = f"Others: {'; '.join(found)}. A minimum at the last speed means that there is no turn."
    return Evidence([Figure("up to", turn_of(models.speeds, models.same(MAIN)).times(1e3))], note)


def beyond(departures: Mapping[float, Estimate], error: float) -> Evidence:
    """Do outcomes depart notably from quasi-static ones at all speeds beyond the paper's turn, and not before?"""
    slow = [d.times(1.0 / error) for speed, d in departures.items() if d.high > 0.0 and speed <= 1.001 * TURN[0]]
    fast = [d.times(1.0 / error) for speed, d in departures.items() if speed > 1.001 * TURN[1]]
    if not (slow and fast and np.isfinite(error)):
        return Evidence(note="No speeds on both sides of 50 to 80 mm/s.")
    figures = [
        Figure("least above 80 mm/s", of_ends(np.min, fast)),
        Figure("largest up to 50 mm/s", of_ends(np.max, slow), Bound(high=NOTABLE)),
    ]
    note = (
        "The departure is the mean squared distance of the outcomes of the same pushes after "
        f"{1e3 * TRAVEL:.0f} mm from the first contact, in units of the variance; interval by push."
    )
    return Evidence(figures, note)


def speed_as_input(models: Brackets) -> Evidence:
    """Is a model better with the speed as an input?"""
    all_speeds, slowest = (estimated(models.same(WITH_SPEED)[k] - models.same(MAIN)[k]) for k in (-1, 0))
    return Evidence([Figure("", all_speeds)], f"At {speed_text(models.speeds[0])} alone {slowest.text('+.3f')}.")


def estimated(draws: Array) -> Estimate:
    """Estimate from a value and its draws (1 + draws,); NaN draws are skipped."""
    known = draws[1:][np.isfinite(draws[1:])]
    return of_draws(draws[0], known) if len(known) else Estimate(float(draws[0]), np.nan, np.nan)


def turn_of(speeds: Sequence[float], curves: Array) -> Estimate:
    """The speed (m/s) at which curves (brackets, 1 + draws) are lowest, with interval."""
    lowest = np.argmin(np.where(np.isfinite(curves), curves, np.inf), axis=0)
    return estimated(np.asarray(speeds)[lowest])


def departure(slowest: Array, other: Array) -> Estimate:
    """Squared distance of outcomes from those of the same pushes at the slowest speed.

    In units of the variance at the slowest speed, summed over outputs: the NMSE of a prediction whose only error is the
    quasi-static assumption.
    """
    squared = ((other - slowest) ** 2 / slowest.var(axis=0)).sum(axis=1)
    rows = np.random.default_rng(0).integers(0, len(squared), (1000, len(squared)))
    return of_draws(float(squared.mean()), squared[rows].mean(axis=1))


def _rows(series: str, speeds: int, rows: int, same_size: int) -> int:
    return max(1, same_size // speeds) if series == SAME_SIZE else rows


def _against(curve: Array, middle: int) -> tuple[Estimate, Estimate]:
    """NMSE of the slowest and of the widest bracket minus that of the bracket in the middle."""
    return estimated(curve[0] - curve[middle]), estimated(curve[-1] - curve[middle])


def _bracket_table(models: Brackets) -> Table:
    """NMSE by bracket of speeds."""
    curves = [models.same(series) for series in SERIES] + [models.slow(MAIN), models.slow(SAME_SIZE)]
    rows = tuple(
        (
            f"up to {speed_text(speed)}",
            models.size(MAIN, k),
            models.size(SAME_SIZE, k),
            *(Number(estimated(curve[k]), ".3f") for curve in curves),
        )
        for k, speed in enumerate(models.speeds)
    )
    caption = (
        f"NMSE (sum of 3) by the top speed of the training pushes. Simulated; {models.rows} windows of each speed, or "
        "n in all (equal n). First three: on held-out pushes of the same speeds; last two: on pushes of up to "
        f"{speed_text(SLOW)} only. The paper shows the first as a curve, lowest at 50 to 80 mm/s, without numbers."
    )
    slow = (f"slow pushes: {MAIN}", f"slow pushes: {SAME_SIZE}")
    return Table(caption, ("training pushes", "n", "equal n", *SERIES, *slow), rows)


def _picture(study: Study, models: Brackets, departures: Mapping[float, Estimate], error: float) -> Picture:
    across, shaded = "top speed of the training pushes (mm/s)", (1e3 * TURN[0], 1e3 * TURN[1])
    speeds, tops = [1e3 * speed for speed in departures], [1e3 * top for top in models.speeds]
    ticks = [tick for tick in SPEED_TICKS if tick <= 1.01 * max(speeds)]
    panels = [
        Panel(
            title,
            across,
            "NMSE, sum of 3",
            [
                Line(name, LOOKS[k], tops, [estimated(draws) for draws in of(name)], banded=False)
                for k, name in enumerate(SERIES)
            ],
            ticks,
            ratio=True,
            shaded=shaded,
        )
        for title, of in (("held-out pushes of the same speeds", models.same), ("slowest held-out pushes", models.slow))
    ]
    levels = {"error of the slowest VHGP": error, f"{NOTABLE:.0%} of it: notable": NOTABLE * error}
    line = Line("departure", LOOKS[0], speeds, list(departures.values()))
    label, title = f"departure from {speed_text(study.plan.speeds[0])} (NMSE)", "the same push at another speed"
    top = 1.3 * max(v for d in departures.values() for v in (d.high, error) if np.isfinite(v))
    panels.append(Panel(title, "speed (mm/s)", label, [line], ticks, shaded=shaded, levels=levels, limits=(0.0, top)))
    return picture(
        study.out / "quasi_static.png",
        (11.0, 4.0),
        partial(paint_curves, rows=[panels], shared=False),
        "NMSE by the top speed of the training pushes, and departure from quasi-static outcomes. Simulated, "
        f"{study.simulated.reference_name}. Left and middle: NMSE (sum of 3) on held-out pushes of the same "
        f"speeds, and on those of up to {speed_text(SLOW)} only; {models.rows} windows of every speed, or the same "
        "number in every bracket (equal n). Right: departure of the outcome from that at "
        f"{speed_text(study.plan.speeds[0])} after equal travel. Grey: the paper's turn, 50 to 80 mm/s.",
    )
