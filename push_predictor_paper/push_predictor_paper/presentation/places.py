# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Where the paper makes each claim: the figure, the table or the section of its text."""

from __future__ import annotations

from collections.abc import Mapping

PLACES: Mapping[str, str] = {  # by the key of the section; figure 2 to 4 show rig, inputs and objects
    "data": "section III",
    "kinds_of_push": "figure 1",
    "maps": "figures 5 and 6",
    "noise": "section V, figure 6",
    "learning_curves": "figures 7 and 8",
    "comparison": "figure 9, table I",
    "mean_gain": "section IV, table I",
    "speed_error": "section VI-B",
    "divergence": "table II",
    "modality": "figure 10",
    "quasi_static": "figure 11",
}


def heading(key: str, title: str) -> str:
    """The heading of a section, with its place in the paper."""
    place = PLACES.get(key)
    return f"{title} (beyond the paper)" if place is None else f"{title} (paper: {place})"
