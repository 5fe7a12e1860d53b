# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Every Python and shell block of README, tutorial and how-tos runs, page by page, and prints what the page shows.

A fence `text` shows lines that the block before it prints to stdout. `...` stands for anything; numbers agree within
TOLERANCE. A fence `py` shows lines of a file that the reader changes: it is not run.
"""

from __future__ import annotations

import importlib
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import ros_harness as harness
import yaml
from lab_bags import laboratory, short_recording, write_db3
from repository import BAGS, REPOSITORY

from examples import demo
from examples.hidden import make_hidden
from examples.square import TRAINING, WINDOW
from push_predictor.cli import main
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import train_model
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.resources import model_path

pytestmark = pytest.mark.slow
PAGES = [
    REPOSITORY / "README.md",
    REPOSITORY / "docs" / "tutorial.md",
    *sorted((REPOSITORY / "docs" / "how_to").glob("*.md")),
]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$|((?:^ {4,}\S[^\n]*\n)+)", re.MULTILINE | re.DOTALL)
NUMBER = r"[-−]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"
TOLERANCE = 0.05  # relative: libraries of linear algebra differ, and a search for hyperparameters enlarges that
NOT_HERE = (  # commands for another machine, with ROS's own tools, of minutes, or that test/examples or test/nodes run
    *("make ", "pip ", "sudo ", "rosdep ", "colcon ", ". ", "[ ", "export ", "POLICY=", "for ", "done", "rviz2 "),
    *("ros2 run ", "ros2 launch ", "ros2 topic ", "ros2 security "),
    *("push_predictor record ", "push_predictor report paper ", "python -m examples.p", "python -m examples.mpc"),
)
LAB_TOPICS = ("--slider-topic", "/vicon/block/block", "--pusher-topic", "/tf:tool0", "--wrench-topic", "/netft")


def monday() -> None:
    write_db3(laboratory(short_recording(52.0)), Path("monday"))


def tuesday() -> None:
    laboratory(short_recording(52.0, after=75.0)).mcap(Path("tuesday"))


def topics() -> None:
    """As `push_predictor record` leaves them next to its bags."""
    for bag in filter(Path.exists, (Path("monday"), Path("tuesday"))):
        assert main(["info", str(bag), *LAB_TOPICS, "--save-topics"]) == 0


def rig() -> None:
    words = "rig --square 0.09 --tip-radius 0.00475 --surface abs --mass 0.84 --out rig.yaml"
    assert main(words.split()) == 0


def shipped() -> None:
    shutil.copy(model_path("default"), "monday.pushmodel")


def changed() -> None:
    make_hidden(Path("out/demo"), demo.SEED)


def small_windows() -> None:
    """As examples.mpc trains it, but mechanics alone: in a second."""
    slider, path = load_rig_for([TRAINING]), Path("out/mpc/square.pushmodel")
    path.parent.mkdir(parents=True)
    table = load_data([TRAINING], slider, WindowOptions(duration=WINDOW))
    save_model(train_model(table, slider, "analytical", name="square"), path)


NEEDED: dict[str, tuple[Callable[[], None], ...]] = {  # what the reader of a page has
    "README": (monday, tuesday),
    "your_own_data": (monday, tuesday, topics),
    "before_the_first_push": (monday, topics, rig),
    "live_devices": (rig, shipped),
    "trace": (changed,),
    "learn_to_push": (small_windows,),
}


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    """Language and text of each block; indented ones are of the shell."""
    for language, fenced, indented in BLOCK.findall(page.read_text().replace("\\\n", " ")):
        yield language or "sh", fenced or indented


def called(domain: int, name: str, kind: str, fields: str = "{}") -> None:
    """`ros2 service call`, which is not among the wheels: print the response."""
    package, _, service = kind.split("/")
    srv = getattr(importlib.import_module(f"{package}.srv"), service)
    with harness.ros_context(domain) as node:
        client = node.create_client(srv, name)
        assert client.wait_for_service(60.0), name
        print(f"response:\n{client.call(srv.Request(**yaml.safe_load(fields)))}")


def run_line(line: str, domain: int, nodes: ExitStack) -> None:
    words = shlex.split(line.removesuffix("&"), comments=True)
    if words[0] == "push_predictor":
        assert main(words[1:]) == 0, line
    elif words[0] in ("predict_server", "push_validator"):
        nodes.enter_context(harness.node_process(words[0], *words[2:], domain=domain, folder=Path.cwd()))
    elif words[:3] == ["ros2", "service", "call"]:
        called(domain, *words[3:])
    else:
        assert words[:2] == ["python", "-m"], f"not run, and not in NOT_HERE: {line}"
        environment = harness.node_environment(domain)
        print(subprocess.run([sys.executable, *words[1:]], env=environment, check=True, stdout=-1, text=True).stdout)


def agree(shown: str, printed: str) -> bool:
    """Whether a page shows consecutive lines of what was printed."""
    parts = re.split(rf"({NUMBER}|\.\.\.|\s+)", shown.strip())
    patterns = {"...": r"[\s\S]*?"}
    whole = "".join(
        f"({NUMBER})"
        if re.fullmatch(NUMBER, part)
        else r"\s+"
        if part.isspace()
        else patterns.get(part, re.escape(part))
        for part in parts
    )
    if (found := re.search(f"^\\s*{whole}", printed, re.MULTILINE)) is None:
        return False
    numbers = [float(text.replace("−", "-")) for text in re.findall(NUMBER, shown)]
    return [float(text.replace("−", "-")) for text in found.groups()] == pytest.approx(numbers, rel=TOLERANCE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_blocks_of_a_page_run_and_print_what_it_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bags").symlink_to(BAGS)
    for make in NEEDED.get(page.stem, ()):
        make()
    names: dict[str, object] = {}
    with harness.reserved_domain() as domain, ExitStack() as nodes:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        ran = False
        for language, text in blocks(page):
            if language == "text":
                printed = capsys.readouterr().out
                assert not ran or agree(text, printed), printed
            elif language == "python":
                capsys.readouterr()
                exec(compile(text, page.name, "exec"), names)
                ran = True
            elif language == "sh":
                capsys.readouterr()
                lines = [line.strip() for line in text.splitlines() if not line.strip().startswith(NOT_HERE)]
                for line in lines:
                    run_line(line, domain, nodes)
                ran = bool(lines)


def test_the_tutorial_is_short_and_uses_the_public_interface_only() -> None:
    code = "".join(text for language, text in blocks(REPOSITORY / "docs" / "tutorial.md") if language == "python")
    assert len([line for line in code.splitlines() if line.strip()]) <= 60 and "from push_predictor." not in code


def test_readme_quotes_the_whole_client() -> None:
    code = (REPOSITORY / "examples" / "minimal_client.py").read_text()
    assert code[code.index("import numpy") :] in (REPOSITORY / "README.md").read_text()
