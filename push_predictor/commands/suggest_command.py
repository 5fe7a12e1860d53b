# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor suggest: propose the pushes that a model learns most from."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.common.command import Option, command
from push_predictor.commands.common.options import (
    COVARIATE,
    RIG,
    TOPICS,
    TRAVEL,
    Reading,
    covariates_of,
    model_argument,
    out_option,
    seed_option,
)
from push_predictor.commands.common.output import check_data, write_json, write_text
from push_predictor.commands.common.progress import progress
from push_predictor.errors import RequestError

if TYPE_CHECKING:
    from push_predictor.design.batch import Suggested
    from push_predictor.design.limits import Limits
    from push_predictor.models.push_model import PushModel
    from push_predictor.models.pushes import Pushes

COLUMNS = ("velocity", "contact", "angle", "duration", "variance_left")


def _range_option(flag: str, meaning: str) -> Option:
    return Option(flag, type=float, nargs=2, metavar=("LOW", "HIGH"), help=meaning)


def _model_or_rig(options: argparse.Namespace) -> str:
    return "give either MODEL or --rig FILE.yaml" if (options.model is None) == (options.rig is None) else ""


@command(
    "suggest",
    "Propose the pushes that a model learns most from. They most reduce what its uncertain mean function costs in "
    "log predictive density. Without a model, --rig gives a slider that nobody has pushed yet.",
    "push_predictor suggest square_abs.pushmodel --count 20 --travel 0.03 --out pushes.csv",
    model_argument("?", note="; give it or --rig"),
    Option("--count", type=int, default=20, metavar="N", help="number of pushes (default %(default)s)"),
    _range_option("--speed-range", "pusher speeds in m/s (default: those of the training pushes)"),
    _range_option("--angle-range", "push angles in rad (default: ±1, or those of training)"),
    TRAVEL,
    Option(
        "--exclude",
        type=float,
        nargs=2,
        action="append",
        default=[],
        metavar=("FROM", "TO"),
        help="contacts that the robot cannot push, as fractions of the perimeter; may be repeated",
    ),
    Option(
        "--transfer-speed",
        type=float,
        metavar="V",
        help="speed in m/s of the tip around the slider between pushes: choose by the gain per second",
    ),
    Option(
        "--matter",
        type=Path,
        metavar="DATA",
        help="recording or table of the pushes that matter (default: all possible)",
    ),
    COVARIATE,
    seed_option("the candidates"),
    out_option("the pushes in order, FILE.csv"),
    RIG,
    TOPICS,
    wrong_call=_model_or_rig,
)
def run(options: argparse.Namespace) -> None:
    """Check the call, choose the pushes, write them and print the first."""
    from push_predictor.design.batch import suggest_pushes

    limits, model = _limits(options), _model(options)
    matter = None if options.matter is None else _matter(options, model)
    with progress("suggest") as watch:
        found = suggest_pushes(
            model,
            options.count,
            limits,
            matter=matter,
            covariates=covariates_of(options),
            seed=options.seed,
            watch=watch,
        )
    rows = _rows(found)
    lines = [",".join(COLUMNS), *(",".join(f"{value:.6g}" for value in row) for row in rows)]
    write_text(options.out, "\n".join(lines) + "\n")
    pushes = [dict(zip(COLUMNS, row, strict=True)) for row in rows]
    if not write_json(options, {"model": model.name, "pushes": pushes}):
        print(f"{options.out}: {len(found)} pushes for {model.name}")
        print(f"Expected to leave {100.0 * found.variance_left[-1]:.0f} % of the variance of the mean function.")


def _limits(options: argparse.Namespace) -> Limits:
    """The robot's limits."""
    from push_predictor.design.limits import Limits

    speed, angle = (None if pair is None else (pair[0], pair[1]) for pair in (options.speed_range, options.angle_range))
    excluded = tuple((begin, end) for begin, end in options.exclude)
    return Limits(speed, angle, options.travel, excluded, options.transfer_speed)


def _model(options: argparse.Namespace) -> PushModel:
    """The model of the file, or a prior model of the rig."""
    from push_predictor.models.store.model_file import load_model
    from push_predictor.models.train import train_model
    from push_predictor.recordings.rig import load_rig
    from push_predictor.recordings.table import empty_table

    if options.model is not None:
        return load_model(options.model)
    return train_model(empty_table(), load_rig(options.rig), "prior", name=options.rig.stem)


def _matter(options: argparse.Namespace, model: PushModel) -> Pushes:
    from push_predictor.models.pushes import Pushes
    from push_predictor.recordings.load import load_data

    path, reading = options.matter, Reading(options)
    check_data([path])
    table = load_data([path], model.rig, topics=reading.topics, inspect=reading.checks)
    reading.save_topics([path])
    if not len(table):
        raise RequestError("--matter", str(path), "a recording or table with at least one window")
    velocity, contact, angle = table.inputs.T
    return Pushes(velocity, contact, angle, table.duration)


def _rows(found: Suggested) -> list[list[float]]:
    """The values of COLUMNS of each push."""
    columns = (*found.inputs.T, found.duration, found.variance_left)
    return [list(row) for row in zip(*(column.tolist() for column in columns), strict=True)]
