# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of rosbag2's player that push_replay does not have: which values are harmless, what to use instead.

Names: those of the composable player `rosbag2_transport::Player` of Iron, Jazzy and later.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import get_close_matches
from typing import Any

from push_predictor.errors import RequestError

GROUPS = ("play.", "storage.")
_UNSET: tuple[Any, ...] = (None, "", [], [""])
_TOPICS_ONLY = "push_replay plays topics only. `ros2 bag play` also plays services and actions"
_NO_NAMES = f"['']: {_TOPICS_ONLY}"
_NO_REQUESTS = f"false: {_TOPICS_ONLY}"
_NO_BAR = "0: push_replay has no progress bar. Its progress is on /diagnostics"
# {name: (values that change nothing, what is accepted and what to use)}
_REFUSED: dict[str, tuple[tuple[Any, ...], str]] = {
    "play.node_prefix": (_UNSET, "'', and the node's name by -r __node:=NAME"),
    "play.topic_remapping_options": (_UNSET, "[''], and the names of topics by -r FROM:=TO"),
    "play.topics_regex_to_filter": (_UNSET, "it as play.regex_to_filter, its name since Jazzy"),
    "play.topics_regex_to_exclude": (_UNSET, "it as play.exclude_regex_to_filter, its name since Jazzy"),
    "play.services_to_filter": (_UNSET, _NO_NAMES),
    "play.actions_to_filter": (_UNSET, _NO_NAMES),
    "play.publish_service_request": ((False,), _NO_REQUESTS),
    "play.publish_service_requests": ((False,), _NO_REQUESTS),
    "play.send_actions_as_client": ((False,), _NO_REQUESTS),
    "play.message_order": (("RECEIVED_TIMESTAMP",), "'RECEIVED_TIMESTAMP': messages are played at their log times"),
    "play.progress_bar_update_rate": ((-1, 0, 3), _NO_BAR),
    "storage.storage_config_uri": (_UNSET, "'': push_replay reads recordings without rosbag2's storage plugins"),
    "storage.start_time_ns": ((-1,), "-1, and play.start_offset"),
    "storage.end_time_ns": ((-1,), "-1, and play.playback_until_timestamp"),
}
# Whatever their value, a replay without services, keyboard, loaned messages or files to write is the same.
_WITHOUT_EFFECT = frozenset(
    {
        "play.disable_keyboard_controls",
        "play.disable_loan_message",
        "play.exclude_actions_to_filter",
        "play.exclude_services_to_filter",
        "play.progress_bar_separation_lines",
        "play.service_requests_source",
        "storage.custom_data",
        "storage.max_bag_files",
        "storage.max_bagfile_duration",
        "storage.max_bagfile_size",
        "storage.max_cache_duration",
        "storage.max_cache_size",
        "storage.snapshot_mode",
        "storage.storage_preset_profile",
    }
)


def check_given(given: Mapping[str, Any], known: Collection[str]) -> list[str]:
    """Check the `play.*` and `storage.*` among the parameters given at start; returns those without effect here.

    known: the names that push_replay has. Raises RequestError for an unknown name, and for a value that would change
    the replay of rosbag2 but not this one.
    """
    without_effect = []
    for name, value in given.items():
        if not name.startswith(GROUPS) or name in known:
            continue
        if name in _REFUSED:
            harmless, accepted = _REFUSED[name]
            if value not in harmless:
                raise RequestError(name, value, accepted)
        elif name in _WITHOUT_EFFECT:
            without_effect.append(name)
        else:
            raise RequestError(name, value, _known(name, known))
    return sorted(without_effect)


def _known(name: str, known: Collection[str]) -> str:
    """In words, what to use instead of an unknown name."""
    similar = get_close_matches(name, sorted(known), n=3)
    there_are = " or ".join(similar) or "a name listed in docs/reference/push_replay.md"
    return f"{there_are}: push_replay has no parameter {name}"
