# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The command line: every sub-command on a small simulated recording, its JSON, errors and exit status."""

from __future__ import annotations

import contextlib
import io
import json
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import Writer
from repository import REPOSITORY

from push_predictor import __version__
from push_predictor.cli import COMMANDS, main
from push_predictor.evaluation.judgement import judged
from push_predictor.evaluation.offline import validate_recording
from push_predictor.evaluation.validation import compare, metrics_json
from push_predictor.models.predictors import MechanicsPredictor
from push_predictor.models.store.model_file import load_model
from push_predictor.recordings.load import known_rig, load_data
from push_predictor.recordings.rig import load_rig
from push_predictor.recordings.table_file import read_table, write_table

pytestmark = pytest.mark.slow

OUTPUTS = ["dx", "dy", "dtheta"]
METRICS = ["model", "n_train", "n_test", "n_pushes", "nmse", "nlpd", "exact_nlpd", "joint_nlpd", "coverage"]
SHORT = ["--speed", "0.02", "0.05", "--travel", "0.022"]  # m/s and m: of simulated pushes
PUSH = ["--velocity", "0.02", "--contact", "0.1", "--angle", "0.3"]


@dataclass(frozen=True)
class Place:
    """A folder with two recordings, models of the first, a table, and what the commands printed."""

    folder: Path
    printed: dict[str, str]

    def path(self, name: str) -> str:
        return str(self.folder / name)


@dataclass(frozen=True)
class Outcome:
    status: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    """simulate -> train, as a user would."""
    folder = tmp_path_factory.mktemp("cli")
    simulate = ["simulate", "--shape", "rect1", "--surface", "abs", *SHORT]
    calls = {
        "train recording": [*simulate, "--pushes", "6", "--seed", "1", "--out", str(folder / "train")],
        "test recording": [*simulate, "--pushes", "4", "--seed", "2", "--json", "-"]
        + ["--out", str(folder / "test.mcap")],
        "gp": ["train", str(folder / "train"), "--kind", "gp", "--mean", "zero"]
        + ["--out", str(folder / "gp.pushmodel")],
        "vhgp": ["train", str(folder / "train"), "--kind", "vhgp", "--n-train", "15", "--name", "hetero"]
        + ["--mean", "zero"]
        + ["--out", str(folder / "vhgp.pushmodel"), "--json", "-"],
        "analytical": ["train", str(folder / "train"), "--kind", "analytical", "--fit"]
        + ["--out", str(folder / "analytical.pushmodel"), "--json", str(folder / "train.json")],
    }
    printed = {}
    for name, call in calls.items():
        with contextlib.redirect_stdout(io.StringIO()) as output:
            assert main(call) == 0
        printed[name] = output.getvalue()
    write_table(folder / "test.csv", load_data([folder / "test.mcap"]))
    rig = yaml.safe_dump(load_model(folder / "gp.pushmodel").rig.to_record())
    (folder / "test.rig.yaml").write_text(rig)
    return Place(folder, printed)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Any:
    def call(*arguments: str) -> Outcome:
        capsys.readouterr()
        try:
            status = main(arguments)
        except SystemExit as end:  # argparse
            status = int(end.code or 0)
        printed = capsys.readouterr()
        return Outcome(status, printed.out, printed.err)

    return call


def assert_one_line(outcome: Outcome, command: str, words: Sequence[str]) -> None:
    """Assert exit status 1 and one line on stderr that names the fault."""
    assert outcome.status == 1 and outcome.out == ""
    lines = without_progress(outcome.err)
    assert len(lines) == 1 and lines[0].startswith(f"push_predictor {command}: "), outcome.err
    for word in words:
        assert word in lines[0], f"{word!r} is not in {lines[0]!r}"


# --- help and wrong calls --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example_and_json(command: str, run):
    shown = run(command, "--help")
    assert shown.status == 0 and shown.err == ""
    assert f"example:\n  push_predictor {command} " in shown.out
    assert "--json FILE|-" in shown.out


