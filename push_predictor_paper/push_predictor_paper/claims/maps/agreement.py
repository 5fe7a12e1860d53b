"""How alike the maps of the models and of the repetitions are."""

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
    """Of one map of a model with that of the repetitions: correlation, squared error over the map's variance, and the
    model's root mean square over the repetitions'."""

    correlation: Estimate
    error: Estimate
    size: float


Likenesses = Mapping[tuple[str, str], tuple[Likeness, ...]]  # (quantity, model) -> by output
QUANTITIES = {"mean": "mean", "sd": "sd of an outcome", "process_sd": "sd of the process noise alone"}


def likenesses(cells: list[Repetitions], answers: Mapping[str, Sequence[Answer]]) -> Likenesses:
    """For mean, sd of an outcome, sd of the noise alone, of each model, asked at these pushes; answers: one for each
    draw of its training windows, over which figures are averaged."""
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
    """Is the mean map alike, is the map of the deviation."""
    mean, sd, plain = found["mean", "VHGP"], found["sd", "VHGP"], found["sd", "GP"]
    first = Finding(
        "The model's map of the mean is much like that of the repetitions",
        _verdict(mean, MEAN_ALIKE),
        f"Correlation over {pushes} pushes, VHGP with repetitions, mean over draws of training windows: {_told(mean)}; "
        f"{_errors(mean)}. {_rule(MEAN_ALIKE)}",
    )
    second = Finding(
        "The model's map of the standard deviation is to a certain degree that of the repetitions",
        _verdict(sd, SD_ALIKE),
        f"Correlation over {pushes} pushes, VHGP with repetitions, mean over draws of training windows: {_told(sd)}; "
        f"{_errors(sd)}. The GP, whose noise is "
        f"one for all pushes: {_told(plain)}. {_rule(SD_ALIKE)}",
    )
    return first, second


def agreement_table(found: Likenesses, caption: str) -> Table:
    """A row per quantity and output, correlation and NMSE of every model."""
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
    """Of the lower and the upper ends of the correlations."""
    if any(not np.isfinite(like.correlation.low) for like in outputs):
        return "not decided"
    if all(like.correlation.low > asked for like in outputs):
        return "holds"
    if all(like.correlation.high < asked for like in outputs):
        return "does not hold"
    return "holds in part" if any(like.correlation.low > asked for like in outputs) else "not decided"


def _rule(asked: float) -> str:
    return (
        f"Rule: holds if the intervals of all three lie above {asked:g}, does not hold if all lie below, in part if "
        "one of them lies above."
    )


def _told(outputs: tuple[Likeness, ...]) -> str:
    return ", ".join(f"{name} {like.correlation.text()}" for name, like in zip(NAMES, outputs, strict=True))


def _errors(outputs: tuple[Likeness, ...]) -> str:
    parts = ", ".join(f"{name} {like.error.value:.2f}" for name, like in zip(NAMES, outputs, strict=True))
    return f"NMSE (1: as bad as one number for all pushes) {parts}"


def _cells(like: Likeness) -> tuple[str, str, str]:
    return like.correlation.cell(), like.error.cell(), f"{like.size:.2f}"
