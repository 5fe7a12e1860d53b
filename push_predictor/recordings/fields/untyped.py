# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The type of messages whose schema was not recorded, told from their bytes among the types that a stream can have.

A message fits a type if it is as long as the type, its texts are texts, its stamps are times and its quaternions have
length one. Types of equal layout (WrenchStamped and TwistStamped) cannot be told apart: the stream decides.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from push_predictor.recordings.bag.message_types import STANDARD, type_at
from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.fields.columns import Block, whole_block
from push_predictor.recordings.fields.sources import TF_TYPES, Source, Target, fields_in

LEAST_FITTING = 0.9  # share of the messages: a lost body may have any quaternion
UNIT = 1e-3  # deviation of a quaternion's length from one; 32-bit numbers have 1e-7
LARGEST, SMALLEST = 1e9, 1e-30  # of a measured number but zero, in SI units; other bytes read as numbers are beyond
_NANOSECONDS = 1e9


def candidates(source: Source, target: Target) -> list[str]:
    """The types that a source's messages can have, if their schema is missing."""
    if source.frame:
        return [TF_TYPES[0]]
    if not source.field:
        return list(target.known)
    names = [f"{package}/msg/{name}" for package, name in (each.split("/") for each in STANDARD)]
    fields = fields_in(source.field)
    return [name for name in names if target.fits([type_at(STANDARD, name, each) for each in fields])]


def told_type(messages: Sequence[bytes], kinds: Sequence[str]) -> str:
    """The first of the types that nearly all messages fit, '' if none does."""
    needed = LEAST_FITTING * len(messages)
    return next((kind for kind in kinds if 0 < needed <= sum(_fits(each, kind) for each in messages)), "")


def _fits(message: bytes, kind: str) -> bool:
    block = whole_block(Messages.of("", kind, [0], [message]), STANDARD)
    return block is not None and _texts_fit(block) and _numbers_fit(block)


def _texts_fit(block: Block) -> bool:
    texts = [block.raw_text(path) for path in block.layout.texts]
    return all(text.endswith(b"\0") and text[:-1].decode(errors="replace").isprintable() for text in texts)


def _numbers_fit(block: Block) -> bool:
    numbers = {path: float(block.number(path)[0]) for path in block.layout.numbers}
    size = np.abs([value for path, value in numbers.items() if not path.endswith("sec")])
    measured = size[np.isfinite(size) & (size > 0.0)]
    if not np.all((measured < LARGEST) & (measured > SMALLEST)):
        return False
    if any(value >= _NANOSECONDS for path, value in numbers.items() if path.endswith(".nanosec")):
        return False
    return all(_is_unit([numbers[f"{path[:-1]}{axis}"] for axis in "xyzw"]) for path in numbers if path.endswith(".w"))


def _is_unit(quaternion: Sequence[float]) -> bool:
    """Whether a quaternion is one, or that of a lost body: zeros or NaN."""
    length = float(np.linalg.norm(quaternion))
    return not length > 0.0 or abs(length - 1.0) < UNIT
