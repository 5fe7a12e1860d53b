# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How much larger the noise of the outcomes is at the high end of a covariate than at its low end."""

from __future__ import annotations

import numpy as np

from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.recordings.table import OUTPUTS
from push_predictor.residuals.outcome import FoundEffect, Gain, Trace

FIFTH = 0.2  # of the windows at either end of the covariate


def noise_ratios(trace: Trace, effect: FoundEffect) -> dict[str, Gain]:
    """By output: root mean square residual in the highest fifth of the covariate over that in the lowest.

    With 95 % intervals from a bootstrap of pushes; empty if the covariate is not recorded.
    """
    values = trace.analysis.covariates.get(effect.covariate)
    if values is None or len(trace.unexplained) != len(values):
        return {}
    low, high = (values <= np.quantile(values, FIFTH)), (values >= np.quantile(values, 1.0 - FIFTH))
    weights = np.vstack([np.ones(len(values)), push_bootstrap(trace.analysis.push_id)])
    ratios = {}
    for name in effect.outputs:
        square = trace.unexplained[:, OUTPUTS.index(name)] ** 2
        spread = [np.sqrt(weights @ (square * rows) / np.maximum(weights @ rows, 1.0)) for rows in (low, high)]
        ratio = spread[1] / np.maximum(spread[0], np.finfo(float).tiny)
        ends = np.quantile(ratio[1:], [0.025, 0.975])
        ratios[name] = Gain(float(ratio[0]), *map(float, ends))
    return ratios
