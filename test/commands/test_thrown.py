# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Whatever is thrown at a command ends in one line and a status, not in a traceback or a fault of the program."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

pytest.importorskip("rosbags")
from lab_bags import LABORATORY, Lab, laboratory, short_recording, write_db3
from square_session import ANALYTICAL, RIG, pushes

from push_predictor.cli import TRACEBACK, main
from push_predictor.commands import info_command
from push_predictor.models.store.model_file import save_model
from push_predictor.recordings.bag.message_types import POSE, WRENCH
from push_predictor.recordings.rig import save_rig
from push_predictor.recordings.table_file import write_table
from push_predictor.recordings.write import write_recording

TOPICS = ("/slider/pose", "/pusher/pose", "/pusher/wrench", "/tf", "/tf_static", "/n")
TYPES = (
    POSE.name,
    WRENCH.name,
    "tf2_msgs/msg/TFMessage",
    "std_msgs/msg/Float64",
    "lab_msgs/msg/Bodies",
    "geometry_msgs/msg/Pose",
    "",
    "no type",
)
SCHEMAS = (
    b"",
    POSE.definition.encode(),
    b"lab_msgs/Bodies[] all\nstring name\ngeometry_msgs/Pose pose\nfloat64[16] matrix\n",
    b"string[<=3] a\nwstring b\nfloat64[<=4] c\n",
    b"{}",
    b"module lab_msgs { struct Bodies { double x; }; };",
)
WORDS = (
    *("", " ", "/", ".", ":", "[", "]", "=", ",", "0", "-1", "1e400", "nan", "inf", "\udcff", "none", "tip", "world"),
    *("/tf:", "/tf:tip", "/tf.transforms[0].transform", "/slider/pose.pose", "/slider/pose.all[b].pose", "a[name=]"),
    *("/slider/pose.all[name=block].pose", "/slider/pose.matrix", "/n", "/n.data", "/n.data[0]", "free_motion"),
    *(
        "x=1",
        "a=b=c",
        "y",
        "-z",
        "slider=-y",
        "wrench=x,z",
        "log",
        "/slider/pose.a+b",
        "/slider/pose.position+turn",
        "1" * 400,
        "[" * 50,
        "é",
        "\n",
        "{}",
        "--rig",
    ),
)
OPTIONS = {
    "of data": (
        *("--slider-topic", "--pusher-topic", "--wrench-topic", "--covariate-topic", "--wrench-frame", "--world-frame"),
        *("--wrench-bias", "--stamp", "--up", "--rig", "--strict", "--json"),
    ),
    "train": ("--n-train", "--seed", "--stride", "--name", "--fit", "--inducing", "--mean"),
    "trace": ("--covariates", "--alpha", "--seed"),
    "validate": ("--false-alarm-rate",),
    "predict": ("--duration", "--covariate", "--json"),
    "suggest": ("--travel", "--covariate"),
    "rig": ("--tip-radius", "--mass", "--keep-origin"),
    "simulate": ("--speed", "--travel", "--seed"),
}
NUMBERS = ("0", "1", "0.01", "-0.02", "3", "1e-9", "1e400", "nan")
USUAL = {  # mostly taken from these, or the parser refuses nearly all calls
    "--json": ("-",),
    "--stamp": ("log", "header"),
    "--wrench-bias": ("free_motion", "none"),
    "--up": ("y", "-z", "slider=x", "y,wrench=y", "y,,x"),
    "--mean": ("zero", "mechanics"),
    **dict.fromkeys(("--seed", "--n-train", "--count", "--inducing"), ("0", "1", "-1", "3")),
    **dict.fromkeys(("--stride", "--alpha", "--false-alarm-rate", "--duration", "--speed", "--travel"), NUMBERS),
    **dict.fromkeys(("--velocity", "--angle", "--tip-radius", "--mass"), NUMBERS),
}
READING = ("train", "evaluate", "validate", "trace", "info", "check", "suggest", "rig")
FLAGS = ("--strict", "--fit", "--keep-origin")
SECONDS = 3.0  # of the recording that is damaged


