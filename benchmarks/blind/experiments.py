# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How often twenty proposed pushes settle an undecided verdict, next to twenty random ones.

    python -m benchmarks.blind make --out blind/data --truth blind/truth --seed 1 --count 100
    python -m benchmarks.blind run --data blind/data --out blind/results
    python -m benchmarks.blind.experiments --data blind/data --truth blind/truth --results blind/results --out more

For each recording with an undecided effect on the mean of the motion, the same rig with the same hidden effect is
pushed on twice: with the pushes that its trace proposes, and with as many random ones. Each continuation is written
as a recording, and traced with --and. A verdict is settled if one covariate remains, and settled right if the effect
depends on that one. The rig and its effect are drawn again from the seed, so --training, --least and --most must be
those of `make`. An interrupted run continues.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.blind.commands import apart
from benchmarks.blind.judge import judge
from benchmarks.blind.recordings import MEAN_PAUSE, MODEL, WINDOW, WINDOWS, Size, conditions, drawn_recording, pushes_of
from benchmarks.blind.scores import wilson
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, WrenchStream
from push_predictor.recordings.write import write_recording
from push_predictor.residuals.reporting.trace_json import trace_json
from push_predictor.residuals.selection.experiment import PUSHES
from push_predictor.residuals.trace import trace_data
from push_predictor.simulation.changes import Topic
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array

ARMS = ("proposed", "random")
SETTLED_RIGHT, SETTLED_WRONG, UNDECIDED, FAILED = "settled, right", "settled, wrong", "still undecided", "failed"
OUTCOMES = (SETTLED_RIGHT, SETTLED_WRONG, UNDECIDED, FAILED)
TOPIC_TIME = 3.0  # s in which a topic is brought to its value before a push
BEFORE = 1.0  # s of the recording before its first push

Json = Mapping[str, Any]
Push = Mapping[str, float]


def main(arguments: Sequence[str] | None = None) -> int:
    """Continue every undecided recording, trace again, and print the table."""
    options = _parser().parse_args(arguments)
    apart(options.data, options.truth)
    apart(options.out, options.truth)
    options.out.mkdir(parents=True, exist_ok=True)
    size = Size(options.training, options.least, options.most)
    for name in undecided_of(options.results)[: options.most_recordings]:
        path = options.out / f"{name}.json"
        if not path.exists():
            found = _continue_and_trace(name, options, size)
            path.write_text(json.dumps(found, indent=1))
            print(f"{name}: {found}", file=sys.stderr, flush=True)
    text = markdown_of([json.loads(path.read_text()) for path in sorted(options.out.glob("*.json"))])
    if options.markdown:
        options.markdown.write_text(text)
    print(text)
    return 0


def undecided_of(results: Path) -> list[str]:
    """Recordings with an undecided effect on the mean of the motion; pushes are proposed only for these."""
    found = {path.stem: json.loads(path.read_text()) for path in sorted(results.glob("*.json"))}
    return [name for name, one in found.items() if one.get("undecided") and _of_mean(one)]


def _of_mean(result: Json) -> bool:
    return bool(result["channel"] == "motion" and result["kind"] == "mean")


def outcome_of(truth: Json, result: Json) -> str:
    """Whether a verdict is settled, and whether what it names is right."""
    if "failed" in result:
        return FAILED
    if result["undecided"]:
        return UNDECIDED
    return SETTLED_RIGHT if judge(truth, result).driver else SETTLED_WRONG


def markdown_of(found: Sequence[Json]) -> str:
    """The table: what became of the undecided verdicts, with 95 % Wilson intervals."""
    lines = ["| further pushes | " + " | ".join(OUTCOMES) + " | settled, right: share, 95 % interval |"]
    lines.append("|" + " --- |" * (len(OUTCOMES) + 2))
    for arm in ARMS:
        counts = Counter(one[arm]["outcome"] for one in found)
        low, high = wilson(counts[SETTLED_RIGHT], len(found))
        share = f"{counts[SETTLED_RIGHT]} of {len(found)} ({100 * low:.0f} to {100 * high:.0f} %)"
        lines.append(f"| {arm} | " + " | ".join(str(counts[outcome]) for outcome in OUTCOMES) + f" | {share} |")
    rivals = ", ".join(f"{_mean([len(one[arm]['rivals']) for one in found]):.2f} with {arm} pushes" for arm in ARMS)
    before = _mean([len(one["rivals"]) for one in found])
    empty = sum(one["proposed"]["pushes"] == 0 for one in found)
    lines += ["", f"Covariates that remain possible, mean: {before:.2f} before, {rivals}."]
    lines += [f"Nothing was proposed for {empty} of {len(found)}: these count as still undecided.", ""]
    return "\n".join(lines)


