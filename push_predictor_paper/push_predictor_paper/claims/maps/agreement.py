# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Agreement between the maps of models and of repetitions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.recordings.table import OUTPUTS
from push_predictor.types import Array
from push_predictor_paper.data.repetitions import Repetitions
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.fits.fit import Answer
from push_predictor_paper.section import Finding, Table, Verdict
from push_predictor_paper.statistics.grid_maps import block_weights, by_blocks, correlation, relative_error

MEAN_ALIKE, SD_ALIKE = 0.9, 0.5  # correlation
NAMES = ("dx", "dy", "rotation")


@dataclass(frozen=True)
class Likeness:
    """Agreement of one map of a model with that of the repetitions.

    error: squared error over the map's variance. size: root mean square of the model over that of the repetitions.
    """

    correlation: Estimate
    error: Estimate
    size: float


Likenesses = Mapping[tuple[str, str], tuple[Likeness, ...]]  # (quantity, model) -> by output
QUANTITIES = {"mean": "mean", "sd": "sd of an outcome", "process_sd": "sd of the process noise alone"}


def likenesses(cells: list[Repetitions], answers: Mapping[str, Sequence[Answer]]) -> Likenesses:
    """Agreement in mean, sd of an outcome and sd of the noise alone, for each model at these pushes.

    answers: by model, one for each draw of its training windows; the results are averaged over them.
    """
    truth = {"mean": np.array([cell.mean for cell in cells]), "sd": np.array([cell.sd for cell in cells])}
    truth["process_sd"], weights = truth["sd"], block_weights(cells)
    return {
        (quantity, model): tuple(
            _likeness([getattr(answer, quantity)[:, k] for answer in draws], known[:, k], weights) for k in range(3)
        )
        for quantity, known in truth.items()
        for model, draws in answers.items()
    }


def agreement_findings(found: Likenesses, pushes: int) -> tuple[Finding, Finding]:
    """Do the maps of mean and of standard deviation agree?"""
    mean, sd, plain = found["mean", "VHGP"], found["sd", "VHGP"], found["sd", "GP"]
    first = Finding(
        "The model's map of the mean agrees well with that of the repetitions",
        _verdict(mean, MEAN_ALIKE),
        f"Correlation of VHGP and repetitions over {pushes} pushes, mean over draws of training windows: "
        f"{_correlations(mean)}; {_errors(mean)}. {_rule(MEAN_ALIKE)}",
        number=f"correlation: {_least(mean)}",
    )
    second = Finding(
        "The model's map of the standard deviation agrees to a certain degree with that of the repetitions",
        _verdict(sd, SD_ALIKE),
        f"Correlation of VHGP and repetitions over {pushes} pushes, mean over draws of training windows: "
        f"{_correlations(sd)}; {_errors(sd)}. The GP has one noise level for all pushes: {_correlations(plain)}. "
        f"{_rule(SD_ALIKE)}",
        number=f"correlation: {_least(sd)}",
    )
    return first, second


def agreement_table(found: Likenesses, caption: str) -> Table:
    """A row per quantity and output: correlation, NMSE and RMS ratio of every model."""
    models = list(dict.fromkeys(model for _, model in found))
    head = ("", *(f"{model}: {what}" for model in models for what in ("correlation", "NMSE", "RMS ratio")))
    rows = [
        (f"{name}, {what}", *(text for model in models for text in _cells(found[quantity, model][k])))
        for quantity, what in QUANTITIES.items()
        for k, name in enumerate(NAMES)
    ]
    return Table(caption, head, tuple(rows))


def agreement_json(found: Likenesses) -> dict[str, dict[str, dict[str, float | None]]]:
    """By quantity, model and output."""
    return {
        f"{quantity}/{model}/{OUTPUTS[k]}": {"correlation": like.correlation.json(), "nmse": like.error.json()}
        for (quantity, model), outputs in found.items()
        for k, like in enumerate(outputs)
    }


def _likeness(models: Sequence[Array], truth: Array, weights: Array) -> Likeness:
    size = float(np.mean([np.sqrt(np.mean(model**2) / np.mean(truth**2)) for model in models]))

    def over_draws(figure: Callable[[Array, Array, Array], Array]) -> Estimate:
        return by_blocks(lambda w: np.mean([figure(model, truth, w) for model in models], axis=0), weights)

    return Likeness(over_draws(correlation), over_draws(relative_error), size)


def _verdict(outputs: tuple[Likeness, ...], asked: float) -> Verdict:
    """Verdict by the ends of the correlations' intervals."""
    if any(not np.isfinite(like.correlation.low) for like in outputs):
        return "not decided"
    if all(like.correlation.low > asked for like in outputs):
        return "holds"
    if all(like.correlation.high < asked for like in outputs):
        return "does not hold"
    return "holds in part" if any(like.correlation.low > asked for like in outputs) else "not decided"


def _rule(asked: float) -> str:
    return (
        f"Rule: holds if the intervals of all three outputs lie above {asked:g}, in part if one does, does not hold if "
        "all lie below."
    )


def _correlations(outputs: tuple[Likeness, ...]) -> str:
    return ", ".join(f"{name} {like.correlation.text()}" for name, like in zip(NAMES, outputs, strict=True))


def _least(outputs: tuple[Likeness, ...]) -> str:
    """The correlation of the output that agrees least."""
    name, like = min(zip(NAMES, outputs, strict=True), key=lambda pair: pair[1].correlation.value)
    return f"{name} {like.correlation.text()}"


def _errors(outputs: tuple[Likeness, ...]) -> str:
    parts = ", ".join(f"{name} {like.error.value:.2f}" for name, like in zip(NAMES, outputs, strict=True))
    return f"NMSE (1: as bad as a constant) {parts}"


def _cells(like: Likeness) -> tuple[str, str, str]:
    return like.correlation.cell(), like.error.cell(), f"{like.size:.2f}"
