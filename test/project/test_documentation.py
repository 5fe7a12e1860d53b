# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the documents and the files in config/ say is what the code declares, found within two links, and runs."""

from __future__ import annotations

import ast
import dataclasses
import importlib.util
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from repository import BAGS, REPOSITORY

import push_predictor
from push_predictor.cli import COMMANDS, build_parser
from push_predictor.geometry.shapes import SHAPES, shape_outline
from push_predictor.nodes import parameter_tables
from push_predictor.nodes.parameters import Param
from push_predictor.recordings.rig import Rig, load_rig

NODES: dict[str, tuple[str, tuple[Param, ...]]] = {
    "predict_server": ("push_predictor", parameter_tables.PREDICT_SERVER),
    "push_recorder": ("push_recorder", parameter_tables.PUSH_RECORDER),
    "push_replay": ("push_replay", parameter_tables.PUSH_REPLAY),
    "push_validator": ("push_validator", parameter_tables.PUSH_VALIDATOR),
}
DOCS = REPOSITORY / "docs"
REFERENCE = DOCS / "reference"
DOCUMENTS = [
    *(REPOSITORY / name for name in ("README.md", "CONTRIBUTING.md", "bags/README.md")),
    *sorted(DOCS.rglob("*.md")),
    *sorted((REPOSITORY / "benchmarks").glob("*/RESULTS.md")),
]
PYTHON_FILES = [
    path.relative_to(REPOSITORY).as_posix()
    for room in ("push_predictor", "push_predictor_paper", "msg_adapters", "benchmarks", "examples", "test", "docs")
    for path in (REPOSITORY / room).rglob("*.py")
]
NOT_THERE_YET = {  # what the reader is asked to write
    "push_predictor/recordings/importers/NAME.py"
}


def config(node: str) -> dict[str, Any]:
    """{parameter: value} of config/NODE.yaml, nested keys joined by dots."""
    content = yaml.safe_load((REPOSITORY / "config" / f"{node}.yaml").read_text())
    return dict(flat(content[f"/**/{NODES[node][0]}"]["ros__parameters"]))


def flat(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def table(document: Path, heading: str) -> list[list[str]]:
    """The cells of the first table under a heading, without its head."""
    section = document.read_text().split(f"\n## {heading}\n", 1)[1].split("\n## ", 1)[0]
    rows = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows[2:]]


# --- parameters ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("node", NODES)
def test_the_configuration_file_holds_every_parameter_with_its_default(node: str):
    assert config(node) == {row.name: row.default for row in NODES[node][1]}


@pytest.mark.parametrize("node", NODES)
def test_the_configuration_file_describes_every_parameter_and_the_reference_page_shows_it(node: str):
    name = f"config/{node}.yaml"
    lines = re.findall(r"^ {4,6}(\w+): .*?  # (.+)$", (REPOSITORY / name).read_text(), re.MULTILINE)
    assert lines == [(row.name.rpartition(".")[2], described(row)) for row in NODES[node][1]]
    assert f'--8<-- "{name}"' in section(REFERENCE / f"{node}.md", "Parameters")


def described(row: Param) -> str:
    """The comment of a parameter: its description, and what is accepted."""
    text = row.description.rstrip(".") + "."
    if row.choices:
        return f"{text} Accepted: {', '.join(row.choices[:-1])} or {row.choices[-1]}."
    return f"{text} Accepted: {row.low:g} to {row.high:g}." if row.low is not None else text


# --- commands and links ----------------------------------------------------------------------------------------------


def commands_in(document: Path) -> Iterator[list[str]]:
    """The words of every call of push_predictor in an indented block or a fence."""
    text = document.read_text().replace("\\\n", " ")
    for line in re.findall(r"^(?: {4}|push_predictor )(?:.*)$", text, re.MULTILINE):
        if match := re.match(r"\s*push_predictor ([a-z]\w*.*?)(?:\s+#.*|\s+\|.*|\s*&)?$", line):
            yield match[1].split()


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(REPOSITORY).as_posix())
def test_every_call_in_a_document_is_one_that_the_parser_takes(document: Path):
    for words in commands_in(document):
        if words[0] in COMMANDS:
            build_parser().parse_args([word.strip("'\"") for word in words])


def test_the_examples_in_the_help_are_taken_too(capsys: pytest.CaptureFixture[str]):
    for name in COMMANDS:
        with pytest.raises(SystemExit):
            build_parser().parse_args([name, "--help"])
        example = capsys.readouterr().out.split("example:\n", 1)[1].strip()
        assert example.startswith(f"push_predictor {name} ")
        build_parser().parse_args(example.split()[1:])


# --- reference pages -------------------------------------------------------------------------------------------------


def section(document: Path, heading: str) -> str:
    return document.read_text().split(f"\n## {heading}\n", 1)[1].split("\n## ", 1)[0]


