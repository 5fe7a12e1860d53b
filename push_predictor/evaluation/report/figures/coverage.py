# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The figure that opens a validation report: share of outcomes inside the predicted intervals, as a chart."""

from __future__ import annotations

import numpy as np

from push_predictor.evaluation.report.figures.calibration import LEVELS, coverage_curve
from push_predictor.evaluation.validation import Comparison
from push_predictor.reporting.chart import Band, Chart, Line, Mark

SYMBOLS = ("Δx", "Δy", "Δθ")
KINDS = ("fit", "dy", "dtheta")  # colours of dx, dy, dtheta in charts
PERCENT = 100.0


def coverage_chart(comparison: Comparison) -> Chart:
    """Observed against promised share for each output, in percent, with bands from resampling whole pushes."""
    levels = PERCENT * LEVELS
    share, low, high = (PERCENT * part for part in coverage_curve(comparison))
    bands: list[Mark] = [Band(kind, levels, low[:, k], high[:, k]) for k, kind in enumerate(KINDS)]
    lines = [Line(kind, levels, share[:, k], name=SYMBOLS[k]) for k, kind in enumerate(KINDS)]
    ends = np.array([0.0, PERCENT])
    promised = Line("zero", ends, ends, name="as promised")
    return Chart(
        label=f"Share of outcomes inside the predicted intervals of {comparison.model}, by their nominal share",
        x_label="promised share (%)",
        y_label="observed share (%)",
        x=(0.0, PERCENT),
        y=(0.0, PERCENT),
        marks=(*bands, promised, *lines),
    )
