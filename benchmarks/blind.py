"""The residual loop on recordings whose truth it cannot see.

    python -m benchmarks.blind make --out blind/data --truth blind/truth --seed 1 --count 100
    python -m benchmarks.blind run --data blind/data --out blind/results [--without contact_friction]
    python -m benchmarks.blind oracle --data blind/data --truth blind/truth
    python -m benchmarks.blind removed --data blind/data --truth blind/truth --out blind/removed
    python -m benchmarks.blind score --results blind/results --truth blind/truth [--json FILE] [--markdown FILE]

make: the rig simulator makes, for each number, a model trained on a recording (its windows are in the model; the
recording is not kept) and a new recording with an effect drawn from benchmarks/blind_effects.py, with none, or with a
change of the wrench only. What was drawn goes to a folder of its own, which `run` is not told. oracle: what a model
gains that is given the true mechanism, driver and form. removed: like run, on the recordings with an effect of the
library, each traced without the mechanism that acts in it: it must come back as unknown. run, oracle and removed go on
where they were stopped; results and truth of a number are JSON files NNN.json.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.blind_effects import (
    GROUPS,
    HUMIDITY,
    SIZES,
    TEMPERATURE,
    Drawn,
    World,
    draw,
    undisturbed,
)
from benchmarks.blind_library import library_without
from benchmarks.blind_oracle import oracle_gain
from benchmarks.blind_score import markdown_of, score_of
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.recordings.write import write_recording
from push_predictor.simulation.batches import conditions_of, end_times
from push_predictor.simulation.changes import Changes, Conditions, Topic
from push_predictor.simulation.physics import GRAVITY
from push_predictor.simulation.pushes import PushPlan, pusher_path
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.spec import PUSHER_RADIUS, SimulationSpec, start_poses

SHAPES = ("rect1", "rect1", "rect1", "ellip2", "hex")
SURFACES = ("abs", "delrin", "plywood", "pu")
SPEEDS = (0.01, 0.02, 0.03)  # m/s, slow enough that inertia hardly counts
WINDOWS, WINDOW = (3.2, 4.4), 0.2  # windows a push, s
TURN_SPREAD, PLACE_SPREAD = 3.0, 0.05  # rad, m: sliders lie in all directions
MEAN_PAUSE, LONG_BREAKS, LONG_BREAK = 0.6, 2, 40.0  # s: so that time, number and dwell are not the same
CYCLE = (*["none"] * 6, *["wrench"] * 2, *["library"] * 7, *["outside"] * 2, *["measurement"] * 2, "variance")
MODEL = "model.json"


@dataclass(frozen=True)
class Size:
    """How large the recordings are: pushes to train on, pushes to judge on (drawn between the two), training rows."""

    training: int = 500
    least: int = 170
    most: int = 600
    rows: int = 1000
    kind: str = "vhgp"


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what the command line says."""
    options = _parser().parse_args(arguments)
    work: Callable[[argparse.Namespace], None] = options.work
    work(options)
    return 0


def make(options: argparse.Namespace) -> None:
    """Make the recordings."""
    size = Size(options.training, options.least, options.most, options.rows, options.model)
    apart(options.out, options.truth)
    options.truth.mkdir(parents=True, exist_ok=True)
    todo = [(k, size, options) for k in range(options.count) if not _is_made(options, k)]
    _all(_make_kept, todo, options.cores)


def run(options: argparse.Namespace) -> None:
    """Trace every recording; what fails is kept as a result that says so."""
    options.out.mkdir(parents=True, exist_ok=True)
    found = sorted(path.name for path in options.data.iterdir() if (path / MODEL).exists())
    todo = [(name, options) for name in found if not (options.out / f"{name}.json").exists()]
    _all(_trace_kept, todo, options.cores)


def oracle(options: argparse.Namespace) -> None:
    """Add to every truth what an oracle gains."""
    apart(options.data, options.truth)
    todo = [(path, options.data) for path in sorted(options.truth.glob("*.json"))]
    _all(_oracle_kept, [call for call in todo if "oracle_gain" not in json.loads(call[0].read_text())], options.cores)


def removed(options: argparse.Namespace) -> None:
    """Trace every recording with an effect of the library without that mechanism."""
    apart(options.out, options.truth)
    options.out.mkdir(parents=True, exist_ok=True)
    told = {path.stem: json.loads(path.read_text()) for path in sorted(options.truth.glob("*.json"))}
    acting = {name: truth["names"][0] for name, truth in told.items() if truth["group"] == "library"}
    todo = [
        (name, argparse.Namespace(**{**vars(options), "without": mechanism}))
        for name, mechanism in acting.items()
        if (options.data / name / MODEL).exists() and not (options.out / f"{name}.json").exists()
    ]
    _all(_trace_kept, todo, options.cores)