def test_the_python_page_shows_every_public_name():
    shown = re.findall(r"^::: push_predictor\.(\w+)$", (REFERENCE / "python_api.md").read_text(), re.MULTILINE)
    assert sorted(shown) == sorted(name for name in push_predictor.__all__ if not name.startswith("__"))


def test_the_messages_page_names_every_interface():
    page = (REFERENCE / "messages.md").read_text()
    for path in sorted((REPOSITORY / "push_predictor_interfaces").glob("*/*")):
        if path.suffix in (".msg", ".srv", ".action"):
            assert f"{path.stem}`" in page, path.name


def test_the_json_page_names_every_field_of_a_trace():
    source = (REPOSITORY / "push_predictor" / "residuals" / "outcome.py").read_text()
    page = (REFERENCE / "json.md").read_text()
    fields = re.findall(r'^ {8}"(\w+)":', source, re.MULTILINE)
    assert len(fields) > 20
    for field in fields:
        assert f'"{field}"' in page, field


def test_the_push_page_gives_the_size_of_every_standard_outline():
    rows = {row[0].strip("`"): row[1] for row in table(REFERENCE / "push.md", "Standard outlines")}
    assert set(rows) == set(SHAPES)
    for name, text in rows.items():
        extent = 2.0 * np.abs(shape_outline(name).vertices).max(axis=0)
        sizes = [float(size) for size in re.findall(r"\d+\.\d+", text)]
        assert sizes[0] == pytest.approx(extent[0] / 2.0 if name == "hex" else extent[0], rel=1e-3), name


OF_VARIABLES = {  # prefix and pattern of names that stand elsewhere in the module
    "geometry.py: name": ("", r'(?:^ +(?="\w+": Mirror)|_falling\()"(\w+)"'),
    "units.py: name": ("", r'_finding\("(\w+)"'),
    "units.py: f'units_{name.split()[0]}'": ("units_", r'_column\("(\w+)'),
}


def names_of_findings() -> Iterator[str]:
    """The name of every finding in the code; NAME stands for a stream."""
    for path in sorted((REPOSITORY / "push_predictor" / "recordings" / "checks").rglob("*.py")):
        code = path.read_text()
        for call in ast.walk(ast.parse(code)):
            if isinstance(call, ast.Call) and ast.unparse(call.func) == "Finding":
                name = ast.unparse(call.args[0])
                if plain := re.fullmatch(r"f?'(\w+?)(\{name\})?'", name):
                    yield plain[1] + ("NAME" if plain[2] else "")
                else:
                    prefix, pattern = OF_VARIABLES[f"{path.name}: {name}"]
                    yield from (prefix + each for each in re.findall(pattern, code, re.MULTILINE))


def test_the_page_of_findings_has_one_row_for_each_that_the_code_reports():
    rows = re.findall(r"^\| (`.+?) \|", (REFERENCE / "check.md").read_text(), re.MULTILINE)
    documented = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    assert len(documented) > 70
    assert sorted(documented) == sorted(set(names_of_findings()))


def test_the_example_rig_has_every_key_and_loads():
    keys = yaml.safe_load((REFERENCE / "rig.yaml").read_text())
    fields = {field.name for field in dataclasses.fields(Rig)}
    assert set(keys) == fields | {"shape_parameters"}
    rig = load_rig(REFERENCE / "rig.yaml")
    assert rig.support_points is not None and rig.support_points[:, 2].sum() == pytest.approx(1.0)
    np.testing.assert_allclose(rig.outline.centroid, 0.0, atol=1e-9)


# --- what the documents cite -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(REPOSITORY).as_posix())
def test_what_a_document_links_shows_or_cites_exists(document: Path):
    text = document.read_text()
    for target in re.findall(r"\]\(([^)#\s]+)", text):
        assert target.startswith(("http://", "https://")) or (document.parent / target).exists(), target
    for name, part in re.findall(r"^--8<-- \"([^\":]+)(?::(\w+))?\"$", text, re.MULTILINE):
        shown = (REPOSITORY / name).read_text()
        assert not part or (f"[start:{part}]" in shown and f"[end:{part}]" in shown)
    for module in re.findall(r"python -m ((?:benchmarks|examples)[\w.]*)", text):
        assert importlib.util.find_spec(module.rstrip(".")), module
    for path in re.findall(r"`((?:test|benchmarks|examples|config|docs)/[\w/.]+\.(?:py|yaml|xml|json|rviz|md))`", text):
        assert (REPOSITORY / path).is_file(), path
    for module in set(re.findall(r"`([\w/]+\.py)`", text)) - NOT_THERE_YET:
        assert [path for path in PYTHON_FILES if f"/{path}".endswith(f"/{module}")], module
    assert not re.findall(r"\b(?!pushes_)\w+\.(?:model|npz)\b", text), "model files have one suffix"


