# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal monitor`: devices that come and go, values before and after their correction, the end by Ctrl-C."""

from __future__ import annotations

import json
import os
import pty
import select
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from hal_rig import HAL, Iio, environment, run, write_plan

from simclient.hal.monitor_plot import Curves
from simclient.hal.watch import Watch
from simclient.screen import Screen


@pytest.fixture
def sysfs(tmp_path: Path) -> Path:
    Iio(tmp_path / "sys", 0, "icm42688", anglvel=(9.1, 9.2, 9.3), accel=(0.0, 0.0, 9.8))
    Iio(tmp_path / "sys", 1, "ist8310", magn=(0.2, 0.0, -0.4))
    return tmp_path / "sys"


def by_name(rows: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {row["name"]: row for row in rows}


def objects(process: subprocess.Popen[str]) -> Iterator[dict[str, Any]]:
    assert process.stdout is not None
    for line in process.stdout:
        yield json.loads(line)


def test_values_rates_and_a_device_that_comes(tmp_path: Path, sysfs: Path) -> None:
    plan = write_plan(tmp_path)
    line = [*HAL, "monitor", str(plan), "--json"]
    errors = tmp_path / "errors"
    with (
        errors.open("w") as stderr,
        subprocess.Popen(line, stdout=subprocess.PIPE, stderr=stderr, text=True, env=environment(sysfs)) as process,
    ):
        first = next(objects(process))
        devices, sensors = by_name(first["devices"]), by_name(first["sensors"])
        assert devices["imu"]["there"] and devices["imu"]["rate_hz"] > 0.0 and devices["imu"]["age_s"] < 5.0
        assert not devices["spare"]["there"] and "no IIO device is called 'bmi088'" in devices["spare"]["note"]
        inertial = sensors["inertial"]
        assert inertial["primary"] == "imu"
        assert inertial["backends"][0]["raw"]["gyro"] == pytest.approx([9.1, 9.2, 9.3])
        assert inertial["values"]["gyro"] == pytest.approx([-0.2, 0.1, 0.3])  # less 9, turned by 90 degrees
        assert [backend["condition"] for backend in inertial["backends"]] == ["healthy", "silent"]
        assert sensors["rc"]["primary"] is None and sensors["rc"]["values"] is None

        Iio(sysfs, 2, "bmi088", anglvel=(0.0, 0.0, 0.0), accel=(0.0, 0.0, 9.8))
        news = "device 'spare' is there"  # told once a second at most, so perhaps after it was shown
        told = next(told for told in islice(objects(process), 60) if news in errors.read_text())
        assert by_name(told["devices"])["spare"]["there"]
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=10) == 0
    said = errors.read_text()
    assert "Traceback" not in said and "device 'spare' is not there" in said


def test_pins_and_converters(tmp_path: Path) -> None:
    """What an algorithm would read of them; a board of them alone is watched, too."""
    adc = tmp_path / "sys/bus/iio/devices/iio:device0"
    adc.mkdir(parents=True)
    (tmp_path / "sys/dev").mkdir()
    for name, text in (("name", "ads1015"), ("in_voltage2_raw", "1234")):
        (adc / name).write_text(f"{text}\n")
    plan = tmp_path / "panel.plan"
    lines = ["machine panel 100", "device cells 5000000 adc ads1015", "device buttons 5000000 gpio chip"]
    lines += ["adc 7 cells counts2", "gpio_in 4 buttons line1", "gpio_out 5 buttons line2 0"]
    plan.write_text("\n".join(["fcsl-board-plan 1", *lines, "end", ""]))
    done = run(tmp_path / "sys", "monitor", plan, "--seconds", "1.2", status=1)
    assert "device 'buttons' is not there: no GPIO chip is called 'chip'" in done.stderr
    assert done.stdout.splitlines()[-1].partition("s  ")[2] == "hardware: gpio 4: -  adc 7: 1234"
    told = json.loads(run(tmp_path / "sys", "monitor", plan, "--seconds", "0.3", "--json", status=1).stdout)
    assert [(one["name"], one["device"], one["value"]) for one in told["hardware"]] == [
        ("gpio 4", "buttons", None),
        ("adc 7", "cells", 1234.0),
    ]
    cells = by_name(told["devices"])["cells"]
    assert (
        cells["there"]
        and cells["samples"] > 0
        and cells["age_s"] < 5.0
        and not by_name(told["devices"])["buttons"]["there"]
    )
    plan.write_text(plan.read_text().replace("counts2", "counts16"))
    assert "driver 'adc' has no signal 'counts16'" in run(tmp_path / "sys", "monitor", plan, status=2).stderr


