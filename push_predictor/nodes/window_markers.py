"""The markers of a window: what was predicted and what was observed, in the world."""

from __future__ import annotations

import numpy as np
from visualization_msgs.msg import MarkerArray

from msg_adapters.markers import prediction_markers
from push_predictor.geometry.frames import rotate
from push_predictor.models.push_model import Prediction
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows import PushWindow


def window_markers(rig: Rig, window: PushWindow, prediction: Prediction, frame_id: str) -> MarkerArray:
    """Outlines, the observed centre, and the 95 % ellipse around the predicted one (n = 1), in frame_id."""
    heading = np.array(window.push_heading)
    shift = rotate(prediction.mean[0, :2], heading)
    predicted = window.slider_start + np.append(shift, prediction.mean[0, 2])
    turn = rotate(np.eye(2), heading).T
    covariance = turn @ prediction.covariance[0, :2, :2] @ turn.T
    return prediction_markers(
        rig.outline.vertices, window.slider_start, predicted, covariance, window.slider_end, frame_id, window.end
    )
