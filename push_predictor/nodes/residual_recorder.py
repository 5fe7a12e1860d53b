"""The recording of residuals that a validator leaves: a bag of push_residual."""

from __future__ import annotations

from pathlib import Path

from push_predictor_interfaces.msg import PushResidual
from rclpy.serialization import serialize_message

from msg_adapters.residual_schema import RESIDUAL_DEFINITION, RESIDUAL_TYPE
from push_predictor.recordings.bag_writer import BagWriter

TOPIC = "push_residual"
BAG = "residuals"


class ResidualRecorder:
    """Gathers residuals; write() leaves them in FOLDER/residuals, a rosbag2 folder, and begins anew."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._messages: list[tuple[int, bytes]] = []

    def add(self, message: PushResidual, stamp: int) -> None:
        """Take a message; stamp: ns, the end of its window."""
        self._messages.append((stamp, serialize_message(message)))

    def write(self) -> None:
        """Write the bag. Raises RecordingError if it cannot be written."""
        messages, self._messages = sorted(self._messages, key=lambda item: item[0]), []
        with BagWriter(self.folder / BAG) as bag:
            bag.add_topic(TOPIC, RESIDUAL_TYPE, RESIDUAL_DEFINITION)
            for stamp, data in messages:
                bag.write(TOPIC, stamp, data)
