# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The JSON of a trace, as docs/reference describes it."""

from __future__ import annotations

from typing import Any

from push_predictor.evaluation.validation import metrics_json
from push_predictor.residuals.evidence.input_shift import ShiftedInput
from push_predictor.residuals.outcome import CHANNELS, FoundEffect, Trace


def trace_json(trace: Trace) -> dict[str, Any]:
    """The JSON of a trace; unknown numbers are null, never NaN."""
    held_out = trace.held_out
    return {
        "verdict": trace.verdict,
        "input_shift": [_shift(shift) for shift in trace.input_shift],
        "effect_present": trace.verdict != "none",
        "channel": CHANNELS[trace.verdict],
        "kind": trace.kind,
        "covariates": [effect.covariate for effect in trace.effects],
        "equivalent": list(trace.equivalent),
        "undecided": trace.undecided,
        "motion_model_changed": trace.extended is not None,
        "effects": [_effect(effect, trace.weak) for effect in trace.effects],
        "harmless": [{"mechanism": each.mechanism, "parameter": vars(each.parameter)} for each in trace.harmless],
        "before": metrics_json(held_out.before),
        "refit": metrics_json(held_out.refit),
        "after": metrics_json(held_out.after),
        "gain": {"nmse": trace.gain_nmse.json(), "nlpd": trace.gain_nlpd.json()},
        "gain_over": trace.gain_over,
        "minimum_detectable": {name: dict(size) for name, size in trace.minimum_detectable.items()},
        "remaining": {"effect_present": trace.remaining is not None, "strongest": _strongest(trace)},
        "experiment": [],  # of the contract; advice on further pushes is in words, on the page
        "tested": [vars(tested) for tested in trace.tested],
        "pushes": {"analysis": len(trace.analysis.pushes), "held_out": len(held_out.table.pushes)},
        "held_out_sha256": held_out.digest,
        "mechanisms": list(trace.mechanisms),
        "alpha": trace.alpha,
        "model": trace.model.name,
        "notes": list(trace.notes),
    }


def _effect(effect: FoundEffect, weak: bool) -> dict[str, Any]:
    return {
        "mechanism": effect.mechanism,
        "covariate": effect.covariate,
        "outputs": list(effect.outputs),
        "form": effect.basis,
        "parameter": None if effect.parameter is None else vars(effect.parameter),
        "p_value": effect.p_value,
        "share_of_residual": effect.share_of_residual,
        "resembles": effect.resembles,
        "weak": weak,
    }


def _strongest(trace: Trace) -> str | None:
    if trace.remaining is None:
        return None
    mechanism, covariate = trace.remaining
    return f"{mechanism or 'unknown mechanism'} driven by {covariate}"


def _shift(shift: ShiftedInput) -> dict[str, Any]:
    return {
        "covariate": shift.covariate,
        "training": [float(end) for end in shift.training],
        "now": [float(end) for end in shift.now],
        "share_outside": float(shift.share_outside),
        "share_unvisited": float(shift.share_unvisited),
    }
