# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The JSON of a trace, as docs/reference describes it."""

from __future__ import annotations

from typing import Any

from push_predictor.evaluation.validation import metrics_json
from push_predictor.residuals.outcome import CHANNELS, FoundEffect, Gain, Trace
from push_predictor.residuals.reporting.input_shift import input_shift_json


def trace_json(trace: Trace) -> dict[str, Any]:
    """The JSON of a trace; unknown numbers are null, never NaN."""
    held_out = trace.held_out
    return {
        "verdict": trace.verdict,
        "input_shift": input_shift_json(trace),
        "effect_present": trace.verdict != "none",
        "channel": CHANNELS[trace.verdict],
        "kind": trace.kind,
        "covariates": [effect.covariate for effect in trace.effects],
        "equivalent": list(trace.equivalent),
        "undecided": trace.undecided,
        "motion_model_changed": trace.extended is not None,
        "effects": [_effect(effect) for effect in trace.effects],
        "before": metrics_json(held_out.before),
        "refit": metrics_json(held_out.refit),
        "after": metrics_json(held_out.after),
        "gain": {"nmse": _gain(trace.gain_nmse), "nlpd": _gain(trace.gain_nlpd)},
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


def _effect(effect: FoundEffect) -> dict[str, Any]:
    return {
        "mechanism": effect.mechanism,
        "covariate": effect.covariate,
        "outputs": list(effect.outputs),
        "form": effect.basis,
        "parameter": None if effect.parameter is None else vars(effect.parameter),
        "p_value": effect.p_value,
        "share_of_residual": effect.share_of_residual,
        "resembles": effect.resembles,
    }


def _strongest(trace: Trace) -> str | None:
    if trace.remaining is None:
        return None
    mechanism, covariate = trace.remaining
    return f"{mechanism or 'unknown mechanism'} driven by {covariate}"


def _gain(gain: Gain) -> dict[str, float | None]:
    return {name: (value if value == value else None) for name, value in vars(gain).items()}
