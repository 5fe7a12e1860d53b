# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pictures in a quarter of the time: few pixels, no ticks, axes and labels that are not fitted to each other."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

from push_predictor.reporting import canvas

TICKS = ("xtick.bottom", "xtick.labelbottom", "ytick.left", "ytick.labelleft")


@contextmanager
def coarse_pictures() -> Iterator[None]:
    """Draw so inside the block."""
    with patch.multiple(canvas, DPI=40, LAYOUTS=0), patch.dict(canvas.STYLE, dict.fromkeys(TICKS, False)):
        yield