@dataclass(frozen=True)
class Sound:
    """The contents of sound files, by name; of which damaged ones are made."""

    files: dict[str, bytes]

    @staticmethod
    def made(folder: Path) -> Sound:
        recording = short_recording(SECONDS)
        lab: Lab = laboratory(recording)
        write_recording(folder / "a.mcap", recording, compression="none")
        lab.mcap(folder / "b.mcap")
        write_db3(lab, folder / "c")
        save_model(ANALYTICAL, folder / "m.pushmodel")
        write_table(folder / "t.csv", pushes(4, 1))
        save_rig(RIG, folder / "r.yaml")
        (folder / "s.csv").write_text("time,x,y,z,heading\n0.1,0,0,0,0\n0.2,0,0,0,nan\n")
        (folder / "a.recording.yaml").write_text("slider_topic: /slider/pose\nwrench_frame: tip\n")
        return Sound({p.name: p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()})


class Thrower:
    """Makes calls, each from a number: the same number makes the same call."""

    def __init__(self, sound: Sound, folder: Path) -> None:
        self._sound, self._folder = sound, folder

    def call(self, number: int) -> list[str]:
        """The arguments of a call; its files are written."""
        rng = np.random.default_rng(number)
        command = str(rng.choice([*READING, *READING, "predict", "import", "simulate", "report", "record"]))
        of_data = OPTIONS["of data"] if command in READING else ()
        words = self._positional(rng, command)
        if of_data and rng.random() < 0.6:
            (self._folder / "sound.yaml").write_bytes(self._sound.files["r.yaml"])
            words += ["--rig", str(self._folder / "sound.yaml"), *_topics(rng)]
        for option in rng.permutation([*of_data, *OPTIONS.get(command, ())])[: rng.integers(4)].tolist():
            words += [option] if option in FLAGS else [option, self._value(rng, option)]
        if command in ("train", "suggest", "rig", "import", "simulate", "report"):
            words += ["--out", str(self._folder / "out" / str(number))]
        return [command, *words]

    def _positional(self, rng: np.random.Generator, command: str) -> list[str]:
        model, data = self._file(rng, "m.pushmodel"), self._data(rng)
        of = {
            "train": [data, "--kind", "analytical"],
            "info": [model if rng.random() < 0.3 else data],
            "check": [data],
            "suggest": [model, "--count", "1", *(["--matter", data] if rng.random() < 0.5 else [])],
            "rig": ["--from", data] if rng.random() < 0.7 else [],
            "report": ["validation", model, "--recording", data],
            # The output exists, so that no recorder starts.
            "record": ["--out", str(self._folder), *self._valued(rng, "--duration", "--up", "--wrench-bias")],
            "predict": [model, *self._valued(rng, "--velocity", "--angle"), "--contact", "0.1"],
            "import": [str(rng.choice(["mit", "mit-square", "mlab", "mcube", "rosbag1"])), data],
            "simulate": ["--shape", "rect1", "--surface", "abs", "--pushes", "0", *self._valued(rng, "--speed")],
        }
        return of.get(command, [model, data])

    def _valued(self, rng: np.random.Generator, *options: str) -> list[str]:
        return [word for option in options for word in (option, self._value(rng, option))]

    def _value(self, rng: np.random.Generator, option: str) -> str:
        if option == "--rig":
            return self._file(rng, "r.yaml")
        if option in USUAL and rng.random() < 0.8:
            return str(rng.choice(USUAL[option]))
        return _word(rng)

    def _data(self, rng: np.random.Generator) -> str:
        kind = rng.integers(5)
        if kind == 0:
            return self._folder_of(rng)
        if kind == 1:
            return self._written(rng, "x.mcap", foreign(rng))
        return self._file(rng, str(rng.choice(["a.mcap", "b.mcap", "c.db3", "c.db3", "c.db3", "t.csv", "s.csv"])))

    def _folder_of(self, rng: np.random.Generator) -> str:
        folder = self._folder / f"folder{rng.integers(1_000_000)}"
        folder.mkdir(exist_ok=True)
        kept = rng.choice(["metadata.yaml", "c.db3", "a.mcap", "slider.csv", "pusher.csv", "wrench.csv"], 3)
        for name in kept.tolist():
            content = self._sound.files["s.csv" if name.endswith("csv") else name]
            (folder / name).write_bytes(damaged(rng, content))
        return str(folder)

    def _file(self, rng: np.random.Generator, name: str) -> str:
        if name.endswith(".mcap") and rng.random() < 0.2:
            topics = damaged(rng, self._sound.files["a.recording.yaml"])
            (self._folder / f"{name.partition('.')[0]}.recording.yaml").write_bytes(topics)
        content = self._sound.files[name]
        return self._written(rng, name, content if rng.random() < 0.4 else damaged(rng, content))

    def _written(self, rng: np.random.Generator, name: str, content: bytes) -> str:
        path = self._folder / name
        path.write_bytes(content)
        return str(path)


