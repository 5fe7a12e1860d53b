# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rig with what the checks found about its outline and tip corrected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from push_predictor.errors import RigError
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import mirror_image, transformed, transformed_points
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.checks.geometry import MIRRORS
from push_predictor.recordings.checks.outline_findings import LARGEST_SIZE_CHANGE, LARGEST_TIP_CHANGE, LENGTH_ALLOWANCE
from push_predictor.recordings.rig import Rig

CORRECTED = ("outline_mirrored", "outline_turned", "outline_shifted", "outline_size", "tip_radius")
CENTRED_WITHIN = 0.5 * LENGTH_ALLOWANCE
PREVENTS = (*MIRRORS, "outline_unchecked", "outline_misfit", "outline_shape")


def corrected_rig(rig: Rig, findings: Sequence[Finding]) -> Rig:
    """The rig whose outline and tip radius are those that the findings of `check_recording` estimate.

    Support points move with the outline. A clock lag and world frames apart are faults of the recording: they change
    nothing here. Without a finding, the rig is the same. Raises RigError that names the findings with which nothing can
    be corrected, or for a size or a tip's radius that no mistake of measurement explains.
    """
    if prevents := [each for each in findings if each.severity == "refused" or each.name in PREVENTS]:
        names, sentences = ", ".join(each.name for each in prevents), " ".join(each.sentence for each in prevents)
        raise RigError(f"no rig can be estimated ({names}): {sentences}")
    found = {finding.name: finding.values for finding in findings if finding.name in CORRECTED}
    if not found:
        return rig
    outline, points = rig.outline, rig.support_points
    if "outline_mirrored" in found:
        outline, points = mirror_image(outline), None if points is None else points * [1.0, -1.0, 1.0]
    yaw = found["outline_turned"]["yaw"].value if "outline_turned" in found else 0.0
    shift = found.get("outline_shifted")
    moved = (0.0, 0.0) if shift is None else _centring(outline, shift["x"].value, shift["y"].value)
    size = found["outline_size"]["scale"].value if "outline_size" in found else 1.0
    radius = found["tip_radius"]["radius"].value if "tip_radius" in found else rig.pusher_radius
    _check_plausible(rig, size, radius)
    if points is not None:
        places = transformed_points(outline, points[:, :2], yaw, moved, size)
        points = np.column_stack([places, points[:, 2]])
    corrected = transformed(outline, yaw, moved, size)
    return replace(rig, outline=corrected, pusher_radius=radius, support_points=points)


def _check_plausible(rig: Rig, size: float, radius: float) -> None:
    if not abs(size - 1.0) <= LARGEST_SIZE_CHANGE:
        raise RigError(
            f"outline: the contacts fit {size:.3f} times its size, which is not accepted, give sizes within "
            f"{100.0 * LARGEST_SIZE_CHANGE:.0f} %: measure them, and the tip radius, again"
        )
    if not abs(radius - rig.pusher_radius) <= LARGEST_TIP_CHANGE * rig.pusher_radius:
        raise RigError(
            f"pusher_radius: the contacts fit {1e3 * radius:.2f} mm in place of {1e3 * rig.pusher_radius:.2f} mm, "
            f"which is not accepted, give a radius within {100.0 * LARGEST_TIP_CHANGE:.0f} %: measure it again"
        )


def _centring(outline: Outline, x: float, y: float) -> tuple[float, float]:
    """The shift, exactly to the origin if it ends near it: a symmetric outline must not lose its symmetry to noise."""
    there = outline.centroid + [x, y]
    if np.hypot(*there) > CENTRED_WITHIN:
        return x, y
    x, y = (-outline.centroid).tolist()
    return x, y