def test_code_cites_documents_that_exist():
    for room in ("push_predictor", "msg_adapters", "push_predictor_paper", "benchmarks", "examples", "launch", "test"):
        for path in (REPOSITORY / room).rglob("*.py"):
            if "build" in path.relative_to(REPOSITORY).parts:  # what pip left of an earlier state
                continue
            for cited in re.findall(r"docs/[\w/]+\.md", path.read_text()):
                assert (REPOSITORY / cited).is_file(), f"{path}: {cited}"


# --- questions --------------------------------------------------------------------------------------------------------


STARTS = (REPOSITORY / "README.md", REPOSITORY / "docs" / "index.md")
PLANNER = {
    "How do I ask for one push from a shell?": "README.md#call-it-from-a-planner",
    "What are velocity, contact and angle, and in which frame is the outcome?": "docs/reference/push.md#inputs",
    "How do I ask for many pushes at once?": "docs/reference/predict_server.md#predict_push_batch-predictpushbatch",
    "How uncertain is a sequence of pushes?": "docs/explanation/rollouts.md#what-persists-within-a-push",
    "What is the slider's pose afterwards?": "docs/reference/predict_server.md#predict_slider_pose-predictsliderpose",
    "Why was my request refused?": "docs/reference/predict_server.md#refusals",
    "What can my client do about an error code?": "docs/reference/messages.md#error-codes",
    "How do I plan around obstacles?": "docs/how_to/planner.md#plan-around-obstacles",
    "How long does an answer take?": "docs/results/latency_and_robustness.md#single-calls",
    "Do the intervals cover new pushes?": "docs/results/accuracy.md#intervals-and-correlations",
}
LABORATORY = {
    "What do I measure of my rig?": "docs/how_to/your_own_data.md#measure-the-rig",
    "How do I record my topics, and what does the line say?": "docs/how_to/your_own_data.md#record",
    "Which message types and tf frames can be read?": "docs/reference/recordings.md#topics-and-types",
    "My force sensor turns with the tip. What now?": "docs/reference/recordings.md#axes-of-the-wrench",
    "What does a finding of check mean?": "docs/reference/check.md#streams",
    "Does the model fit my pushes?": "docs/reference/command_line.md#validate",
    "How do I validate while the robot works?": "docs/how_to/live_devices.md#start-the-nodes",
    "What remains when the recorder is killed?": "docs/how_to/your_own_data.md#what-remains-after-a-crash",
    "What does the verdict of a trace mean?": "docs/reference/trace.md#verdicts",
    "What could not be tested?": "docs/explanation/unproven.md#how-to-find-out",
}


def slug(heading: str) -> str:
    """The anchor that the site gives a heading."""
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading).strip().lower())


def without_code(page: Path) -> str:
    return re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    return {slug(heading) for heading in re.findall(r"^#+ (.+)$", without_code(page), re.MULTILINE)}


def linked(page: Path) -> set[Path]:
    targets = re.findall(r"\]\(([^)#\s]+\.md)", without_code(page))
    return {(page.parent / target).resolve() for target in targets if "://" not in target}


def reached() -> set[Path]:
    """The pages that are two links from the start at most."""
    first = {page for start in STARTS for page in linked(start)}
    return {*STARTS, *first, *(page for one in first for page in linked(one))}


def test_the_page_that_answers_a_question_exists_and_is_two_links_away() -> None:
    near = reached()
    for place in (*PLANNER.values(), *LABORATORY.values()):
        name, anchor = place.split("#")
        assert anchor in anchors(REPOSITORY / name) and REPOSITORY / name in near, place


@pytest.mark.parametrize("page", sorted((REPOSITORY / "docs").rglob("*.md")), ids=lambda page: page.name)
def test_every_link_to_a_section_of_a_page_finds_it(page: Path) -> None:
    for target, anchor in re.findall(r"\]\(([^)#\s:]*)#([^)\s]+)\)", without_code(page)):
        assert anchor in anchors((page.parent / target).resolve() if target else page), f"{target}#{anchor}"


# --- tutorial ---------------------------------------------------------------------------------------------------------


PAGE = REPOSITORY / "docs" / "tutorial.md"
MOST_LINES = 60


def code() -> str:
    """All Python blocks of the page, in order."""
    return "\n".join(re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL))


@pytest.mark.long
def test_the_code_runs_from_a_bag_to_a_choice(tmp_path: Path):
    (tmp_path / "bags").symlink_to(BAGS)
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    done = subprocess.run(
        [sys.executable, "-c", code()], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0 and "Warning" not in done.stderr, done.stderr
    for part in ("trained on 300 windows", "(3, 3) (3, 3) (3, 3, 3)", "603 windows of 120 pushes", "Choice: contact"):
        assert part in done.stdout, part
    assert done.stdout.rstrip().endswith("square_abs_train")
    assert (tmp_path / "rotation.png").stat().st_size > 10_000


def test_the_code_is_short_and_uses_the_public_interface_only():
    lines = [line for line in code().splitlines() if line.strip()]
    assert len(lines) <= MOST_LINES
    assert not re.findall(r"from push_predictor\.", code())
