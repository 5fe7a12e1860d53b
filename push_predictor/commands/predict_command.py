# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor predict: predict the outcome of one push."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from push_predictor.commands.common.command import Option, command
from push_predictor.commands.common.options import COVARIATE, covariates_of, model_argument
from push_predictor.commands.common.output import write_json
from push_predictor.errors import RequestError

if TYPE_CHECKING:
    from push_predictor.models.prediction import Prediction
    from push_predictor.models.predictors.tails import IntervalKind
    from push_predictor.models.push_model import PushModel
    from push_predictor.types import Array

INSIDE = "The push lies within the training data."
INSIDE_PRIORS = "The push lies within the speeds and angles for which the priors are meant."
OUTSIDE_PRIORS = "The push lies outside the speeds and angles for which the priors are meant."
OUTSIDE = "The push lies outside the training data: the prediction is an extrapolation."
LEVEL = 0.95
INTERVAL_KINDS = ("student", "conformal")  # those of models/predictors/tails.py, which imports scipy


@command(
    "predict",
    "Predict the outcome of one push. Prints mean, standard deviation and 95 % interval of dx, dy and dtheta; "
    "--json gives the covariance in m and rad.",
    "push_predictor predict square_abs.pushmodel --velocity 0.02 --contact 0.1 --angle 0.3",
    model_argument(),
    Option("--velocity", required=True, type=float, metavar="V", help="speed of the pusher in m/s"),
    Option(
        "--contact",
        required=True,
        type=float,
        metavar="C",
        help="contact point, as a fraction of the perimeter, 0 to 1",
    ),
    Option("--angle", required=True, type=float, metavar="A", help="push angle in rad, from the inward normal"),
    Option("--duration", type=float, default=0.2, metavar="T", help="duration in s (default %(default)s)"),
    COVARIATE,
    Option(
        "--interval",
        choices=INTERVAL_KINDS,
        default="student",
        help="student: from the predicted distribution; conformal: from the errors on held-out training pushes, "
        "whatever their distribution (default %(default)s)",
    ),
)
def run(options: argparse.Namespace) -> None:
    """Check the push, predict its outcome, print it."""
    import numpy as np

    from push_predictor.models.request import PushRequest, check_request
    from push_predictor.models.store.model_file import load_model

    model = load_model(options.model)
    push = PushRequest(options.velocity, options.contact, options.angle, options.duration, covariates_of(options))
    check_request(model, push)
    prediction = model.predict_rows(*push.arrays)
    mean, covariance = prediction.mean[0], prediction.covariance[0]
    low, high = (end[0] for end in _interval(model, prediction, options.interval))
    result = {
        "model": model.name,
        "mean": mean.tolist(),
        "covariance": covariance.ravel().tolist(),
        "process_covariance": prediction.process_covariance[0].ravel().tolist(),
        "in_domain": bool(prediction.in_domain[0]),
        "interval": {"level": LEVEL, "kind": options.interval, "low": low.tolist(), "high": high.tolist()},
    }
    if write_json(options, result):
        return
    sd, noise = np.sqrt(np.diag(covariance)), np.sqrt(np.diag(prediction.process_covariance[0]))
    for k, (name, unit, scale) in enumerate((("dx", "mm", 1e3), ("dy", "mm", 1e3), ("dtheta", "deg", np.degrees(1.0)))):
        print(
            f"{name:7s}{mean[k] * scale:9.3f} {unit:3s}  sd {sd[k] * scale:.3f} {unit}  "
            f"(process noise {noise[k] * scale:.3f} {unit})  "
            f"95 % interval {low[k] * scale:.3f} to {high[k] * scale:.3f} {unit}"
        )
    inside, outside = (INSIDE_PRIORS, OUTSIDE_PRIORS) if model.kind == "prior" else (INSIDE, OUTSIDE)
    print(inside if result["in_domain"] else outside)


def _interval(model: PushModel, prediction: Prediction, kind: IntervalKind) -> tuple[Array, Array]:
    """The ends of the intervals; an error names the option."""
    try:
        return prediction.interval(LEVEL, kind)
    except RequestError as error:
        pushes = 0 if prediction.tails is None else prediction.tails.pushes
        accepted = f"student: conformal 95 % intervals need 19 held-out training pushes, {model.name} has {pushes}"
        raise RequestError("--interval", kind, accepted) from error
