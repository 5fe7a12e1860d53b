# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The gain of a model with the true mechanism, driver and basis, on the same split as the trace."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.report.tables import paired_difference
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.mechanisms import LIBRARY
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import candidate
from push_predictor.residuals.evidence.drivers import standard_basis, two_dimensional
from push_predictor.residuals.evidence.loading import load_evidence
from push_predictor.residuals.evidence.standardised import evidence_of, held_out_rows
from push_predictor.residuals.extension.extended_model import extend, refit_base
from push_predictor.residuals.extension.held_out_gain import compared, held_out_gain
from push_predictor.types import Array


def oracle_gain(recording: Path, model_path: Path, truth: Mapping[str, Any]) -> dict[str, Any] | None:
    """NLPD after minus refit on the held-out pushes: value, low, high; None if the mean of the motion is unchanged.

    traced: the same over the reference of `trace`, which is harder to beat. A mechanism outside the library becomes the
    generic response to the true driver. Of two effects both are given.
    """
    if truth["channel"] != "motion":
        return None
    model, table = load_model(model_path), load_evidence([recording]).table
    held_out = held_out_rows(table)
    analysis, rest = table.take(~held_out), table.take(held_out)
    refit = refit_base(model, analysis)
    evidence = evidence_of(model, analysis)
    effects = [effect for effect in (truth, truth.get("second")) if effect]
    after = extend(refit, evidence, [candidate(evidence, *true_term(effect, analysis)) for effect in effects])
    traced = held_out_gain(model, refit, after, analysis, rest)
    return {**vars(gain(refit, after, rest)[1]), "traced": vars(traced.nlpd)}


def gain(
    refit: PushModel, after: PushModel, held_out: PushTable, training_mean: Array | None = None
) -> tuple[Estimate, Estimate]:
    """After minus refit in NMSE and in NLPD; training_mean (3,): the reference of the NMSE, the refit's if None."""
    mean = refit.training_mean if training_mean is None else training_mean
    return paired_difference(*(compared(model, held_out, mean) for model in (refit, after)))


def true_term(truth: Mapping[str, Any], table: PushTable) -> tuple[str | None, str, DriverBasis]:
    """Mechanism (None: the generic one), covariate and basis of the truth, on the windows of a table."""
    known = {mechanism.name for mechanism in LIBRARY}
    named = [name for name in truth["names"] if name in known]
    mechanism = named[0] if named and None not in truth["names"] else None
    return mechanism, truth["covariates"][0], true_basis(truth, table)


def true_basis(truth: Mapping[str, Any], table: PushTable) -> DriverBasis:
    """The basis of the truth with centre and scale of the driver in these windows."""
    driver, basis = truth["covariates"][0], truth["form"]
    if basis == "constant" and (driver not in table.covariates or truth["names"][0] is not None):
        return DriverBasis("constant")
    if driver in ("slider_x", "slider_y"):
        return two_dimensional(table)
    values = table.covariates[driver]
    if basis == "category" or driver == "edge":
        return DriverBasis("category", (driver,), levels=tuple(float(level) for level in np.unique(values)))
    if basis == "periodic":
        return DriverBasis("periodic", (driver,))
    if basis == "step":
        return DriverBasis("step", (driver,), place=float(truth["place"]))
    return standard_basis(_smooth(truth), driver, values)


def _smooth(truth: Mapping[str, Any]) -> str:
    if "saturating" in (truth.get("course"), truth["form"]):
        return "logarithmic"
    return "quadratic" if truth["form"] in ("constant", "quadratic", "map") else "linear"
