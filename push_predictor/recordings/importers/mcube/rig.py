# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rig of the MCube lab's preliminary pushes of August 2015: two metal blocks and their frames.

Values that the files lack were fitted to the contact: while the pusher touches a side, the distance of its centre from
the block's centre line is half side + pusher radius. test_measured_importers repeats the fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from push_predictor.errors import ImportSourceError
from push_predictor.geometry.shapes import square
from push_predictor.recordings.rig import Rig

PUSHER_RADIUS = 0.004745  # m
THICKNESS = 0.0132  # m; that of the MIT set's steel square, 0.837 kg on 0.09 m x 0.09 m
TIP_LATE = 15_000_000  # ns; see CLOCK
CLOCK = (
    "clock: tip stamps are 15 ms late relative to the tracker's and were corrected. A delay test without repeated rows "
    "gives 15.0 ms (rms 0.17 mm). With the repeated rows, which are 12 ms old, it gives 20 to 21 ms. Tracker and force "
    "share a clock"
)
FORCE = (
    "force: the sensor points down, so world (fx, fy) = sensor (fy, fx), from tip_pose's orientation in the bag. Axes "
    "fitted to the contact normals of each block agree within 3 degrees. It is the force of the slider on the pusher, "
    "tared by its mean before the tip first moves"
)
HEIGHT = "height: tip and slider are at 0 where the files contain no height of the tip"


@dataclass(frozen=True)
class Block:
    """One of the blocks.

    half_side m; density kg/m^3; base: Vicon's origin in the robot's base (x, y) m; centre: the block's centre in the
    tracker's body frame (x, y) m; days: Unix seconds of the sessions.
    """

    name: str
    half_side: float
    density: float
    base: tuple[float, float]
    centre: tuple[float, float]
    days: tuple[float, float]

    @property
    def rig(self) -> Rig:
        """The square block; its mass follows from density, measured side and the assumed thickness."""
        mass = self.density * 4.0 * self.half_side**2 * THICKNESS
        return Rig(f"{self.name}_block", square(2.0 * self.half_side), PUSHER_RADIUS, "unknown", round(mass, 3))

    @property
    def assumed_rig(self) -> str:
        """The assumptions about the block."""
        rig = self.rig
        return (
            f"{self.name}: square of side {2e3 * self.half_side:.1f} mm, from the distance of tip and centre in "
            f"contact. Mass {rig.object_mass} kg, not measured: from density {self.density:.0f} kg/m3 and thickness "
            f"{THICKNESS * 1e3:.1f} mm, that of the MIT set's square; surface unknown"
        )

    @property
    def assumed_frames(self) -> str:
        """The assumptions about the frames."""
        (bx, by), (cx, cy) = self.base, self.centre
        source = (
            "from the recorded transforms"
            if self.base == RECORDED_BASE
            else "fitted to the contacts; the recorded one is 10 mm off"
        )
        return (
            f"{self.name}: the world frame is Vicon's. Its origin in the frame of the robot's base is "
            f"({bx:.4f}, {by:.4f}) m ({source}). The block's centre in the tracked body is "
            f"({1e3 * cx:.2f}, {1e3 * cy:.2f}) mm"
        )


RECORDED_BASE = (0.3958, 0.0019)  # from /tf of the bag
STEEL = Block("steel", 0.0489, 7850.0, RECORDED_BASE, (0.0, 0.0), (1439424000.0, 1439596800.0))
ALUMINIUM = Block("aluminium", 0.0496, 2700.0, (0.3906, -0.0064), (0.00085, 0.0016), (1438560000.0, 1438732800.0))
FOLDERS = {"St": STEEL, "Al": ALUMINIUM}


def block_of(path: Path, stamp: int) -> Block:
    """The block of a file by its folder (St_..., Al_...), else by the day (ns). Raises ImportSourceError."""
    for prefix, block in FOLDERS.items():
        if path.resolve().parent.name.startswith(f"{prefix}_"):
            return block
    for block in FOLDERS.values():
        if block.days[0] <= stamp / 1e9 < block.days[1]:
            return block
    raise ImportSourceError(
        f"{path}: neither folder nor first stamp {stamp} ns identifies the block, name the folder St_... (steel) or "
        "Al_... (aluminium)"
    )
