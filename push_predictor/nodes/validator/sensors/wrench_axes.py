# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0
"""The axes of the live wrench, as the parameter wrench_frame names them, in the report about its topic."""

from __future__ import annotations

from dataclasses import replace

from push_predictor.nodes.validator.sensors.frame_stream import TransformTopics
from push_predictor.online.sensors.topic_report import TopicReport
from push_predictor.online.sensors.transform_buffer import TransformBuffer
from push_predictor.recordings.topics import TIP_AXES, WORLD_AXES, Topics


class WrenchAxes:
    """The axes of the wrench: the world's, the tip's or those of a frame in the given tf topics.

    turned: whether they are not the world's.
    """

    def __init__(self, topics: Topics, transforms: TransformTopics | None) -> None:
        self.turned = topics.wrench_axes != WORLD_AXES
        self._frame = topics.wrench_tf_frame
        self._transforms = transforms if self._frame else None

    @property
    def buffer(self) -> TransformBuffer | None:
        """The transforms that have the frame of the wrench, None for the axes of world or tip."""
        return None if self._transforms is None else self._transforms.buffer

    def amended(self, report: TopicReport) -> TopicReport:
        """The report about the wrench with what is wrong with its frame in tf; as it is without a publisher."""
        if self._transforms is None or report.problem or report.note:
            return report
        if self._transforms.problem:
            problem = f"tf: {self._transforms.problem}"
            return replace(report, problem=problem, refused=self._transforms.refused)
        if problem := self._transforms.buffer.turned_problem:
            accepted = f"{problem}; {TIP_AXES} and {WORLD_AXES} are accepted as well"
            return replace(report, problem=f"wrench_frame {self._frame!r}: {accepted}.")
        return replace(report, note=f"Its axes are turned from {self._frame!r} by tf.")