def test_lines_of_one_sensor(tmp_path: Path, sysfs: Path) -> None:
    lines = run(sysfs, "monitor", write_plan(tmp_path), "--sensor", "compass", "--seconds", "0.5").stdout.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("0.5 s  compass: mag  field [2e-05, 0, -4e-05] T  (mag ")


def test_a_device_that_is_missing_at_the_end(tmp_path: Path, sysfs: Path) -> None:
    done = run(sysfs, "monitor", write_plan(tmp_path), "--seconds", "0.3", status=1)
    assert done.stderr.splitlines()[-1].startswith("fcsl hal: device 'spare' is not there: no IIO device")
    assert "rc: no healthy device" in done.stdout


def test_curves(tmp_path: Path, sysfs: Path) -> None:
    words = ("--sensor", "compass", "--plot", "--seconds", "0.4")
    text = run(sysfs, "monitor", write_plan(tmp_path), *words).stdout
    assert text.startswith("compass.field = [2e-05, 0, -4e-05] T\n") and "┤" in text and "tick" in text


def test_a_terminal_is_redrawn(tmp_path: Path, sysfs: Path) -> None:
    plan = write_plan(tmp_path)
    primary, secondary = pty.openpty()
    with subprocess.Popen(
        [*HAL, "monitor", str(plan)], stdout=secondary, stderr=secondary, env=environment(sysfs)
    ) as process:
        os.close(secondary)
        text, end = "", time.monotonic() + 10.0
        while text.count("\x1b[J") < 3 and time.monotonic() < end:
            if select.select([primary], [], [], 0.1)[0]:
                text += os.read(primary, 65536).decode(errors="replace")
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=10) == 0
        text += os.read(primary, 65536).decode(errors="replace")
    os.close(primary)
    assert "inertial (inertial): primary imu" in text and "corrected" in text
    assert "\x1b[?25l" in text and text.rstrip().endswith("\x1b[?25h")


def test_lines_that_a_terminal_has_no_room_for_are_cut(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A line that the terminal wrapped would shift all that is drawn after it."""
    monkeypatch.setattr(shutil, "get_terminal_size", lambda *_: os.terminal_size((8, 4)))
    screen = Screen()
    for lines, shown in (
        (["12345678", "123456789"], ["12345678", "1234567…"]),
        (["1", "2", "3"], ["1", "2", "3"]),
        (["1", "2", "3", "4"], ["1", "2", "… 2 lin…"]),
        (["1"], ["1"]),
    ):
        screen.draw(lines)
        drawn = capsys.readouterr().out.removesuffix("\x1b[J").split("\r")[-1].splitlines()
        assert [line.removesuffix("\x1b[K") for line in drawn] == shown


def test_curves_begin_where_their_sensor_does() -> None:
    """A sensor without a healthy device has no values, and a window has 500 ticks."""
    field = {"n": 0}
    sensors = [SimpleNamespace(kind="compass", name="compass")]
    plan = SimpleNamespace(tick_hz=200, sensors=sensors)

    def corrected(_: int) -> dict[str, list[float]] | None:
        return None if field["n"] < 100 else {"field": [1.0, 2.0, 3.0]}

    curves = Curves(cast("Watch", SimpleNamespace(plan=plan, corrected=corrected)), [0])
    assert curves.lines(60, 12) == ["no sensor has a healthy device yet"]
    for field["n"] in range(200):
        curves.take(field["n"])
    title, *rows = curves.lines(60, 12)
    assert title == "compass.field = [1, 2, 3] T" and rows[-1].split() == ["0", "tick", "196"]
    inked = {x for row in rows[:-2] for x, c in enumerate(row.split("┤")[-1].split("│")[-1]) if c not in "⠀"}
    width = len(rows[0].split("┤")[-1])
    assert min(inked) in (width // 2, width // 2 + 1) and max(inked) == width - 1
    for field["n"] in range(200, 2600):
        curves.take(field["n"])
    assert curves.lines(60, 12)[-1].split() == ["600", "tick", "2596"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--sensor", "compas"], "did you mean `compass`?"),
        (["--plot"], "give --seconds"),
        (["--plot", "--json"], "not allowed with"),
        (["--seconds", "nan"], "a number wanted"),
    ],
)
def test_wrong_usage(tmp_path: Path, sysfs: Path, words: list[str], says: str) -> None:
    assert says in run(sysfs, "monitor", write_plan(tmp_path), *words, status=2).stderr


def test_a_device_that_is_there_and_cannot_be_opened(tmp_path: Path, sysfs: Path) -> None:
    plan = write_plan(tmp_path, receiver=str(tmp_path / "board.json"))
    assert "is no serial device" in run(sysfs, "monitor", plan, "--seconds", "0.3", status=1).stderr
