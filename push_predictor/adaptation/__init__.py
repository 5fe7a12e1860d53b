# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Live adaptation: after each push the parameters of a model's mechanics follow the rig.

Import `Adaptation` from here; `walk` is its filter, `followed` a recording that a model follows.
"""

from push_predictor.adaptation.adaptation import Adaptation, AdaptedParameter

__all__ = ["Adaptation", "AdaptedParameter"]
