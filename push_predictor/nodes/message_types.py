# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The Python classes of message types."""

from __future__ import annotations

import importlib
import re

from push_predictor.errors import PushPredictorError

_TYPE = re.compile(r"([a-z][a-z0-9_]*)/msg/([A-Za-z][A-Za-z0-9]*)")


def message_class(kind: str) -> type:
    """The Python class of a message type such as std_msgs/msg/String. Raises PushPredictorError if there is none."""
    if not (match := _TYPE.fullmatch(kind)):
        raise PushPredictorError(f"type {kind!r} is not of the form package/msg/Name")
    try:
        found: type = getattr(importlib.import_module(f"{match[1]}.msg"), match[2])
    except (ImportError, AttributeError) as error:
        raise PushPredictorError(f"type {kind} is not installed ({error})") from None
    return found
