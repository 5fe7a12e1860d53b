"""What the documents and the files in config/ say is what the code declares."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from ros_harness import REPOSITORY

from push_predictor.cli import COMMANDS, build_parser
from push_predictor.nodes.parameters import Param
from push_predictor.nodes.replay import parameters as replay_parameters
from push_predictor.nodes.server import parameters as server_parameters
from push_predictor.nodes.validator import parameters as validator_parameters
from push_predictor.nodes.validator.scalar_subscriber import CLOCK
from push_predictor.nodes.validator.sensor_subscriber import TOPICS
from push_predictor.online.live_validation import MAIN_RESULT

NODES: dict[str, tuple[str, tuple[Param, ...]]] = {
    "predict_server": ("push_predictor", tuple(server_parameters.PARAMETERS)),
    "push_replay": ("push_replay", tuple(replay_parameters.PARAMETERS)),
    "push_validator": ("push_validator", tuple(validator_parameters.PARAMETERS)),
}
REFERENCE = REPOSITORY / "docs" / "reference"
DOCUMENTS = [REPOSITORY / "README.md", REPOSITORY / "bags" / "README.md", *sorted((REPOSITORY / "docs").rglob("*.md"))]
SERVICES = ("predict_push", "predict_push_batch", "predict_slider_pose", "rollout_pushes", "list_models", "load_model")


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
def test_every_parameter_has_a_description_and_accepts_its_default(node: str):
    for row in NODES[node][1]:
        assert row.description and row.allows(row.default), row.name


def test_the_table_of_the_validators_parameters_is_that_of_the_code():
    rows = table(REFERENCE / "push_validator.md", "Parameters")
    written = {name.strip("`"): (yaml.safe_load(value.strip("`")), text) for name, value, text in rows}
    assert written == {row.name: (row.default, row.description) for row in validator_parameters.PARAMETERS}


# --- topics and services ---------------------------------------------------------------------------------------------


def test_the_table_of_the_validators_topics_names_what_it_uses():
    nodes = REPOSITORY / "push_predictor" / "nodes"
    modules = [nodes / "push_validator.py", *sorted((nodes / "validator").rglob("*.py"))]
    code = "".join(path.read_text() for path in modules)
    calls = r"create_(?:subscription|publisher|client|service)\(\s*\w+, \"([^\"]+)\""
    used = {*re.findall(calls, code), *(topic for _, _, topic, _ in TOPICS), CLOCK}
    rows = table(REFERENCE / "push_validator.md", "Topics and services")
    assert {name for row in rows for name in re.findall(r"`([^`]+)`", row[0])} == used


@pytest.mark.parametrize("service", SERVICES)
def test_every_service_of_the_server_has_a_chapter(service: str):
    assert re.search(rf"^## `{service}` \(\w+\)$", (REFERENCE / "predict_server.md").read_text(), re.MULTILINE)


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


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(REPOSITORY).as_posix())
def test_every_link_to_a_file_leads_somewhere(document: Path):
    for target in re.findall(r"\]\(([^)#\s]+)", document.read_text()):
        if not target.startswith(("http://", "https://")):
            assert (document.parent / target).exists(), target


def test_the_names_in_the_documented_files_are_those_that_are_written():
    names = " ".join(row[0] for row in table(REFERENCE / "push_validator.md", "What is written"))
    for name in (MAIN_RESULT, "windows.json", "residuals/", "report.html"):
        assert f"`{name}`" in names
