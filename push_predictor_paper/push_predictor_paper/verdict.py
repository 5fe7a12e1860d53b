# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rule of every verdict: the interval of a figure against the bound that its claim sets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from push_predictor.evaluation.estimate import Estimate

Verdict = Literal["holds", "holds in part", "does not hold", "not decided"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
RULE = (
    "One rule for all verdicts. A claim holds if the 95 % intervals of all its figures lie within the required range. "
    "It holds in part if some do, or if some lie within the wider range, where one is stated. It does not hold if none "
    "does and one lies wholly outside of that. Else the data do not decide."
)


@dataclass(frozen=True)
class Bound:
    """The range that a claim requires of a figure. strict: without its ends."""

    low: float = -np.inf
    high: float = np.inf
    strict: bool = False

    def contains(self, figure: Estimate) -> bool:
        """Whether the whole interval of the figure lies within."""
        if self.strict:
            return self.low < figure.low and figure.high < self.high
        return self.low <= figure.low and figure.high <= self.high

    def excludes(self, figure: Estimate) -> bool:
        """Whether the whole interval of the figure lies outside."""
        return figure.high < self.low or figure.low > self.high

    def text(self, form: str, unit: str = "") -> str:
        """The range in words: at least 0.90; below 0; 10% to 40%."""
        low, high = (_end(end, form) for end in (self.low, self.high))
        least, most = ("above", "below") if self.strict else ("at least", "at most")
        words = f"{most} {high}" if np.isinf(self.low) else f"{least} {low}" if np.isinf(self.high) else ""
        return f"{words or f'{low} to {high}'} {unit}".rstrip()


@dataclass(frozen=True)
class Claim:
    """A claim of the paper: its text, its place in the paper, what is measured here, and the range that it requires.

    partly: the wider range in which it holds in part. form, unit: of the figures. paper: the paper's own number.
    """

    text: str
    place: str
    figure: str
    within: Bound
    partly: Bound | None = None
    form: str = ".2f"
    unit: str = ""
    paper: str = ""


@dataclass(frozen=True)
class Figure:
    """A measured figure of a claim, by name; within: the range required of it, where it is not the claim's.

    text: of the figure, where it is not that of the estimate.
    """

    name: str
    estimate: Estimate
    within: Bound | None = None
    text: str = ""


@dataclass(frozen=True)
class Evidence:
    """The figures of a claim; note: more about them, whole sentences."""

    figures: Sequence[Figure] = ()
    note: str = ""


@dataclass(frozen=True)
class Finding:
    """A claim with its verdict. number: the figures that decide; sentence: what they are, and what is required."""

    claim: str
    place: str
    verdict: Verdict
    number: str
    sentence: str
    figures: tuple[Figure, ...]

    def json(self) -> dict[str, Any]:
        """The finding, and its figures as numbers."""
        figures = [{"name": figure.name, **figure.estimate.json()} for figure in self.figures]
        return {**vars(self), "figures": figures}


def verdict_of(figures: Sequence[tuple[Estimate, Bound, Bound | None]]) -> Verdict:
    """The verdict on figures, each with the range required of it and the wider one; see RULE."""
    inside = [within.contains(figure) for figure, within, _ in figures]
    if not inside:
        return "not decided"
    if all(inside):
        return "holds"
    wider = [(figure, partly or within) for figure, within, partly in figures]
    if any(within.contains(figure) for figure, within in wider):
        return "holds in part"
    return "does not hold" if any(within.excludes(figure) for figure, within in wider) else "not decided"


def judged(claim: Claim, evidence: Evidence, of: str = "") -> Finding:
    """The finding on a claim; of: the pushes, in words."""
    figures, note = evidence.figures, evidence.note
    text = f"{claim.text} ({of})" if of else claim.text
    if not figures:
        return Finding(text, claim.place, "not decided", "–", note, ())
    every = [(f.estimate, f.within or claim.within, None if f.within else claim.partly) for f in figures]
    number = "; ".join(f"{f.name} {f.text or figure_text(f.estimate, claim)}".strip() for f in figures)
    required = [_required(claim, within, partly) for _, within, partly in every]
    same = len(set(required)) == 1
    words = required[0] if same else "; ".join(f"{f.name} {r}" for f, r in zip(figures, required, strict=True))
    paper = f" The paper: {claim.paper}." if claim.paper else ""
    sentence = f"{claim.figure}: {number}. Required: {words}.{paper}{f' {note}' if note else ''}"
    return Finding(text, claim.place, verdict_of(every), number, sentence, tuple(figures))


def figure_text(figure: Estimate, claim: Claim) -> str:
    """A figure with its interval, in the form and unit of the claim; one that is exact has no interval."""
    exact = figure.low == figure.value == figure.high
    return f"{_end(figure.value, claim.form) if exact else figure.text(claim.form)} {claim.unit}".rstrip()


def _required(claim: Claim, within: Bound, partly: Bound | None) -> str:
    wider = f" (in part: {partly.text(claim.form, claim.unit)})" if partly else ""
    return within.text(claim.form, claim.unit) + wider


def _end(value: float, form: str) -> str:
    return "0" if value == 0.0 else format(value, form).replace("-", "−")