@pytest.mark.parametrize(
    "call",
    [
        [],
        ["bogus"],
        ["train"],
        ["train", "data", "--kind", "forest", "--out", "m"],
        ["train", "data", "--out", "m"],
        ["predict", "m", "--velocity", "fast", "--contact", "0", "--angle", "0"],
        ["import", "martian", "x", "--out", "y"],
        ["evaluate", "m"],
        ["simulate", "--shape", "rect1", "--surface", "abs", "--pushes", "many", "--speed", "0.02", "--out", "x"],
        ["report", "paper", "--model", "x", "--out", "y"],
        ["trace", "new.csv", "--alp", "0.1", "--model", "m"],
        ["suggest", "--out", "x"],
        ["rig", "--surface", "abs", "--out", "x"],
        ["rig", "--square", "0.09", "--from", "bag", "--out", "x"],
        ["suggest", "m", "--rig", "rig.yaml", "--out", "x"],
    ],
)
def test_wrong_call_exits_with_2_and_prints_the_usage(call: list[str], run):
    outcome = run(*call)
    assert outcome.status == 2 and outcome.out == ""
    assert outcome.err.startswith("usage: push_predictor")


def test_version_and_the_list_of_commands(run):
    assert run("--version").out == f"push_predictor {__version__}\n"
    shown = run("--help").out
    assert all(f"    {command} " in shown for command in COMMANDS)


