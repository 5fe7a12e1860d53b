"""ROS messages <-> the library's own types. Nothing else converts, and nothing here holds state or a node.

Reading takes rclpy messages and any object with the same fields (rosbags and mcap decoders give such);
writing makes rclpy messages.
"""

from __future__ import annotations

from push_predictor.errors import PushPredictorError


class MessageError(PushPredictorError):
    """A message holds a value that cannot be taken; the text names the field, the value and what is accepted."""

    def __init__(self, field: str, value: object, accepted: str) -> None:
        super().__init__(f"{field}: {value!r} is not accepted, give {accepted}")
        self.field = field
