# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Poses of messages in the frame that was chosen as the world, turned by tf where they name another frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from push_predictor.recordings.bag.cdr import POSE_STAMPED, decode, encode, frame_of
from push_predictor.recordings.fields.pose_rows import composed
from push_predictor.recordings.fields.transforms import TransformError, TransformTree
from push_predictor.types import BoolArray


def poses_in_world(messages: Sequence[bytes], world: str, tree: TransformTree | None) -> tuple[list[bytes], BoolArray]:
    """PoseStamped messages (n,) with their poses in the frame `world`, and which (n,) have a transform to it.

    Messages without a frame count as given in it; unreadable ones stay. Raises TransformError for a frame that tf does
    not connect with it; tree: None without tf.
    """
    columns = decode(messages, POSE_STAMPED)
    named = zip(messages, columns.valid.tolist(), strict=True)
    names = np.array([frame_of(message).strip("/") if valid else "" for message, valid in named])
    found, known = list(messages), np.ones(len(messages), dtype=np.bool_)
    for name in sorted({*names.tolist()} - {"", world}):
        if tree is None:
            raise TransformError(f"the poses are in frame {name!r}, and the bag has no /tf from there to {world!r}")
        rows = np.flatnonzero(names == name)
        frames = tree.poses_at(name, world, columns.stamp[rows])
        known[rows] = ~np.isnan(frames).any(axis=1)
        turned = encode(columns.stamp[rows], composed(frames, columns.values[rows]), POSE_STAMPED, world)
        for row, message in zip(rows.tolist(), turned, strict=True):
            found[row] = message
    return found, known
