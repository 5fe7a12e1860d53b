# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0
"""Bias and weight of a force sensor, from the free motion so far: of a recording that is read, from all of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from push_predictor.recordings.fields.wrench_bias import BiasError, WrenchBias, estimate_bias, with_planar_numbers
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, joined, set_back, taken
from push_predictor.recordings.windows.clock_session import free_motion
from push_predictor.types import Array, IntArray

FIRST = 50  # wrenches before the first attempt
LATER, REFINED = 1.1, 2.0  # factors in their number to the next attempt: without an estimate, with one
MOST = 50_000  # wrenches that are kept; an estimate from as many is final


@dataclass(frozen=True, eq=False)
class Wrenches:
    """Stamps (n,) ns and wrenches (n, 6) along the axes of a sensor, with its poses and the tip's (n, 7) in the world.

    sensor and tip are None where the axes are the world's.
    """

    stamp: IntArray
    values: Array
    sensor: Array | None = None
    tip: Array | None = None


class _Portion(NamedTuple):
    wrench: Wrenches
    slider: PoseStream
    pusher: PoseStream


class BiasSoFar:
    """Holds wrenches back until the bias is known, then subtracts it; it is refined while free motion is added.

    estimate: None until the tip was free for long enough. problem: why there is no estimate, or no better one.
    """

    def __init__(self) -> None:
        self.begin(None)

    def begin(self, rig: Rig | None) -> None:
        """Begin anew with a rig, by whose outline free motion is found."""
        self.estimate: WrenchBias | None = None
        self.problem = ""
        self._rig = rig
        self._final = False
        self._forget()

    def _forget(self) -> None:
        self._portions: list[_Portion] = []
        self._count = self._seen = 0  # wrenches in the portions, and with those that are no longer kept
        self._next = FIRST  # how many have been seen at the next attempt

    @property
    def waits(self) -> bool:
        """Whether wrenches are held back."""
        return self.estimate is None and self._count > 0

    def put(self, wrench: Wrenches, slider: PoseStream, pusher: PoseStream, last: bool = False) -> Wrenches:
        """The wrenches without bias that are known with these portions; slider and pusher: their new poses.

        last: no more will come.
        """
        known_before = self.estimate is not None
        if wrench.sensor is None:
            wrench = replace(wrench, values=with_planar_numbers(wrench.values))
        if not self._final:
            self._keep(_Portion(wrench, slider, pusher))
        if (
            self._rig is not None
            and not self._final
            and (self._next <= self._seen or (last and self._count > 0 and not known_before))
        ):
            self._attempt(self._rig)
        if self.estimate is None:
            return taken(wrench, slice(0))
        ready = wrench if known_before else joined([portion.wrench for portion in self._portions])
        if self._final:
            self._portions = []
        return replace(ready, values=self.estimate.subtracted_from(ready.values, ready.sensor))

    def _keep(self, portion: _Portion) -> None:
        before = next((each.slider for each in reversed(self._portions) if len(each.slider)), None)
        if before is not None and set_back(before, portion.slider):
            self._forget()  # samples of two times do not make one free motion
            self._final = self.estimate is not None
        self._portions.append(portion)
        self._count += len(portion.wrench.stamp)
        self._seen += len(portion.wrench.stamp)
        self._final = self._final or (self.estimate is not None and self._count > MOST)
        while self._count > MOST and len(self._portions) > 1:
            self._count -= len(self._portions.pop(0).wrench.stamp)

    def _attempt(self, rig: Rig) -> None:
        wrench = joined([portion.wrench for portion in self._portions])
        slider = joined([portion.slider for portion in self._portions])
        pusher = joined([portion.pusher for portion in self._portions])
        free = free_motion(rig, slider, pusher, wrench.stamp)
        try:
            self.estimate, self.problem = estimate_bias(wrench.stamp, wrench.values, free, wrench.sensor), ""
        except BiasError as error:
            self.problem = str(error)
        later = min(round(self._seen * LATER), self._seen + MOST // 10)
        self._next = (later if self.estimate is None else round(self._seen * REFINED)) + 1
