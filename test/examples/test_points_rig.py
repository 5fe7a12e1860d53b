# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The independent simulator: reproducible bags, plausible forces, an honest truth."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from benchmarks.points_rig.outlines import rectangle
from benchmarks.points_rig.pairs import make_pair, write_pair
from benchmarks.points_rig.rigs import GRAVITY, Rig, draw_rig
from benchmarks.points_rig.sensors import Streams
from benchmarks.points_rig.sessions import Session, plan_session
from benchmarks.points_rig.simulation import STEP, Tracks, draw_noise, simulate
from benchmarks.support.bags import Samples, write_bag
from benchmarks.support.making import add_make, truth_file
from benchmarks.support.plane import dot, quarter_turn, rotate, wrapped
from push_predictor import read_recording

TRUTH_KEYS = {
    "number", "group", "seed", "engine", "shape", "surface", "friction", "pushes", "kind", "channel", "names",
    "covariates", "form", "size", "value", "unit", "place", "second", "clean_ratio",
}  # fmt: skip


@pytest.fixture(scope="module")
def rig() -> Rig:
    """A square with even pressure and no noise."""
    line = np.linspace(-0.04, 0.04, 6)
    supports = np.array([[x, y] for x in line for y in line])
    square = rectangle("square", 0.09, 0.09)
    drawn = draw_rig(np.random.default_rng(0))
    return replace(drawn, outline=square, supports=supports, loads=np.full(36, 1 / 36), noise=0.0, chain=1, mass=1.0)


@pytest.fixture(scope="module")
def session(rig: Rig) -> Session:
    """Twenty pushes, the first four through the centre of each side."""
    plan = plan_session(np.random.default_rng(1), rig, 20)
    contact, angle = plan.contact.copy(), plan.angle.copy()
    contact[:4], angle[:4] = np.arange(4) / 4 + 1 / 8, 0.0
    return replace(plan, contact=contact, angle=angle, travel=np.full(20, 0.02))


@pytest.fixture(scope="module")
def tracks(rig: Rig, session: Session) -> Tracks:
    """The pushes, simulated without noise."""
    noise = draw_noise(np.random.default_rng(2), rig, session)
    return simulate(rig, session, replace(noise, surface=0 * noise.surface))


def test_a_push_through_the_centre_moves_an_even_slider_straight(rig: Rig, session: Session, tracks: Tracks) -> None:
    moved = (tracks.pose[-1] - tracks.pose[0])[:4]
    straight = rotate(moved[:, :2], -tracks.heading[:4])
    np.testing.assert_allclose(straight[:, 0], session.travel[:4], atol=1e-9)
    np.testing.assert_allclose(straight[:, 1], 0.0, atol=1e-9)
    np.testing.assert_allclose(moved[:, 2], 0.0, atol=1e-9)
    force = np.linalg.norm(tracks.force[60, :4], axis=1)
    np.testing.assert_allclose(force, rig.surface_friction * GRAVITY, rtol=1e-3)


def test_contact_forces_lie_in_the_friction_cone_and_press_on_the_tip(rig: Rig, tracks: Tracks) -> None:
    touching = np.linalg.norm(tracks.normal, axis=2) > 0
    on_slider = -tracks.force[touching]
    normal, tangential = (dot(on_slider, axis(tracks.normal[touching])) for axis in (lambda n: n, quarter_turn))
    assert not tracks.failed.any()
    assert np.all(normal >= 0)
    assert np.all(np.abs(tangential) <= rig.contact_friction * normal + 1e-3)


def test_the_tip_neither_enters_nor_moves_a_slider_it_does_not_touch(
    rig: Rig, session: Session, tracks: Tracks
) -> None:
    step = int(0.015 / STEP)
    tip = tracks.origin + step * STEP * np.stack([np.cos(tracks.heading), np.sin(tracks.heading)], axis=1)
    pose = tracks.pose[step]
    gap = rig.outline.nearest(rotate(tip - pose[:, :2], -pose[:, 2])).distance - 0.00475
    assert np.all(gap > -2e-5)
    np.testing.assert_array_equal(tracks.pose[int(session.gap.min() / STEP) - 1], tracks.pose[0])


def test_friction_never_returns_power(tracks: Tracks) -> None:
    moved = np.diff(tracks.pose, axis=0)
    step = np.arange(len(moved))[:, None, None] * STEP
    tip = tracks.origin + step * np.stack([np.cos(tracks.heading), np.sin(tracks.heading)], axis=1)
    arm = tip + 0.00475 * tracks.normal - tracks.pose[:-1, :, :2]
    work = dot(-tracks.force, moved[..., :2] + moved[..., 2:] * quarter_turn(arm))
    assert work.min() >= -1e-9