def test_help_imports_neither_ros_nor_scipy_nor_completion():
    """So it is there at once."""
    code = (
        "import sys; from push_predictor.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass\n"
        "slow = {'rclpy', 'scipy', 'matplotlib', 'argcomplete'}; sys.exit(' '.join(slow & sys.modules.keys()) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()


# --- simulate, train -------------------------------------------------------------------------------------------------


def test_simulate_reports_the_recording(place: Place, run):
    assert place.printed["train recording"].startswith(f"{place.path('train')}: 6 pushes, ")
    made = json.loads(place.printed["test recording"])
    assert made["recording"] == place.path("test.mcap") and made["pushes"] == 4 and 1.0 < made["seconds"] < 100.0


def test_train_reports_model_windows_and_pushes(place: Place):
    assert ": gp, trained on 24 of 24 windows, 6 pushes" in place.printed["gp"]
    learned = json.loads(place.printed["vhgp"])
    assert (learned["name"], learned["kind"], learned["n_train"]) == ("hetero", "vhgp", 15)
    assert learned["n_rows"] == len(load_data([Path(place.path("train"))]))
    assert learned["mean"] == "zero"
    assert json.loads(Path(place.path("train.json")).read_text())["kind"] == "analytical"
    assert load_model(Path(place.path("gp.pushmodel"))).name == "gp"


def test_train_fit_prints_the_ladder_and_saves_it_next_to_the_model(place: Place):
    printed, model = place.printed["analytical"], load_model(place.path("analytical.pushmodel"))
    assert "0     textbook" in printed and "Parameters fitted to all" in printed
    saved = json.loads(Path(place.path("analytical.ladder.json")).read_text())
    assert isinstance(model.predictor, MechanicsPredictor)
    assert [parameter["name"] for parameter in saved["parameters"]] == list(model.predictor.fitted.values)
    assert "<svg" in Path(place.path("analytical.ladder.html")).read_text()


def test_shorter_stride_gives_more_training_windows(place: Place, run):
    out = place.path("dense.pushmodel")
    call = ["train", place.path("train"), "--kind", "analytical", "--out", out, "--json", "-", "--force"]
    assert run(*call, "--stride", "0.05").json["n_rows"] > 2 * run(*call).json["n_rows"]


# --- predict ---------------------------------------------------------------------------------------------------------


def test_predict_equals_the_model(place: Place, run):
    model = load_model(Path(place.path("gp.pushmodel")))
    expected = model.predict_rows(np.array([[0.02, 0.1, 0.3]]), np.array([0.2]))
    found = run("predict", place.path("gp.pushmodel"), *PUSH, "--json", "-").json
    assert found["model"] == "gp" and found["in_domain"] is bool(expected.in_domain[0])
    sd = np.sqrt(np.diag(expected.covariance[0]))
    assert np.all(np.abs(np.array(found["mean"]) - expected.mean[0]) < 1e-3 * sd)
    assert np.reshape(found["covariance"], (3, 3)) == pytest.approx(expected.covariance[0], rel=1e-2, abs=1e-12)
    assert len(found["process_covariance"]) == 9
    low, high = expected.interval(0.95)
    assert found["interval"]["level"] == 0.95 and found["interval"]["kind"] == "student"
    assert found["interval"]["low"] == pytest.approx(low[0].tolist(), rel=1e-2)
    assert found["interval"]["high"] == pytest.approx(high[0].tolist(), rel=1e-2)


def test_predict_prints_a_line_for_each_output(place: Place, run):
    lines = run("predict", place.path("gp.pushmodel"), *PUSH, "--covariate", "dwell_time=3").out.splitlines()
    assert [line.split()[0] for line in lines[:3]] == OUTPUTS
    assert all(re.search(r"95 % interval -?[\d.]+ to -?[\d.]+ (mm|deg)$", line) for line in lines[:3])
    assert "training data" in lines[3]


# --- evaluate, validate ----------------------------------------------------------------------------------------------


def assert_metrics_format(metrics: dict[str, Any]) -> None:
    """The keys of docs/reference/json.md, and numbers in them."""
    assert set(METRICS) <= metrics.keys()
    for key in ("nmse", "nlpd"):
        assert list(metrics[key]) == [*OUTPUTS, "total"]
        assert metrics[key]["total"] == pytest.approx(sum(metrics[key][name] for name in OUTPUTS))
    assert list(metrics["coverage"]) == ["0.5", "0.9", "0.95"]
    for shares in metrics["coverage"].values():
        assert list(shares) == OUTPUTS and all(0.0 <= share <= 1.0 for share in shares.values())
    assert isinstance(metrics["joint_nlpd"], float)


@pytest.mark.parametrize("kind", ["vhgp", "analytical"])
def test_evaluate_and_validate_equal_the_library(kind: str, place: Place, run):
    model, recording = place.path(f"{kind}.pushmodel"), place.path("test.mcap")
    evaluated, validated = (
        run("evaluate", model, recording, "--json", "-"),
        run("validate", model, recording, "--json", "-"),
    )
    assert evaluated.status == validated.status == 0
    lines = without_progress(evaluated.err, validated.err)
    assert [line.partition(" only.")[0] for line in lines] == [f"warning: {recording}: The data contain 4 pushes"] * 2
    loaded = load_model(Path(model))
    assert evaluated.json == json.loads(json.dumps(metrics_json(compare(loaded, load_data([Path(recording)])))))
    _, comparison = validate_recording(loaded, Path(recording))
    online = validated.json
    assert judged(online).sentence == online.pop("judgement")
    assert online.pop("alarm")["fired"] is False
    assert online.pop("n_training_pushes") == 0
    assert online == json.loads(json.dumps(metrics_json(comparison)))
    for metrics in (evaluated.json, online):
        assert_metrics_format(metrics)
        assert (metrics["n_pushes"], metrics["n_train"]) == (4, len(loaded.training))
    assert (validated.json["exact_nlpd"] is None) is (kind == "analytical")


def test_evaluate_and_validate_warn_about_training_pushes(place: Place, run):
    model = place.path("gp.pushmodel")
    outcome = run("evaluate", model, place.path("train"), place.path("test.csv"), "--json", "-")
    assert outcome.status == 0 and outcome.json["n_pushes"] == 10
    (warned,) = without_progress(outcome.err)
    assert warned == "warning: 6 of these 10 pushes were used for training: the scores are optimistic."
    few, warned = without_progress(run("validate", model, place.path("train")).err)
    assert "The data contain 6 pushes only." in few
    assert warned.startswith("warning: 6 of these 6 pushes were used for training")


def test_printed_scores_equal_the_json(place: Place, run):
    call = ["validate", place.path("vhgp.pushmodel"), place.path("test.mcap")]
    metrics, words = run(*call, "--json", "-").json, run(*call).out
    sentence, error, action, scored, *_ = words.splitlines()
    assert (sentence, action) == (metrics["judgement"], judged(metrics).action)
    assert error.startswith(f"Its squared error (total NMSE) is {metrics['nmse']['total']:#.3g} (95 % CI ")
    assert scored == f"hetero: {metrics['n_test']} windows of 4 pushes, trained on 15 windows"
    (total,) = (line.split() for line in words.splitlines() if line.startswith("total"))
    assert total[1:4] == [f"{metrics[key]['total']:.3f}" for key in ("nmse", "nlpd", "exact_nlpd")]


def test_json_is_written_to_a_file_and_text_to_stdout(place: Place, run, tmp_path: Path):
    file, log = tmp_path / "new" / "metrics.json", tmp_path / "windows.json"
    call = ["validate", place.path("gp.pushmodel"), place.path("test.mcap")]
    outcome = run(*call, "--json", str(file), "--windows", str(log))
    assert outcome.out.splitlines()[3].startswith("gp: ")
    assert json.loads(file.read_text()) == run(*call, "--json", "-").json
    windows = json.loads(log.read_text())["windows"]
    assert len(windows) == json.loads(file.read_text())["n_test"]
    assert {"push_id", "window", "predicted", "observed"} <= windows[0].keys()


# --- info, import, report --------------------------------------------------------------------------------------------


def test_info_describes_recording_table_and_model(place: Place, run):
    recording = run("info", place.path("test.mcap"), "--json", "-").json
    assert recording["pushes"] == 4 and recording["windows"] == len(load_data([Path(place.path("test.mcap"))]))
    assert set(recording["streams"]) >= {"slider", "pusher", "wrench"}
    assert run("info", place.path("test.csv"), "--json", "-").json["rows"] == recording["windows"]
    model = run("info", place.path("vhgp.pushmodel"), "--json", "-").json
    assert (model["model"], model["kind"], model["windows"], model["shape"]) == ("hetero", "vhgp", 15, "rect1")
    for name in ("test.mcap", "test.csv", "vhgp.pushmodel"):
        assert run("info", place.path(name)).out.count("\n") > 5


def test_info_saves_the_rig_of_a_recording_that_loses_it_by_conversion(place: Place, run, tmp_path: Path):
    whole, bare, rig = (
        place.path("test.mcap"),
        str(converted(Path(place.path("test.mcap")), tmp_path)),
        tmp_path / "r.yaml",
    )
    assert_one_line(run("info", bare, "--rig-out", str(rig)), "info", ["converted.mcap", "no push_rig"])
    assert not rig.exists()
    saved = run("info", whole, "--rig-out", str(rig))
    assert saved.status == 0 and saved.err == f"rig: {rig}\n"
    assert load_rig(rig).to_record() == known_rig(Path(whole)).to_record()
    assert run("info", bare, "--json", "-").json["rig"].startswith("none")
    with_rig = run("info", bare, "--rig", str(rig), "--json", "-").json
    assert with_rig | {"recording": ""} == run("info", whole, "--json", "-").json | {"recording": ""}


def converted(bag: Path, folder: Path) -> Path:
    """The messages of a bag alone, as other tools copy them: without the metadata records."""
    path = folder / "converted.mcap"
    with bag.open("rb") as source, path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        channels: dict[str, int] = {}
        for schema, channel, message in make_reader(source).iter_messages():
            if channel.topic not in channels:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", kind, channel.metadata)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()
    return path


def test_info_writes_a_rig_only_of_a_recording_and_over_no_file(place: Place, run, tmp_path: Path):
    rig, old = str(tmp_path / "rig.yaml"), tmp_path / "old.yaml"
    assert_one_line(run("info", place.path("test.csv"), "--rig-out", rig), "info", ["--rig-out", "test.csv is none"])
    old.write_text("mine\n")
    refused = run("info", place.path("test.mcap"), "--rig-out", str(old))
    assert_one_line(refused, "info", ["--rig-out", "--force to overwrite"])
    assert old.read_text() == "mine\n"
    assert run("info", place.path("test.mcap"), "--rig-out", str(old), "--force").status == 0
    assert load_rig(old).shape == "rect1"


def test_import_writes_a_table_and_a_rig_that_train_reads(run, tmp_path: Path):
    rng = np.random.default_rng(0)
    names = ["c", "beta", "dx", "dy", "dtheta"]
    source = tmp_path / "pushes_40.npz"
    columns = {name: rng.uniform(0.1, 0.9, 40) * (0.004 if name in ("dx", "dy") else 1.0) for name in names}
    np.savez(source, **columns, push_group_est=np.repeat(np.arange(8), 5), row_id=np.arange(40))
    out = tmp_path / "imported"
    report = run("import", "mit-square", str(source), "--out", str(out), "--json", "-")
    assert report.status == 0 and report.json, report.err
    table = read_table(out / "pushes_40.csv")
    assert np.allclose(table.inputs[:, 1], columns["c"] / 4) and np.allclose(table.outcomes[:, 1], -columns["dy"])
    assert load_rig(out / "pushes_40.rig.yaml").shape == "rect1"
    model = str(tmp_path / "m.pushmodel")
    assert run("train", str(out / "pushes_40.csv"), "--kind", "analytical", "--out", model).status == 0
    assert_one_line(run("import", "mit-square", str(source), "--out", str(out)), "import", ["pushes_40.csv exists"])
    assert "assumed" in run("import", "mit-square", str(source), "--out", str(tmp_path / "other")).out


def test_report_writes_a_page_and_the_metrics(place: Place, run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    drawn: list[str] = []
    monkeypatch.setattr(  # test_report draws them
        "push_predictor.evaluation.report.figures.gallery.draw",
        lambda path, *_: drawn.append(path.name) or path.write_bytes(b""),
    )
    fired = "push_predictor.evaluation.offline.recording_alarm"
    monkeypatch.setattr(fired, lambda model, *_: {"fired": model.name == "hetero"})  # the main model
    models = [place.path("vhgp.pushmodel"), place.path("analytical.pushmodel")]
    call = ["report", "validation", *models, "--recording", place.path("test.mcap"), "--out", str(tmp_path)]
    found = run(*call, "--json", "-").json
    page = Path(found["report"]).read_text()
    assert page.startswith("<!") and '<span class="verdict">no longer fits</span>' in page
    assert {"map_mean.png", "calibration.png", "residuals.png"} <= {*drawn}
    assert [metrics["model"] for metrics in found["models"]] == ["hetero", "analytical"]
    assert json.loads((tmp_path / "validation.json").read_text()) == found["models"]
    for metrics in found["models"]:
        assert_metrics_format(metrics)


@pytest.mark.parametrize("missing", ["push_predictor_paper", "push_predictor_paper.report"])
def test_report_paper_without_its_package_names_the_command_that_installs_it(
    missing: str, run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for name in [name for name in sys.modules if name.partition(".")[0] == "push_predictor_paper"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, missing, None)
    outcome = run("report", "paper", "--quick", "--out", str(tmp_path / "paper"))
    assert_one_line(outcome, "report", ["push_predictor_paper", "pip install ./push_predictor_paper"])


# --- what goes wrong -------------------------------------------------------------------------------------------------

SIMULATE = ["simulate", "--shape", "rect1", "--surface", "abs", "--pushes", "1", "--speed", "0.02", "--out", "{tmp}/x"]
NEXT = ["--out", "{tmp}/next.csv"]
TRAIN = ["train", "{train}", "--kind", "gp", "--out", "{tmp}/m.pushmodel"]


def changed(call: list[str], option: str, value: str) -> list[str]:
    return [*call[: call.index(option) + 1], value, *call[call.index(option) + 2 :]]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (changed(SIMULATE, "--shape", "blob"), ["shape", "'blob'", "rect1"]),  # of the library, as the next
        (["predict", "{tmp}/absent", *PUSH], ["{tmp}/absent", "cannot be read"]),
        (["predict", "{gp}", *changed(PUSH, "--contact", "1.5")], ["contact", "1.5", "[0, 1)"]),
        (["import", "mit", "{junk}.mcap", "--out", "{tmp}/o"], ["junk.mcap"]),
        ([*TRAIN, "--n-train", "100000"], ["n_train", "100000"]),
        ([*TRAIN, "--rig", "{tmp}/absent.yaml"], ["absent.yaml"]),
        (changed(SIMULATE, "--pushes", "0"), ["--pushes", "0"]),
        ([*SIMULATE, "--seed", "-1"], ["--seed", "-1"]),
        (changed(SIMULATE, "--out", "{file}/x"), ["{file}"]),
        (changed(TRAIN, "train", "{tmp}/absent"), ["{tmp}/absent", "no such file"]),
        (changed(TRAIN, "train", "{gp}"), ["{gp}", "push table"]),
        (changed([*TRAIN, "--mean", "zero"], "--kind", "analytical"), ["--kind", "--mean"]),
        ([*TRAIN, "--stride", "-0.1"], ["--stride", "-0.1"]),
        (changed(TRAIN, "--out", "{tmp}"), ["{tmp}"]),
        (["predict", "{gp}", *PUSH, "--covariate", "humid"], ["--covariate", "'humid'", "NAME=VALUE"]),
        (["predict", "{gp}", *PUSH, "--json", "{tmp}"], ["{tmp}"]),
        (["predict", "{gp}", *PUSH, "--interval", "conformal"], ["--interval: 'conformal'", "gp has 6"]),
        (["predict", "{analytical}", *PUSH, "--interval", "conformal"], ["--interval", "analytical has 0"]),
        (["validate", "{gp}", "{tmp}/test.csv"], ["RECORDING", "{tmp}/test.csv", "push_predictor evaluate"]),
        (["report", "validation", "{gp}", "--out", "{tmp}/r"], ["--recording", "both"]),
        (["info", "{tmp}/absent"], ["{tmp}/absent"]),
        (["suggest", "{gp}", "--count", "0", *NEXT], ["count: 0"]),
        (["suggest", "{gp}", "--speed-range", "0.05", "0.02", *NEXT], ["speed: (0.05, 0.02)"]),
        (["suggest", "{gp}", "--matter", "nowhere.csv", *NEXT], ["nowhere.csv: no such file"]),
        (["suggest", "{gp}", "--covariate", "warmth", *NEXT], ["--covariate: 'warmth'"]),
        (["suggest", "{gp}", "--seed", "-1", *NEXT], ["--seed: -1"]),
        (["trace", "{gp}", "absent.csv"], ["absent.csv: no such file or folder"]),
        (["trace", "{gp}", "{csv}", "--alpha", "0"], ["--alpha", "0.0", "above 0 and below 1"]),
        (["trace", "{gp}", "{csv}", "--alpha", "nan"], ["--alpha", "nan"]),
        (["trace", "{gp}", "{csv}", "--seed", "-1"], ["--seed"]),
        (["trace", "{gp}", "{csv}", "--covariates", "elapsed_time,,x"], ["--covariates", "commas"]),
        *(
            (["trace", "{gp}", "{csv}", option, "{tmp}"], [f"{option}: '", "a file: this is a folder"])
            for option in ("--report", "--json", "--save-model")
        ),
        (["trace", "{gp}", "{csv}", "--report", "{file}/below"], ["--report", "a path inside a folder: "]),
    ],
)
def test_failure_is_one_line_that_names_the_file_or_field(
    call: list[str], words: list[str], place: Place, run, tmp_path: Path
):
    (tmp_path / "junk.mcap").write_bytes(b"\x00\x01 neither this nor that \xff\n" * 5)
    (tmp_path / "file").write_text("")
    names = {
        "tmp": str(tmp_path / "tmp"),
        "file": str(tmp_path / "file"),
        "junk": str(tmp_path / "junk"),
        "train": place.path("train"),
        "csv": place.path("test.csv"),
        "gp": place.path("gp.pushmodel"),
        "analytical": place.path("analytical.pushmodel"),
    }
    (tmp_path / "tmp").mkdir()
    filled = [word.format(**names) for word in call]
    assert_one_line(run(*filled), call[0], [word.format(**names) for word in words])
    left = [path.name for path in (tmp_path / "tmp").rglob("*") if path.name.startswith(".")]
    assert not left, "nothing half done stays behind"


def without_progress(*texts: str) -> list[str]:
    """The lines on stderr without progress messages, which appear on a slow machine."""
    return [line for text in texts for line in text.splitlines() if not re.match(r"[\w -]+: \d+ s(,|$)", line)]


def test_closed_pipe_is_not_an_error(place: Place):
    command = f"'{sys.executable}' -m push_predictor.cli info '{place.path('train')}' | head -c 1"
    done = subprocess.run(["bash", "-o", "pipefail", "-c", command], cwd=REPOSITORY, capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (["train", "--kind", "gp"], "DATA (only --kind prior needs none)"),
        (["suggest"], "give either MODEL or --rig FILE.yaml"),
    ],
)
def test_options_that_do_not_belong_together_are_a_wrong_call_whatever_their_values(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], call: list[str], words: str
) -> None:
    (tmp_path / "old").write_text("")
    with pytest.raises(SystemExit) as ended:
        main([*call, "--out", str(tmp_path / "old")])
    assert ended.value.code == 2 and words in capsys.readouterr().err