def _word(rng: np.random.Generator) -> str:
    return WORDS[rng.integers(len(WORDS))]


def _topics(rng: np.random.Generator) -> list[str]:
    """Options that name topics, mostly those that are there."""
    given = {f"--{name}-topic": getattr(LABORATORY, name) for name in ("slider", "pusher", "wrench")}
    for option in rng.permutation([*given])[: rng.integers(3)].tolist():
        given[option] = str(rng.choice([*TOPICS, *TOPICS, *WORDS]))
    return [word for option in given.items() for word in option]


def damaged(rng: np.random.Generator, content: bytes) -> bytes:
    """The content with a few bytes changed, a part removed, or nothing but random bytes."""
    data, kind = bytearray(content), rng.integers(5)
    if kind == 0:
        return data[: rng.integers(len(data) + 1)]
    if kind == 1:
        return rng.bytes(int(rng.integers(300)))
    if kind == 2:
        start = int(rng.integers(len(data) + 1))
        del data[start : start + int(rng.integers(100))]
        return bytes(data)
    for place in rng.integers(len(data), size=int(rng.integers(1, 30))).tolist() if data else []:
        data[place] = int(rng.integers(256))
    return bytes(data)


def foreign(rng: np.random.Generator) -> bytes:
    """An MCAP file of topics with any type, any definition or none, and messages of random bytes."""
    buffer = io.BytesIO()
    writer = Writer(buffer, compression=CompressionType.NONE)
    writer.start(profile="ros2", library="")
    for topic in (*TOPICS, LABORATORY.slider):
        kind, text = TYPES[rng.integers(len(TYPES))], SCHEMAS[rng.integers(len(SCHEMAS))]
        schema = writer.register_schema(kind, "ros2msg", text) if kind else 0
        channel = writer.register_channel(topic, str(rng.choice(["cdr", "cdr", "cdr", "json"])), schema)
        for time in range(int(rng.integers(6))):
            size = int(rng.integers(120))
            data = b"\0\1\0\0" + (rng.bytes(size) if rng.random() < 0.5 else bytes(rng.integers(3, size=size).tolist()))
            writer.add_message(channel, time, data, time)
    writer.finish()
    return buffer.getvalue()


GROUPS, CALLS = 4, 75  # of one number each; twenty times as many found one fault
FAULT = "This is a fault of the program"


@pytest.fixture(scope="module")
def thrower(tmp_path_factory: pytest.TempPathFactory) -> Thrower:
    folder = tmp_path_factory.mktemp("thrown")
    for name in ("sound", "files", "files/out"):
        (folder / name).mkdir()
    return Thrower(Sound.made(folder / "sound"), folder / "files")


def status_of(call: list[str]) -> object:
    try:
        return main(call)
    except SystemExit as end:  # of argparse
        return end.code


@pytest.mark.parametrize("group", range(GROUPS))
def test_a_call_of_random_files_and_options_ends_in_one_line(
    thrower: Thrower, group: int, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # some options name a file
    for number in range(group * CALLS, (group + 1) * CALLS):
        call = thrower.call(number)
        status, err = status_of(call), capsys.readouterr().err
        assert status in (0, 1, 2) and "Traceback" not in err and FAULT not in err, (number, call, err)
        own = re.findall(rf"^push_predictor {call[0]}: .+$", err, re.MULTILINE)
        assert status != 1 or len(own) == 1, (number, call, err)


def test_an_unforeseen_failure_is_one_line_that_says_how_to_see_more(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(path: Path) -> dict[str, object]:
        raise KeyError(f"of\nthe program in {path.name}")

    (tmp_path / "a.pushmodel").write_bytes(b"")
    call = ["info", str(tmp_path / "a.pushmodel")]
    monkeypatch.delenv(TRACEBACK, raising=False)
    with patch.object(info_command, "_describe_model", failing):
        assert main(call) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert re.fullmatch(
            r"push_predictor info: KeyError: .*of.nthe program in a\.pushmodel.* \(test_thrown\.py line \d+\)\. "
            rf"{FAULT}, not of the call\. PUSH_PREDICTOR_TRACEBACK=1 shows the traceback; please report it\.",
            line,
        )
        monkeypatch.setenv(TRACEBACK, "1")
        assert main(call) == 1
        *before, last = capsys.readouterr().err.splitlines()
        assert before[0].startswith("Traceback") and last == line