def rivals_of(result: Json) -> list[str]:
    """The covariates that remain possible for the first effect."""
    return [*result.get("covariates", [])[:1], *result.get("equivalent", [])]


# --- one recording -----------------------------------------------------------------------------------------------


def _continue_and_trace(name: str, options: argparse.Namespace, size: Size) -> dict[str, Any]:
    """What proposed and random pushes make of the undecided verdict on a recording."""
    truth, first = (json.loads((folder / f"{name}.json").read_text()) for folder in (options.truth, options.results))
    later = _as_in_truth(truth, size)
    rng = np.random.default_rng([truth["seed"], truth["number"], PUSHES])
    found: dict[str, Any] = {"rivals": rivals_of(first), "acting": truth["covariates"], "kind": truth["kind"]}
    further = {"proposed": proposed_spec(later, first["experiment"], rng), "random": random_spec(later, PUSHES, rng)}
    for arm, spec in further.items():
        if spec is None:
            found[arm] = {"pushes": 0, "outcome": UNDECIDED, "rivals": rivals_of(first)}
            continue
        path = options.out / name / arm
        path.parent.mkdir(exist_ok=True)
        original = read_recording(options.data / name / "new")
        write_recording(path, continuation(later, spec, int(original.slider.stamp[0])))
        result = _traced(options.data / name, path)
        found[arm] = {
            "pushes": len(spec.pushes) - len(later.pushes),
            "outcome": outcome_of(truth, result),
            "rivals": rivals_of(result),
            "verdict": result.get("verdict"),
        }
    return found


def _as_in_truth(truth: Json, size: Size) -> SimulationSpec:
    """The recording with its effect, drawn again. Raises SystemExit if it is not the one of the truth."""
    _, later, drawn = drawn_recording(truth["number"], truth["group"], truth["seed"], size)
    same = json.loads(json.dumps(drawn.described()))
    if len(later.pushes) != truth["pushes"] or any(truth[key] != value for key, value in same.items()):
        raise SystemExit(f"recording {truth['number']}: give --training, --least and --most as for `make`")
    return later


def _traced(folder: Path, more: Path) -> dict[str, Any]:
    try:
        return trace_json(trace_data([folder / "new"], folder / MODEL, experiment=[more]))
    except Exception as error:  # a failed trace is a result; the others continue
        return {"failed": f"{type(error).__name__}: {error}"}


# --- further pushes -----------------------------------------------------------------------------------------------


def random_spec(later: SimulationSpec, count: int, rng: np.random.Generator) -> SimulationSpec:
    """The recording with random further pushes, made as those before."""
    return _longer(later, pushes_of(rng, count), rng.exponential(MEAN_PAUSE, count), np.full((count, 3), np.nan))


def proposed_spec(later: SimulationSpec, pushes: Sequence[Push], rng: np.random.Generator) -> SimulationSpec | None:
    """The recording with the proposed further pushes, None if there are none."""
    if not pushes:
        return None
    speed = np.array([push["velocity"] for push in pushes])
    usual = rng.uniform(*WINDOWS, len(pushes)) * WINDOW * speed + 0.002
    travel = np.array([push.get("travel", length) for push, length in zip(pushes, usual, strict=True)])
    contact, angle = (np.array([push[name] for push in pushes]) for name in ("contact", "angle"))
    plan = PushPlan(contact, angle, speed, travel)
    start = np.array([[push.get(f"slider_{name}", np.nan) for name in ("x", "y", "heading")] for push in pushes])
    proposed = {name: [push.get(f"topic:/{name}", np.nan) for push in pushes] for name in later.topics}
    moved = {name: values for name, values in proposed.items() if np.all(np.isfinite(values))}
    pauses = np.full(len(pushes), TOPIC_TIME if moved else 0.0)
    at_once = _longer(later, plan, pauses, start)
    spec = _longer(later, plan, pauses + _waits(at_once, pushes), start)
    return replace(spec, topics={**spec.topics, **_moved_topics(spec, moved, len(pushes))})


