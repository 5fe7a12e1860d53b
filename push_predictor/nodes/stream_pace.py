"""Are the streams of a score together? A fast replay leaves one behind whose samples the middleware still holds."""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic

from push_predictor.nodes.sensor_inlet import Samples
from push_predictor.recordings.scalars import APART
from push_predictor.recordings.window_finder import HOLD

SILENCE = 5.0  # s of waiting for a stream that lags behind
SENSOR_LAG, SCALAR_LAG = 0.5e9 * HOLD, 0.5 * APART  # ns; the finder goes on without a stream that lags by twice as much


class StreamPace:
    """Keeps for each stream how far it has come, and since when it is behind the foremost sensor.

    scalars: topics that are waited for though they have not sent anything.
    """

    def __init__(self, scalars: Sequence[str] = ()) -> None:
        self._sensors: dict[str, int] = {}  # newest stamp (ns)
        self._scalars: dict[str, int | None] = dict.fromkeys(scalars)
        self._together = dict.fromkeys(scalars, monotonic())

    def note(self, samples: Samples) -> None:
        """Take note of a portion of the streams."""
        stamps = {"slider": samples.slider.stamp, "pusher": samples.pusher.stamp, "wrench": samples.wrench.stamp}
        self._sensors |= {name: int(stamp[-1]) for name, stamp in stamps.items() if len(stamp)}
        self._scalars |= {name: int(stream.stamp[-1]) for name, stream in samples.scalars.items() if len(stream)}

    def in_step(self) -> bool:
        """Is no stream behind, but such as have been for SILENCE? To be asked often, for it takes the time."""
        foremost, now = max(self._sensors.values(), default=0), monotonic()
        lags = {name: foremost - stamp < SENSOR_LAG for name, stamp in self._sensors.items()}
        lags |= {name: stamp is not None and foremost - stamp < SCALAR_LAG for name, stamp in self._scalars.items()}
        self._together |= {name: now for name, near in lags.items() if near}
        return all(near or now - self._together.setdefault(name, now) > SILENCE for name, near in lags.items())
