# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Header stamps that are moved by a constant offset."""

from __future__ import annotations

import struct

from replay_bags import START, stamped

from push_predictor.replay.restamper import Restamper


def test_big_endian_stamp_is_restamped() -> None:
    restamper = Restamper(lambda: START + 5 * 10**9)
    restamper.settle(START)
    little = restamper.restamped(stamped(START, [0.0] * 7))
    big = restamper.restamped(b"\0\0\0\0" + struct.pack(">iI", START // 10**9, 0) + b"rest")
    assert struct.unpack_from("<iI", little, 4) == (START // 10**9 + 5, 0)
    assert struct.unpack_from(">iI", big, 4) == (START // 10**9 + 5, 0)