def test_bags_contain_the_readings(rig: Rig, tmp_path: Path) -> None:
    """As the project's own reader, which shares no code with the writer, decodes them."""
    time, steps = np.array([0.0, 0.25, 0.5]), np.arange(3.0)
    slider = Samples(time, np.column_stack([0.1 + steps, 0.2 - steps, [3.0, -3.0, 0.5]]))
    tip = Samples(time, np.column_stack([0.3 + steps, 0.4 - steps, 0.01 * steps]))
    wrench = Samples(time + 0.1, np.array([[1.0, 2.0, 0.3]] * 3))
    streams = Streams(slider, tip, wrench, {"room/humidity": Samples(time[:2], np.array([[45.5], [46.5]]))})
    topics = streams.serialised(7.0)
    assert [int(topic.arrival[0]) - 7_000_000_000 for topic in topics] == [4_000_000, 1_000_000, 101_500_000, 0]
    write_bag(tmp_path / "bag", topics, rig.record(), "points_rig")
    with (tmp_path / "bag/bag_0.mcap").open("rb") as file:
        arrivals = [message.log_time for _, _, message in make_reader(file).iter_messages(log_time_order=False)]
    assert len(arrivals) == 11 and arrivals == sorted(arrivals)
    read = read_recording(tmp_path / "bag/bag_0.mcap")
    np.testing.assert_allclose([read.slider.x, read.slider.y, read.slider.heading], slider.values.T, atol=1e-12)
    np.testing.assert_allclose([read.pusher.x, read.pusher.y, read.pusher.z], tip.values.T, atol=1e-12)
    assert read.slider.stamp.tolist() == [7_000_000_000, 7_250_000_000, 7_500_000_000]
    assert read.wrench is not None and read.rig is not None
    assert [read.wrench.fx[0], read.wrench.fy[0], read.wrench.torque[0]] == [1.0, 2.0, 0.3]
    assert [scalar.value.tolist() for scalar in read.scalars.values()] == [[45.5, 46.5]]
    assert read.rig.object_mass == pytest.approx(rig.mass, abs=1e-3)


@pytest.mark.long
def test_the_same_seed_writes_the_same_bag_and_a_whole_truth(tmp_path: Path) -> None:
    for name in ("first", "second"):
        write_pair(make_pair(6, 21, 2, 2), tmp_path / name / "data", tmp_path / name / "truth")
    files = sorted(path.relative_to(tmp_path / "first") for path in (tmp_path / "first").rglob("*.*"))
    assert len(files) == 5
    for file in files:
        assert (tmp_path / "first" / file).read_bytes() == (tmp_path / "second" / file).read_bytes()
    truth = json.loads((tmp_path / "first" / "truth" / "021.json").read_text())
    assert truth.keys() >= TRUTH_KEYS


# --- rig support ------------------------------------------------------------------------------------------------------


def write(options: argparse.Namespace, number: int) -> None:
    """A stand-in for a simulator: the truth alone, made once."""
    with truth_file(options, number).open("x") as file:
        file.write(str(options.seed))


def run(folder: Path, *arguments: str) -> int:
    parser = argparse.ArgumentParser()
    add_make(parser, write)
    folders = ["--out", str(folder / "data"), "--truth", str(folder / "truth")]
    options = parser.parse_args([*folders, "--seed", "4", *arguments])
    status: int = options.work(options)
    return status


@pytest.mark.parametrize("cores", ["1", "2"])
def test_only_missing_pairs_are_made(tmp_path: Path, cores: str) -> None:
    for count in ("2", "3"):
        assert run(tmp_path, "--count", count, "--cores", cores) == 0
    assert sorted(path.name for path in (tmp_path / "truth").iterdir()) == ["000.json", "001.json", "002.json"]


def test_truth_within_the_data_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="must not contain each other"):
        run(tmp_path, "--count", "1", "--truth", str(tmp_path / "data" / "truth"))
    assert not list(tmp_path.iterdir())


def test_angles_are_folded_around_zero() -> None:
    turn = 2.0 * np.pi
    np.testing.assert_allclose(wrapped(np.array([0.1, 3.5, -3.5, 7.0])), [0.1, 3.5 - turn, turn - 3.5, 7.0 - turn])