def score(options: argparse.Namespace) -> None:
    """Print the table, write it where asked."""
    truths = {path.stem: json.loads(path.read_text()) for path in sorted(options.truth.glob("*.json"))}
    results = {path.stem: json.loads(path.read_text()) for path in sorted(options.results.glob("*.json"))}
    scored = score_of(truths, results)
    if options.json:
        options.json.write_text(json.dumps(scored, indent=1))
    text = markdown_of(scored)
    if options.markdown:
        options.markdown.write_text(text)
    print(text)


def apart(data: Path, truth: Path) -> None:
    """Refuse folders of which one lies in the other: the trace must not come upon the truth."""
    one, other = data.resolve(), truth.resolve()
    if one == other or one in other.parents or other in one.parents:
        raise SystemExit(f"--truth: {truth} and {data} must lie apart")


def make_one(number: int, group: str, seed: int, size: Size, out: Path, truth: Path) -> Drawn:
    """Make recording `number` of a group ('none' or one of GROUPS) into out/NNN, what was drawn into truth/NNN.json."""
    rng = np.random.default_rng([seed, number])
    plain = rig_of(rng, f"{number:03d}", size.training)
    later = later_spec(plain, rng, int(rng.integers(size.least, size.most + 1)))
    drawn = drawn_for(later, group, rng)
    acting = {"changes": drawn.act} if isinstance(drawn.act, Changes) else {"faults": drawn.act}
    folder = out / f"{number:03d}"
    training = simulate(replace(plain, name="training"))
    folder.mkdir(parents=True, exist_ok=True)
    write_recording(folder / "new", simulate(replace(later, name="new", **acting)))
    rig = training.rig
    assert rig is not None  # the simulator knows its rig
    table = windows_to_table(find_windows(training, rig))
    rows = min(size.rows, len(table))
    save_model(
        train_model(table, rig, size.kind, name=f"{number:03d}", options=TrainingOptions(n_train=rows, seed=seed)),
        folder / MODEL,
    )
    told = {"number": number, "group": group, "seed": seed, "shape": plain.slider.name, "surface": plain.table.name}
    known = {key: value for key, value in asdict(replace(drawn, act=Changes())).items() if key != "act"}
    (truth / f"{number:03d}.json").write_text(json.dumps({**told, "pushes": len(later.pushes), **known}, indent=1))
    return drawn


def rig_of(rng: np.random.Generator, name: str, pushes: int) -> SimulationSpec:
    """A rig and its training recording, drawn."""
    spec = SimulationSpec(
        str(rng.choice(SHAPES)),
        str(rng.choice(SURFACES)),
        pushes_of(rng, pushes),
        seed=int(rng.integers(2**31)),
        surface_seed=int(rng.integers(2**31)),
        slider_seed=int(rng.integers(2**31)),
        name=name,
        place_spread=PLACE_SPREAD,
        turn_spread=TURN_SPREAD,
    )
    return beside(spec, rng)


def later_spec(plain: SimulationSpec, rng: np.random.Generator, pushes: int) -> SimulationSpec:
    """The same rig another day: pushes, pauses, noise and topics of its own."""
    return beside(replace(plain, pushes=pushes_of(rng, pushes), seed=int(rng.integers(2**31))), rng)


def pushes_of(rng: np.random.Generator, n: int) -> PushPlan:
    """Pushes of three to four windows at several speeds from all sides."""
    speed = rng.choice(SPEEDS, n)
    travel = rng.uniform(*WINDOWS, n) * WINDOW * speed + 0.002
    return PushPlan(rng.random(n), rng.uniform(-1.2, 1.2, n), speed, travel)


def beside(spec: SimulationSpec, rng: np.random.Generator) -> SimulationSpec:
    """The spec with pauses between its pushes and two scalars beside them that drift."""
    n = len(spec.pushes)
    pauses = rng.exponential(MEAN_PAUSE, n)
    pauses[rng.integers(n, size=LONG_BREAKS)] += LONG_BREAK
    lasts = float(conditions(replace(spec, pauses=pauses)).values["elapsed_time"][-1]) + 10.0
    time = np.linspace(0.0, lasts, 400)
    topics = {
        TEMPERATURE: Topic(time, 22.0 + wander(rng, 1.5, len(time)), 0.02),
        HUMIDITY: Topic(time, 45.0 + wander(rng, 5.0, len(time)), 0.1),
    }
    return replace(spec, pauses=pauses, topics=topics)


def wander(rng: np.random.Generator, size: float, n: int) -> np.ndarray:
    """A random walk of n steps that ranges over about 3 `size`."""
    walk = np.cumsum(rng.standard_normal(n))
    return np.asarray(3.0 * size * (walk - walk.mean()) / np.ptp(walk))


