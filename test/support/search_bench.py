# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A search for effects on made-up pushes, in a library that is small enough for a test."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS
from push_predictor.models.push_model import PushModel
from push_predictor.residuals.candidates.candidate import candidates_of
from push_predictor.residuals.channels.motion import _rows
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.gate import Baseline, Gate, baseline_of
from push_predictor.residuals.selection.search import SearchResult, search

FEW = ("contact_friction", "pressure_spread", "tilted_surface")


def in_library(patch: pytest.MonkeyPatch, *names: str) -> None:
    """Only these mechanisms, of the library or its refinements, are tried: responses take most of the time."""
    for library, every in (("LIBRARY", LIBRARY), ("REFINEMENTS", REFINEMENTS)):
        few = tuple(mechanism for mechanism in every if mechanism.name in names)
        patch.setattr(f"push_predictor.residuals.candidates.candidate.{library}", few)


def gate_of(
    model: PushModel,
    evidence: Evidence,
    names: Sequence[str] | None = None,
    alpha: float = 0.01,
    *,
    baseline: Baseline | None = None,
    mechanisms: Sequence[str] | None = None,
) -> Gate:
    """The gate for these covariates; mechanisms: that are tried besides the generic polynomial, all if None."""
    inputs = inputs_basis(model, evidence.table)
    candidates = candidates_of(evidence, names, inputs)
    tried = [c for c in candidates if mechanisms is None or c.mechanism is None or c.mechanism in mechanisms]
    return Gate(evidence, tuple(tried), inputs, alpha, 0, baseline or baseline_of(model, evidence.mechanics))


def search_with(model: PushModel, gate: Gate) -> SearchResult:
    """The search behind a gate, with the rows that a trace of this model takes."""
    return search(gate, _rows(model, gate.evidence, gate.baseline, gate.inputs))
