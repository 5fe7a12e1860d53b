# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""In words, why a push lies outside the domain of a model's training data."""

from __future__ import annotations

import numpy as np

from push_predictor.models.effects.covariates import UNITS
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.types import BoolArray

OUT_OF_DOMAIN = "out of domain"


def domain_remark(model: PushModel, push: Push, in_domain: BoolArray) -> str:
    """What a client should know of n predicted pushes, of which in_domain (n,) are in the domain; empty if all are.

    The text begins with OUT_OF_DOMAIN, and names what is outside for the first push that is.
    """
    count = len(in_domain)
    if count == 1:  # in plain numbers: a server adds it to single predictions
        return "" if in_domain[0] else f"{OUT_OF_DOMAIN}: {_reason(model, push, 0)}"
    if in_domain.all():
        return ""
    first, outside = int(in_domain.argmin()), int(np.count_nonzero(~in_domain))
    reason = _reason(model, push, first)
    return f"{OUT_OF_DOMAIN}: {outside} of {count} pushes, first push {first}: {reason}"


def _reason(model: PushModel, push: Push, row: int) -> str:
    velocity, contact, angle = push.inputs[row].tolist()
    limits, outside = model.input_limits, []
    for name, value, (low, high) in (("velocity", velocity, limits.velocity), ("angle", angle, limits.angle)):
        if not low <= value <= high:
            outside.append(_outside(name, name, value, f"{low:.4g} to {high:.4g}"))
    if model.covariate_ranges:
        alone = push if len(push.inputs) == 1 else push.take(slice(row, row + 1))
        outside += _outside_covariates(model, alone)
    return "; ".join(outside) or f"contact {contact:.4g}, beyond those of the training pushes"


def _outside_covariates(model: PushModel, alone: Push) -> list[str]:
    """What is outside of the covariates of one push."""
    completed, found = model.predictor.completed(alone).covariates, []
    for name, known in model.covariate_ranges.items():
        if not known.contains(completed[name])[0]:
            found.append(_outside(f"covariate {name}", name, float(completed[name][0]), str(known)))
    return found


def _outside(title: str, name: str, value: float, accepted: str) -> str:
    unit = f" {UNITS[name]}" if name in UNITS else ""
    return f"{title} {value:.4g}{unit}, training covers {accepted}{unit}"