def conditions(spec: SimulationSpec) -> Conditions:
    """Under which conditions the pushes of a spec begin."""
    start = start_poses(spec)
    path = pusher_path(spec.pushes, spec.slider.outline, PUSHER_RADIUS, start, spec.acceleration)
    return conditions_of(spec, start, path, end_times(path, spec.table.friction))


def drawn_for(spec: SimulationSpec, group: str, rng: np.random.Generator) -> Drawn:
    """An effect of a group for this recording."""
    if group == "none":
        return undisturbed()
    world = World(spec.slider.outline, spec.slider.mass * GRAVITY, spec.table.friction, conditions(spec), rng)
    kinds = GROUPS[group]
    return draw(kinds[int(rng.integers(len(kinds)))], str(rng.choice(SIZES)), world)


def trace_one(folder: Path, alpha: float, without: str | None) -> dict[str, Any]:
    """The verdict on one recording, with the seconds of processor time that it took."""
    from push_predictor.residuals.reporting.trace_json import trace_json
    from push_predictor.residuals.trace import trace_data

    begin = time.process_time()
    try:
        with library_without(without):
            verdict = trace_json(trace_data([folder / "new"], folder / MODEL, alpha=alpha))
    except Exception as error:  # a failed trace is a result, the others go on
        verdict = {"failed": f"{type(error).__name__}: {error}"}
    return {**verdict, "seconds": time.process_time() - begin, "without": without}


def _group(seed: int, number: int) -> str:
    """Groups come in the shares of CYCLE, in an order that the seed draws."""
    turn, place = divmod(number, len(CYCLE))
    return str(np.random.default_rng([seed, turn, 99]).permutation(CYCLE)[place])


def _is_made(options: argparse.Namespace, number: int) -> bool:
    return (options.truth / f"{number:03d}.json").exists() and (options.out / f"{number:03d}" / MODEL).exists()


def _make_kept(number: int, size: Size, options: argparse.Namespace) -> None:
    group = options.group or _group(options.seed, number)
    make_one(number, group, options.seed, size, options.out, options.truth)


def _trace_kept(name: str, options: argparse.Namespace) -> None:
    verdict = trace_one(options.data / name, options.alpha, options.without)
    _write(options.out / f"{name}.json", verdict)


def _oracle_kept(truth: Path, data: Path) -> None:
    known = json.loads(truth.read_text())
    gain = oracle_gain(data / truth.stem / "new", data / truth.stem / MODEL, known)
    _write(truth, {**known, "oracle_gain": gain})


def _write(path: Path, content: dict[str, Any]) -> None:
    """All at once: a run that is stopped leaves no half of a file."""
    new = path.with_suffix(".new")
    new.write_text(json.dumps(content, indent=1))
    new.replace(path)


def _all(function: Callable[..., None], calls: Sequence[tuple[Any, ...]], cores: int) -> None:
    import joblib

    done = joblib.Parallel(n_jobs=cores, return_as="generator_unordered", batch_size=1)(
        joblib.delayed(function)(*call) for call in calls
    )
    for count, _ in enumerate(done, start=1):
        print(f"\r{count} of {len(calls)}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    command = _command(commands, "make", make, out="recordings", truth="truth")
    for name, default in (("seed", 1), ("count", 100), ("training", 500), ("least", 170), ("most", 600)):
        command.add_argument(f"--{name}", type=int, default=default)
    command.add_argument("--rows", type=int, default=1000, help="rows that the model is trained on")
    command.add_argument("--model", default="vhgp", choices=("vhgp", "gp", "analytical"))
    command.add_argument("--group", choices=("none", *GROUPS), help="only effects of this group")
    command = _command(commands, "run", run, data="recordings", out="verdicts")
    command.add_argument("--alpha", type=float, default=0.01)
    command.add_argument("--without", metavar="MECHANISM", help="take it out of the library")
    command = _command(commands, "removed", removed, data="recordings", truth="truth", out="verdicts")
    command.add_argument("--alpha", type=float, default=0.01)
    _command(commands, "oracle", oracle, data="recordings", truth="truth")
    command = _command(commands, "score", score, results="verdicts", truth="truth")
    command.add_argument("--json", type=Path)
    command.add_argument("--markdown", type=Path)
    return parser


def _command(
    commands: Any, name: str, work: Callable[[argparse.Namespace], None], **folders: str
) -> argparse.ArgumentParser:
    command: argparse.ArgumentParser = commands.add_parser(name, help=work.__doc__)
    command.set_defaults(work=work)
    command.add_argument("--cores", type=int, default=-1)
    for option, content in folders.items():
        command.add_argument(f"--{option}", type=Path, required=True, metavar="DIR", help=f"folder of the {content}")
    return command


if __name__ == "__main__":
    sys.exit(main())
