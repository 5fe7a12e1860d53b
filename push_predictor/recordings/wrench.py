# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The wrench of a recording along the world's axes, about the tip and without bias, as the topics state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from push_predictor.errors import RecordingError
from push_predictor.recordings.fields.pose_rows import normalised, poses_at
from push_predictor.recordings.fields.transforms import WORLD, TransformError, TransformTree
from push_predictor.recordings.fields.wrench_axes import at_tip
from push_predictor.recordings.fields.wrench_bias import BiasError, WrenchBias, estimate_bias, with_planar_numbers
from push_predictor.recordings.samples import UsableSamples, has_orientation, upright, wrench_stream
from push_predictor.recordings.streams import WrenchStream
from push_predictor.recordings.topics import FREE_MOTION, NO_BIAS, TIP_AXES, WORLD_AXES, Topics
from push_predictor.types import Array, BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class WrenchContext:
    """What a wrench is read with.

    path: of the bag; has_tf: whether it has transforms; slider, tip: poses (n, 7); tree: of tf, None if absent or not
    needed; world: the frame of the poses, '' unless it is known from tf or given. free: whether the tip touches nothing
    at stamps (n,) in ns, None without a rig.
    """

    path: Path
    has_tf: bool
    topics: Topics
    slider: UsableSamples
    tip: UsableSamples
    tree: TransformTree | None
    world: str
    free: Callable[[IntArray], BoolArray] | None

    @property
    def pose_frames(self) -> frozenset[str]:
        """The names of the frames in which the poses are given."""
        named = {frame.strip("/") for frame in self.slider.frames | self.tip.frames}
        return frozenset(named | ({self.world} if self.world else set()))

    def error(self, key: str, value: str, problem: str) -> RecordingError:
        """An error that names the bag, the key, the option and the value."""
        return RecordingError(f"{self.path}: {key} {value!r} (option --{key.replace('_', '-')}): {problem}")

    def frame_error(self, problem: str) -> RecordingError:
        """An error about the frame of the wrench."""
        return self.error("wrench_frame", self.topics.wrench_frame, problem)


def read_wrench(
    wrench: UsableSamples, context: WrenchContext, notes: list[str]
) -> tuple[WrenchStream, WrenchBias | None]:
    """The stream of a wrench (n, 6), turned if its axes are not the world's, and the bias that was subtracted.

    Notes state what was assumed. Raises RecordingError that names the key, the option and what is accepted.
    """
    if context.topics.wrench_axes == WORLD_AXES:
        if unexpected := _unexpected_frame(wrench, context):
            notes.append(unexpected)
        values, bias = _without_bias(wrench, None, context, notes)
        return wrench_stream(wrench.stamp, values), bias
    sensor, tip = _poses(wrench.stamp, context, notes)
    known = ~np.isnan(sensor).any(axis=1) & ~np.isnan(tip).any(axis=1)
    if without := int(np.sum(~known)):
        notes.append(f"{wrench.topic}: {without} samples outside the time, or in a dropout, of their frame; discarded")
    kept = wrench._replace(stamp=wrench.stamp[known], values=wrench.values[known])
    values, bias = _without_bias(kept, sensor[known], context, notes)
    return wrench_stream(kept.stamp, at_tip(values, sensor[known], tip[known])), bias


def _without_bias(
    wrench: UsableSamples, poses: Array | None, context: WrenchContext, notes: list[str]
) -> tuple[Array, WrenchBias | None]:
    """Wrenches (n, 6), without bias if the topics ask for it; poses (n, 7) of the axes, None for the world's."""
    if context.topics.wrench_bias != FREE_MOTION:
        return wrench.values, None
    if context.free is None:
        notes.append(f"{wrench.topic}: the bias is not subtracted: free motion is found with a rig, and there is none")
        return wrench.values, None
    values = wrench.values if poses is not None else with_planar_numbers(wrench.values)
    try:
        bias = estimate_bias(wrench.stamp, values, context.free(wrench.stamp), poses)
    except BiasError as error:
        raise context.error("wrench_bias", FREE_MOTION, f"{error}, or give {NO_BIAS}") from None
    notes.append(f"{wrench.topic}: subtracted {bias.to_text()}")
    return bias.subtracted_from(values, poses), bias


def _unexpected_frame(wrench: UsableSamples, context: WrenchContext) -> str:
    """A note on a wrench in a frame that is not that of the poses, '' if the axes were given or are the poses'."""
    world = context.world or WORLD
    others = sorted(frame.strip("/") for frame in wrench.frames)
    others = [frame for frame in others if frame not in {world, *context.pose_frames}]
    if not others or context.topics.wrench_frame:
        return ""
    by_tf = f"--wrench-frame {others[-1] or 'FRAME'} turns the axes by tf" if context.has_tf else "the bag has no /tf"
    return (
        f"{wrench.topic}: frame_id {', '.join(map(repr, others))} is treated as {world!r}; {by_tf}, "
        f"--wrench-frame {TIP_AXES} turns them with the tip, --wrench-frame {WORLD_AXES} confirms them"
    )


def _poses(stamp: IntArray, context: WrenchContext, notes: list[str]) -> tuple[Array, Array]:
    """Poses (n, 7) of the sensor's axes and of the tip at stamps; NaN where unknown."""
    if context.topics.wrench_axes == TIP_AXES:
        tip = _oriented_tip(stamp, context)
        notes.append(f"the axes of the wrench are turned with the tip ({context.tip.topic})")
        return tip, tip
    frame = context.topics.wrench_tf_frame
    if context.tree is None:
        raise context.frame_error(f"the bag has no /tf; give {TIP_AXES} or {WORLD_AXES}, or record /tf and /tf_static")
    try:
        world = _world(context, context.tree, frame)
        sensor = context.tree.poses_at(frame, world, stamp)
    except TransformError as error:
        raise context.frame_error(f"{error}; {TIP_AXES} and {WORLD_AXES} are accepted as well") from None
    notes.append(f"the axes of the wrench are turned from {frame!r} to {world!r} by tf, its torque is moved to the tip")
    return sensor, poses_at(stamp, context.tip.stamp, upright(context.tip.values))


def _oriented_tip(stamp: IntArray, context: WrenchContext) -> Array:
    oriented = has_orientation(context.tip.values)
    if not oriented.any():
        raise context.frame_error(
            f"the poses of {context.tip.topic} have no orientation; give {WORLD_AXES} or a frame in /tf"
        )
    return poses_at(stamp, context.tip.stamp[oriented], normalised(context.tip.values[oriented]))


def _world(context: WrenchContext, tree: TransformTree, frame: str) -> str:
    """The frame in which the poses are given, as far as tf has it; else the root above the sensor's frame."""
    if context.world:
        return context.world
    return next((name for name in sorted(context.pose_frames) if name in tree.frames), "") or tree.root(frame)
