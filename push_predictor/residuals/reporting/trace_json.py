"""A trace as the JSON of the contract's section 5."""

from __future__ import annotations

from typing import Any

from push_predictor.evaluation.validation import metrics_json
from push_predictor.residuals.outcome import CHANNELS, FoundEffect, Gain, Trace


def trace_json(trace: Trace) -> dict[str, Any]:
    """The JSON; NaN does not occur, what is not known is null."""
    held_out = trace.held_out
    return {
        "verdict": trace.verdict,
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
        "minimum_detectable": {name: dict(size) for name, size in trace.minimum_detectable.items()},
        "remaining": {"effect_present": trace.remaining is not None, "strongest": trace.remaining},
        "experiment": [dict(push) for push in trace.experiment],
        "tested": [vars(tested) for tested in trace.tested],
        "pushes": {"analysis": len(trace.analysis.pushes), "held_out": len(held_out.table.pushes)},
        "held_out_sha256": held_out.digest,
        "mechanisms": list(trace.mechanisms),
        "alpha": trace.alpha,
        "model": trace.model.name,
        "notes": list(trace.notes),
    }


def _effect(effect: FoundEffect) -> dict[str, Any]:
    parameter = None if effect.parameter is None else vars(effect.parameter)
    return {**vars(effect), "outputs": list(effect.outputs), "parameter": parameter}


def _gain(gain: Gain) -> dict[str, float | None]:
    return {name: (value if value == value else None) for name, value in vars(gain).items()}
