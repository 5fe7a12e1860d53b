# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
