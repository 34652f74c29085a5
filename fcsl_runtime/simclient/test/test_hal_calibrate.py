# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal calibrate`: what it refuses, what it finds, and that a board keeps all else."""

from __future__ import annotations

import json
import os
import pty
import threading
import time
import tty
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hal_rig import Iio, run, write_board

from simclient.hal import calibrate_accel, calibrate_compass, calibrate_gyro, calibrate_rc
from simclient.hal.fit_accel import GRAVITY

RATE = 100.0


@pytest.fixture
def sysfs(tmp_path: Path) -> Path:
    Iio(tmp_path / "sys", 0, "icm42688", anglvel=(0.011, -0.022, 0.033), accel=(0.0, 0.0, 9.8))
    return tmp_path / "sys"


def rows(values: Any) -> list[np.ndarray[Any, Any]]:
    return list(np.asarray(values, dtype=float))


class FakeSource:
    """Samples at 100 Hz in a time of their own; the last one is repeated."""

    script: Sequence[Any] = ()

    def __init__(self, *_: object, **__: object) -> None: ...

    def vectors(self, seconds: float) -> Iterator[tuple[float, Any]]:
        for number in range(int(seconds * RATE)):
            yield number / RATE, self.script[min(number, len(self.script) - 1)]

    def __enter__(self) -> FakeSource:
        return self

    def __exit__(self, *_: object) -> None: ...


def scripted(monkeypatch: pytest.MonkeyPatch, module: Any, script: Sequence[Any]) -> None:
    monkeypatch.setattr(module, "Source", type("Scripted", (FakeSource,), {"script": script}))


# ---- gyro ------------------------------------------------------------------------------------------------------------


def test_the_offset_of_a_gyro_is_written(tmp_path: Path, sysfs: Path) -> None:
    board = write_board(tmp_path)
    before = board.read_text()
    words = ("calibrate", "gyro", board, "--sensor", "inertial", "--device", "imu", "--seconds", "0.5")
    said = run(sysfs, *words).stdout
    assert "keep the vehicle still for 0.5 s\n" in said
    assert '{"correct": {"gyro": {"offset": [0.011, -0.022, 0.033]}}}' in said
    assert board.read_text() == before
    said = run(sysfs, *words, "--write").stdout
    assert f"now run `fcsl board {board}`" in said
    assert board.read_text() == before.replace("[9, 9, 9]", "[0.011, -0.022, 0.033]")


def test_line_ends_marks_and_links_stay(tmp_path: Path, sysfs: Path) -> None:
    board = write_board(tmp_path)
    before = b"\xef\xbb\xbf" + board.read_bytes().replace(b"\n", b"\r\n")
    (tmp_path / "real.json").write_bytes(before)
    board.unlink()
    board.symlink_to("real.json")
    run(sysfs, *("calibrate", "gyro", board, "--sensor", "inertial", "--device", "imu", "--seconds", "0.5", "--write"))
    assert board.is_symlink()
    assert board.read_bytes() == before.replace(b"[9, 9, 9]", b"[0.011, -0.022, 0.033]")


@pytest.mark.parametrize(
    ("script", "says"),
    [
        (
            np.random.default_rng(1).normal(size=(1000, 3)) * [0.001, 0.05, 0.001],
            "it moved: the standard deviation of y is 0.0485",
        ),
        (np.ones((1000, 3)) * [0.0, 0.0, -0.7], "it turns: z has -0.7 rad/s"),
    ],
    ids=["moved", "turned"],
)
def test_a_gyro_that_is_not_at_rest(
    tmp_path: Path, sysfs: Path, monkeypatch: pytest.MonkeyPatch, script: Any, says: str
) -> None:
    scripted(monkeypatch, calibrate_gyro, rows(script))
    board = write_board(tmp_path)
    before = board.read_text()
    words = ("calibrate", "gyro", board, "--sensor", "inertial", "--device", "imu", "--write")
    assert says in run(sysfs, *words, status=1).stderr
    assert board.read_text() == before


def test_a_device_that_is_missing(tmp_path: Path, sysfs: Path) -> None:
    board = write_board(tmp_path)
    words = ("calibrate", "gyro", board, "--sensor", "inertial", "--device", "spare", "--seconds", "0.2")
    assert "no IIO device is called 'bmi088'" in run(sysfs, *words, status=1).stderr


def test_a_signal_of_another_kind(tmp_path: Path, sysfs: Path) -> None:
    board = write_board(tmp_path)
    words = ("calibrate", "gyro", board, "--sensor", "inertial", "--device", "imu")
    before = board.read_text()
    for signal, says in (("pressure", "in Pa, here it must be in rad/s"), ("x", "no signal `x`")):
        board.write_text(before.replace('"rotation"', f'"signals": {{"gyro": "{signal}"}}, "rotation"'))
        assert says in run(sysfs, *words, status=2).stderr


