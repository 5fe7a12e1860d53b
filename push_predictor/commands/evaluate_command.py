# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor evaluate: score a model on data it was not trained on."""

from __future__ import annotations

import argparse

from push_predictor.commands.common.command import command
from push_predictor.commands.common.options import READING, Reading, data_argument, model_argument
from push_predictor.commands.common.output import warn, write_json
from push_predictor.commands.common.progress import progress


@command(
    "evaluate",
    "Score a model on data it was not trained on. Prints NMSE, NLPD and coverage with 95 % intervals.",
    "push_predictor evaluate square_abs.pushmodel bags/square_abs_test --json -",
    model_argument(),
    data_argument(),
    *READING,
)
def run(options: argparse.Namespace) -> None:
    """Score the model, print the scores, and warn about training pushes and other sliders."""
    from push_predictor.evaluation.metrics import metrics_lines
    from push_predictor.evaluation.offline import rig_difference, training_overlap
    from push_predictor.evaluation.validation import compare, metrics_json
    from push_predictor.models.request import check_pushes
    from push_predictor.models.store.model_file import load_model
    from push_predictor.models.train_mechanics import on_supports
    from push_predictor.recordings.load import different_supports, known_rig, load_data

    model = load_model(options.model)
    reading = Reading(options)
    given, checks = reading.rig, reading.checks
    with progress("evaluate"):
        supports = {} if given else different_supports(options.data)
        table = load_data(options.data, given, numbered=bool(supports), topics=reading.topics, inspect=checks)
        reading.save_topics(options.data)
        known = given or known_rig(options.data[0])
        checks.judged_by(options.data, table, known)
        model = on_supports(model, known, supports)
        table = model.continued(table)
        check_pushes(model, table)
        metrics = metrics_json(compare(model, table))
    for path in options.data:
        rig = given or known_rig(path)
        if rig is not None and (difference := rig_difference(model, rig)):
            warn(f"{path}: {difference}")
    if overlap := training_overlap(model, table):
        warn(overlap)
    if not write_json(options, metrics):
        print("\n".join(metrics_lines(metrics)))