def _waits(spec: SimulationSpec, pushes: Sequence[Push]) -> Array:
    """Additional pauses (m,) until the proposed elapsed times and dwell times of the last m pushes are reached."""
    values, count = conditions(spec).values, len(pushes)
    waits = np.zeros(count)
    for k, push in enumerate(pushes):
        time, dwell = (values[name][k - count] for name in ("elapsed_time", "dwell_time"))
        late = push.get("elapsed_time", -np.inf) - time - waits[:k].sum()
        waits[k] = max(0.0, late, push.get("dwell_time", -np.inf) - dwell)
    return waits


def _longer(later: SimulationSpec, plan: PushPlan, pauses: Array, start: Array) -> SimulationSpec:
    """The recording with further pushes, its topics as they were at its end."""
    both = (np.concatenate(pair) for pair in zip(vars(later.pushes).values(), vars(plan).values(), strict=True))
    drawn = np.full((len(later.pushes), 3), np.nan)
    before = np.zeros(len(later.pushes)) if later.pauses is None else later.pauses
    return replace(later, pushes=PushPlan(*both), pauses=np.append(before, pauses), start=np.vstack([drawn, start]))


def _moved_topics(spec: SimulationSpec, moved: Mapping[str, Sequence[float]], count: int) -> dict[str, Topic]:
    """Topics that are at the given values from shortly before each of the last pushes until the next one nears."""
    begin = conditions(spec).values["elapsed_time"][-count:] - 0.7 * TOPIC_TIME
    found = {}
    for name, values in moved.items():
        old = spec.topics[name]
        ends = np.append(begin[1:], begin[-1] + 1e3) - 0.2 * TOPIC_TIME
        known = old.time < begin[0] - TOPIC_TIME
        time = np.concatenate([old.time[known], np.column_stack([begin, ends]).ravel()])
        found[name] = replace(old, time=time, value=np.concatenate([old.value[known], np.repeat(values, 2)]))
    return found


def continuation(later: SimulationSpec, longer: SimulationSpec, first_stamp: int) -> Recording:
    """The part of the longer recording after the recording that it continues, with stamps that continue it.

    first_stamp: of the slider's pose in that recording, ns.
    """
    whole = simulate(replace(longer, name="experiment"))
    begin = float(conditions(longer).values["elapsed_time"][len(later.pushes)]) - BEFORE
    own = int(whole.slider.stamp[0])
    after, by = own + round(1e9 * begin), first_stamp - own
    slider, pusher = (_poses(stream, after, by) for stream in (whole.slider, whole.pusher))
    scalars = {}
    for name, scalar in whole.scalars.items():
        kept = scalar.stamp >= after
        scalars[name] = ScalarStream(scalar.stamp[kept] + by, scalar.value[kept])
    wrench = whole.wrench
    assert wrench is not None  # the simulator has a force sensor
    kept = wrench.stamp >= after
    felt = WrenchStream(wrench.stamp[kept] + by, wrench.fx[kept], wrench.fy[kept], wrench.torque[kept])
    return replace(whole, slider=slider, pusher=pusher, wrench=felt, scalars=scalars)


def _poses(stream: PoseStream, after: int, by: int) -> PoseStream:
    kept = stream.stamp >= after
    return PoseStream(stream.stamp[kept] + by, stream.x[kept], stream.y[kept], stream.z[kept], stream.heading[kept])


def _mean(values: Sequence[int]) -> float:
    return float(np.mean(values)) if values else 0.0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, content in (("data", "recordings"), ("truth", "truth"), ("results", "verdicts"), ("out", "results")):
        parser.add_argument(f"--{name}", type=Path, required=True, metavar="DIR", help=f"folder of the {content}")
    for name, default in (("training", 500), ("least", 170), ("most", 600)):
        parser.add_argument(f"--{name}", type=int, default=default, help="as for `make` (default %(default)s)")
    parser.add_argument("--most-recordings", type=int, metavar="N", help="stop after so many undecided recordings")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="write the table to this file")
    return parser


if __name__ == "__main__":
    sys.exit(main())
