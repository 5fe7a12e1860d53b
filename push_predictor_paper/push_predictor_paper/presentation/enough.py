# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Which sections of a report have too little data for a verdict, as with --quick, and why."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from push_predictor_paper.plan import FULL, Plan

REPETITIONS = 31  # from here on the interval of a Gaussian's standard deviation is at most 25 % to each side
WINDOWS = 1000  # training windows at which the paper says that performance has saturated
HIGH_SPEED = 0.5  # m/s, the highest of the paper's data
PUSHES = 50  # at each speed: half of the full plan's


def too_little(plan: Plan) -> dict[str, str]:
    """By the key of the section: what the plan has, and what its claims require; sections with enough are left out."""
    found = {key: reason(plan) for key, reason in REASONS.items()}
    return {key: text for key, text in found.items() if text}


def _sets(plan: Plan) -> str:
    count, whole = len(plan.pairs), len(FULL.pairs)
    return f"{count} sets of shape and surface; {whole} are required" if count < whole else ""


def _repetitions(plan: Plan) -> str:
    few = min(plan.repetitions, plan.other_repetitions)
    return f"{few} repetitions of each push; {REPETITIONS} are required" if few < REPETITIONS else ""


def _windows(plan: Plan) -> str:
    return f"up to {plan.size} training windows; {WINDOWS} are required" if plan.size < WINDOWS else ""


def _speeds(plan: Plan) -> str:
    top = max(plan.speeds)
    return f"speeds up to {1e3 * top:.0f} mm/s; {1e3 * HIGH_SPEED:.0f} mm/s is required" if top < HIGH_SPEED else ""


def _pushes(plan: Plan) -> str:
    few = f"{plan.speed_pushes} pushes at each speed; {PUSHES} are required"
    return few if plan.speed_pushes < PUSHES else ""


REASONS: Mapping[str, Callable[[Plan], str]] = {
    "data": _sets,
    "kinds_of_push": _repetitions,
    "maps": _repetitions,
    "noise": _repetitions,
    "learning_curves": _windows,
    "mean_gain": _windows,
    "speed_error": _speeds,
    "divergence": _repetitions,
    "modality": _repetitions,
    "quasi_static": _pushes,
}