def test_the_temperature_of_the_board_is_taken_off(tmp_path: Path, sysfs: Path) -> None:
    """offset + per_kelvin · (35 - 25) is what the device tells."""
    board = write_board(tmp_path)
    board.write_text(
        board.read_text().replace('"offset": [9, 9, 9]', '"offset": [9, 9, 9], "per_kelvin": [1e-4, 0, 0]')
    )
    (sysfs / "bus/iio/devices/iio:device0/in_temp_input").write_text("35000\n")
    words = ("calibrate", "gyro", board, "--sensor", "inertial", "--device", "imu", "--seconds", "0.5")
    assert '"offset": [0.01, -0.022, 0.033]' in run(sysfs, *words).stdout


# ---- accelerometer ---------------------------------------------------------------------------------------------------

OFFSET, SCALE = np.array([0.1, -0.2, 0.3]), np.array([1.02, 0.98, 1.01])


def positions(order: Sequence[tuple[int, int]], seconds: float = 2.0) -> list[Any]:
    """The vehicle lies on each side, and is turned in between."""
    random = np.random.default_rng(2)
    script: list[Any] = []
    for axis, sign in order:
        up = np.eye(3)[axis] * sign * GRAVITY / SCALE + OFFSET
        script += rows(up + random.normal(size=(int(seconds * RATE), 3)) * 0.02)
        script += rows(random.normal(size=(int(RATE), 3)) * 5.0)
    return script


SIDES = [(2, 1), (0, -1), (1, 1), (0, 1), (2, -1), (1, -1)]


