# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A rig in lines of text, so that a wrong size is seen at once."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.rig import Rig

SYMMETRIES = {0: "every turn", 1: "none"}


def rig_lines(rig: Rig) -> list[str]:
    """Sizes in mm, mass, symmetry and first vertex."""
    outline = rig.outline
    low, high = outline.vertices.min(axis=0), outline.vertices.max(axis=0)
    x, y = (1e3 * (high - low)).tolist()
    corners = "a smooth curve" if outline.semi_axes is not None else f"{len(outline.vertices)} corners"
    order = outline.rotational_symmetry
    turns = SYMMETRIES.get(order, f"turns by {360.0 / order:g} degrees" if order else "")
    first = np.round(1e3 * outline.vertices[0], 2) + 0.0
    return [
        f"  extent         {x:.2f} mm along x, {y:.2f} mm along y, {corners}",
        f"  perimeter      {1e3 * outline.perimeter:.1f} mm, area {1e4 * outline.area:.2f} cm^2",
        f"  symmetry       {turns}",
        f"  contact 0      at ({first[0]:g}, {first[1]:g}) mm, contacts count counter-clockwise",
        f"  tip radius     {1e3 * rig.pusher_radius:.4g} mm",
        f"  mass           {'not given' if rig.object_mass is None else f'{rig.object_mass:g} kg'}",
    ]
