# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The frames that requests may use: the world frame and, where tf2_ros is installed, frames that tf connects to it."""

from __future__ import annotations

import importlib
from typing import Any

from rclpy.node import Node
from rclpy.time import Time

from msg_adapters.slider_poses import pose_of_transform
from push_predictor.errors import FrameError
from push_predictor.geometry.spatial import SAME_FRAME, SpatialPose


class RequestFrames:
    """Looks frames up in tf; a lookup never waits. world: name of the frame in which sliders lie flat."""

    def __init__(self, node: Node, world: str) -> None:
        self.world = world
        self._tf = _imported_tf()
        if self._tf is not None:
            self._buffer = self._tf.Buffer()
            self._listener = self._tf.TransformListener(self._buffer, node)

    def pose_in_world(self, header: Any) -> SpatialPose:
        """The pose in the world of a header's frame at the header's stamp; a zero stamp means the latest.

        Raises FrameError for an empty frame and for one that tf does not connect to the world.
        """
        if header.frame_id == self.world:
            return SAME_FRAME
        if not header.frame_id:
            raise FrameError("header.frame_id", "", f"the frame of the poses, such as {self.world!r}")
        if header.frame_id.lstrip("/") == self.world:
            raise FrameError("header.frame_id", header.frame_id, f"{self.world!r}, without a slash")
        if self._tf is None:
            raise FrameError("header.frame_id", header.frame_id, f"{self.world!r}; tf2_ros is not installed")
        return self._looked_up(self._tf, header)

    def _looked_up(self, tf: Any, header: Any) -> SpatialPose:
        try:
            found = self._buffer.lookup_transform(self.world, header.frame_id, Time.from_msg(header.stamp))
        except tf.TransformException as error:
            accepted = f"{self.world!r}, or a frame that tf connects to it: {error}"
            raise FrameError("header.frame_id", header.frame_id, accepted) from None
        return pose_of_transform(found.transform)


def _imported_tf() -> Any:
    try:
        return importlib.import_module("tf2_ros")
    except ImportError:
        return None