def test_six_positions_in_any_order(tmp_path: Path, sysfs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scripted(monkeypatch, calibrate_accel, positions(SIDES))
    board = write_board(tmp_path)
    said = run(sysfs, "calibrate", "accel", board, "--sensor", "inertial", "--device", "imu", "--write").stdout
    assert [line[:2] for line in said.splitlines() if "is up:" in line] == ["+z", "-x", "+y", "+x", "-z", "-y"]
    assert "6 of 6; left: none" in said and "residuals" in said
    correct = json.loads(board.read_text())["sensors"]["inertial"]["backends"][0]["correct"]
    assert correct["accel"]["offset"] == pytest.approx(OFFSET, abs=0.01)
    assert correct["accel"]["scale"] == pytest.approx(SCALE, abs=0.002)
    assert correct["gyro"] == {"scale": 1.0, "offset": [9, 9, 9]}


def test_a_side_that_is_missing(tmp_path: Path, sysfs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scripted(monkeypatch, calibrate_accel, positions(SIDES[:4]))
    words = ("calibrate", "accel", write_board(tmp_path), "--sensor", "inertial", "--device", "imu")
    assert "have not been up and still: -y, -z" in run(sysfs, *words, "--seconds", "30", status=1).stderr


def test_an_accelerometer_in_another_unit(tmp_path: Path, sysfs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scripted(monkeypatch, calibrate_accel, [vector / GRAVITY for vector in positions(SIDES)])
    words = ("calibrate", "accel", write_board(tmp_path), "--sensor", "inertial", "--device", "imu")
    assert "is the unit of the device m/s^2?" in run(sysfs, *words, status=1).stderr


# ---- compass ---------------------------------------------------------------------------------------------------------


def directions(count: int) -> Any:
    vectors = np.random.default_rng(3).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_a_compass_that_is_turned(tmp_path: Path, sysfs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = directions(1000) * 45e-6 * [1.1, 1.0, 1.0 / 1.1] + [20e-6, -10e-6, 5e-6]
    scripted(monkeypatch, calibrate_compass, rows(script))
    board = write_board(tmp_path)
    said = run(sysfs, "calibrate", "compass", board, "--sensor", "compass", "--seconds", "10", "--write").stdout
    assert "hard iron [20, -10, 5] uT, field 45 uT" in said and "coverage 100 %" in said
    field = json.loads(board.read_text())["sensors"]["compass"]["backends"][0]["correct"]["field"]
    assert field["offset"] == pytest.approx([20e-6, -10e-6, 5e-6])
    assert np.array(field["scale"]) == pytest.approx(np.diag([1 / 1.1, 1.0, 1.1]), abs=1e-6)


@pytest.mark.parametrize(
    ("script", "says"),
    [
        (np.abs(directions(1000)) * 45e-6, "cover"),
        (directions(1000) * 45e-6 * np.random.default_rng(4).uniform(0.5, 1.5, (1000, 1)), "off the sphere"),
        (directions(1000) * 0.45, "is the device's unit T?"),
        (directions(1000) * 1e-7 + 40e-6, "was the vehicle turned"),
        (np.ones((1000, 3)) * 40e-6, "lie on no ellipsoid"),
        (directions(1000)[:, :1] * [1e-5, 2e-5, 3e-5], ""),
    ],
    ids=["part", "disturbed", "gauss", "still", "constant", "line"],
)
def test_a_compass_that_is_refused(
    tmp_path: Path, sysfs: Path, monkeypatch: pytest.MonkeyPatch, script: Any, says: str
) -> None:
    scripted(monkeypatch, calibrate_compass, rows(script))
    words = ("calibrate", "compass", write_board(tmp_path), "--sensor", "compass", "--seconds", "10")
    assert says in run(sysfs, *words, status=1).stderr


# ---- remote control --------------------------------------------------------------------------------------------------


def sbus_frame(pulses: Sequence[float], flags: int = 0) -> bytes:
    """16 channels of 11 bits."""
    channels = [round((pulse - 880.0) * 8.0 / 5.0) for pulse in pulses] + [992] * (16 - len(pulses))
    bits = sum(value << (11 * place) for place, value in enumerate(channels))
    return b"\x0f" + bits.to_bytes(22, "little") + bytes([flags, 0])


class Receiver:
    """A pty that sends an SBUS frame every 10 ms: sticks at rest, and from end to end once they move. Channel 2 stays."""

    def __init__(self) -> None:
        self._primary, self._secondary = pty.openpty()
        tty.setraw(self._secondary)
        self.device = os.ttyname(self._secondary)
        self.moves_since, self.flags, self._over = float("inf"), 0, False
        self._thread = threading.Thread(target=self._send)
        self._thread.start()

    def _send(self) -> None:
        while not self._over:
            wave = np.sin(20.0 * max(0.0, time.monotonic() - self.moves_since))
            pulses = [1500.0 + 400.0 * wave, 1500.0 - 500.0 * wave, 1500.0, 1000.0 + 1000.0 * (wave > 0.9)]
            os.write(self._primary, sbus_frame(pulses, self.flags))
            time.sleep(0.01)

    def close(self) -> None:
        self._over = True
        self._thread.join()
        os.close(self._primary)
        os.close(self._secondary)


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    opened = Receiver()
    yield opened
    opened.close()


def test_ranges_of_a_remote_control(tmp_path: Path, receiver: Receiver, monkeypatch: pytest.MonkeyPatch) -> None:
    collect = calibrate_rc._collect

    def collect_then_move(*arguments: Any) -> Any:
        collected = collect(*arguments)
        receiver.moves_since = time.monotonic()
        return collected

    monkeypatch.setattr(calibrate_rc, "_REST_S", 0.5)
    monkeypatch.setattr(calibrate_rc, "_collect", collect_then_move)
    board = write_board(tmp_path, receiver.device)
    reversed_second = '"device": "receiver",\n          "sticks": [{}, {"minimum": 1900, "maximum": 1100}]\n'
    board.write_text(board.read_text().replace('"device": "receiver"\n', reversed_second))
    said = run(tmp_path, "calibrate", "rc", board, "--sensor", "rc", "--seconds", "1.5", "--write").stdout
    assert "not moved" in said
    sticks = json.loads(board.read_text())["sensors"]["rc"]["backends"][0]["sticks"]
    assert len(sticks) == 4 and sticks[2] == {}
    assert [sticks[0][key] for key in ("minimum", "middle", "maximum")] == pytest.approx([1100, 1500, 1900], abs=25)
    assert sticks[0]["deadband"] == 2
    assert [sticks[1][key] for key in ("minimum", "maximum")] == pytest.approx([2000, 1000], abs=25)
    assert sticks[3]["middle"] == (sticks[3]["minimum"] + sticks[3]["maximum"]) / 2
    assert '\n            {"minimum": ' in board.read_text()


def test_a_remote_control_that_is_off(tmp_path: Path, receiver: Receiver) -> None:
    receiver.flags = 0x08
    words = ("calibrate", "rc", write_board(tmp_path, receiver.device), "--sensor", "rc")
    assert "the receiver has lost the transmitter" in run(tmp_path, *words, status=1).stderr


# ---- usage -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["gyro", "--sensor", "inertial"], "choose one with --device"),
        (["gyro", "--sensor", "inertial", "--device", "mag"], "it has imu, spare"),
        (["gyro", "--sensor", "inertia"], "did you mean `inertial`?"),
        (["compass", "--sensor", "inertial"], "of kind `inertial`, not `compass`"),
        (["gyro"], "--sensor"),
        (["baro", "--sensor", "inertial"], "invalid choice"),
    ],
)
def test_wrong_usage(tmp_path: Path, words: list[str], says: str) -> None:
    board = write_board(tmp_path)
    assert says in run(tmp_path, "calibrate", words[0], board, *words[1:], status=2).stderr


@pytest.mark.parametrize("text", ["", "{", "[]", '{"machine": "craft.json", "devices": {}}', "\x00"])
def test_a_board_with_errors(tmp_path: Path, text: str) -> None:
    board = write_board(tmp_path)
    board.write_text(text)
    assert "error[" in run(tmp_path, "calibrate", "rc", board, "--sensor", "rc", status=2).stderr
    run(tmp_path, "calibrate", "rc", tmp_path / "none.json", "--sensor", "rc", status=2)
