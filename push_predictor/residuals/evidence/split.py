# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The split into analysis pushes and held-out pushes, which are opened once, at the end."""

from __future__ import annotations

import hashlib

import numpy as np

from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.standardised import push_order
from push_predictor.types import BoolArray

FEWEST_PUSHES = 12  # of a table, or of a part of one, that anything is concluded from
BLOCK = 10  # pushes
FEWEST_BLOCKS = 9  # guards against few pushes that all lie in analysis: their blocks are smaller
EVERY = 3  # one block in so many is held out
RULE = f"every third block of up to {BLOCK} successive pushes is held out"


def held_out_rows(table: PushTable) -> BoolArray:
    """Mask (n,) of the rows of held-out pushes: interleaved blocks, so that both parts span the whole session."""
    order = push_order(table)
    count = int(order.max()) + 1 if len(order) else 0
    block = max(1, min(BLOCK, count // FEWEST_BLOCKS))
    return np.asarray((order // block) % EVERY == EVERY - 1)


def digest_of(table: PushTable) -> str:
    """SHA-256 of a table's inputs, durations and outcomes, in hexadecimal."""
    digest = hashlib.sha256()
    for column in (table.inputs, table.duration, table.outcomes):
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()
