# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal describe PLAN --plot FILE`: responses against SciPy's, and the picture."""

from __future__ import annotations

import subprocess
import sys
import warnings
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest
from hal_rig import run, write_board
from scipy import signal

from fcsl_compiler.board.board import check_board
from fcsl_compiler.board.filters import low_pass, notch
from fcsl_compiler.board.plan import plan_text
from simclient.board.plan import read_plan
from simclient.hal.filter_response import response
from simclient.hal.plot_filters import responses

RATE_HZ = 1000.0
LOW_PASS, NOTCH = (list(astuple(s)) for s in (low_pass(80, RATE_HZ), notch(120, 20, RATE_HZ)))
HZ = np.linspace(1.0, 499.0, 997)


@pytest.mark.parametrize("sections", [[LOW_PASS], [NOTCH], [LOW_PASS, NOTCH]], ids=["low-pass", "notch", "both"])
def test_responses_are_those_of_scipy(sections: list[list[float]]) -> None:
    gain, delay_s = response(sections, RATE_HZ, HZ)
    expected_gain, expected_samples = np.ones(len(HZ)), np.zeros(len(HZ))
    for b0, b1, b2, a1, a2 in sections:
        b, a = [b0, b1, b2], [1.0, a1, a2]
        expected_gain *= abs(signal.freqz(b, a, HZ, fs=RATE_HZ)[1])
        with warnings.catch_warnings(action="ignore"):  # it warns of the zero of a notch
            expected_samples += signal.group_delay((b, a), HZ, fs=RATE_HZ)[1]
    np.testing.assert_allclose(gain, expected_gain, rtol=1e-9, atol=1e-12)
    away = expected_gain > 1e-6
    np.testing.assert_allclose(delay_s[away], expected_samples[away] / RATE_HZ, rtol=1e-6)


def test_the_gain_at_the_frequencies_that_the_board_names() -> None:
    assert response([LOW_PASS], RATE_HZ, np.array([80.0]))[0] == pytest.approx(np.sqrt(0.5))
    gain, delay_s = response([NOTCH], RATE_HZ, np.array([0.0, 120.0, 500.0]))
    assert gain == pytest.approx([1.0, 0.0, 1.0], abs=1e-12)
    assert np.isnan(delay_s[1]) and np.isfinite(delay_s[[0, 2]]).all()


# ---- the picture -----------------------------------------------------------------------------------------------------


def write_plan(folder: Path, filters: str) -> Path:
    board = write_board(folder)
    board.write_text(board.read_text().replace('"inertial",\n', f'"inertial",\n{filters}', 1))
    plan = board.with_suffix(".plan")
    plan.write_text(plan_text(check_board(board)))
    return plan


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    return write_plan(
        tmp_path, '"low_pass_hz": {"gyro": 40, "accel": 20}, "notch": {"gyro": [{"hz": 60, "width_hz": 10}]},'
    )


def test_every_device_has_its_response(plan: Path) -> None:
    found = responses(read_plan(plan))
    assert list(found) == [("inertial", "gyro"), ("inertial", "accel")]
    for of_devices in found.values():
        assert [one.device for one in of_devices] == ["imu", "spare"]
        assert all(one.hz[-1] == pytest.approx(100.0) for one in of_devices)
    gyro = found["inertial", "gyro"][0]
    assert gyro.gain_db[0] == pytest.approx(0.0, abs=1e-3)
    assert gyro.gain_db[np.argmin(abs(gyro.hz - 60.0))] < -20.0


@pytest.mark.parametrize(("suffix", "begins"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".PDF", b"%PDF")])
def test_a_picture(plan: Path, suffix: str, begins: bytes) -> None:
    picture = plan.with_name(f"filters{suffix}")
    done = run(plan.parent, "describe", plan, "--plot", picture)
    assert done.stdout == f"{picture}: {picture.stat().st_size} bytes\n"
    drawn = picture.read_bytes()
    assert drawn.startswith(begins)
    if suffix == ".svg":
        for text in ("craft: filters, ticks 100 Hz", "inertial gyro: gain", "spare", "folds, above 50 Hz"):
            assert f"<!-- {text}".encode() in drawn, text


def test_what_cannot_be_plotted(tmp_path: Path, plan: Path) -> None:
    assert "ends in .png, .svg, .pdf" in run(tmp_path, "describe", plan, "--plot", "x.jpg", status=2).stderr
    assert "is no plan" in run(tmp_path, "describe", "iio", "--plot", "x.png", status=2).stderr
    assert "not allowed" in run(tmp_path, "describe", plan, "--plot", "x.png", "--json", status=2).stderr
    assert "no such directory" in run(tmp_path, "describe", plan, "--plot", tmp_path / "no/x.png", status=2).stderr
    unfiltered = write_plan(tmp_path, "")
    assert "no sensor has a filter" in run(tmp_path, "describe", unfiltered, "--plot", "x.png", status=2).stderr


def test_matplotlib_is_imported_for_a_picture_alone(plan: Path) -> None:
    code = (
        "import sys, simclient.hal.cli as c; c.main(['describe', sys.argv[1]]); assert 'matplotlib' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code, str(plan)], check=True, stdout=subprocess.DEVNULL)
