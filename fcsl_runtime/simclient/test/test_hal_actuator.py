# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal test-actuator`: what moves, how, and that the safe pulse is the last one whatever happens."""

from __future__ import annotations

import re
import signal
import struct
import subprocess
import time
from pathlib import Path

import pytest
from hal_rig import HAL, build_driver, environment, run

from simclient.board.plan import Pulse
from simclient.hal.in_use import user_of
from simclient.hal.pulses import ramp, start_of


def bits(*values: float) -> str:
    return " ".join(struct.pack(">d", value).hex() for value in values)


def write_plan(folder: Path, driver: str, address: object, safe: float = 1000.0) -> Path:
    """One element, from -1 to 1, that becomes 1000 to 2000 us."""
    signal_name = "number" if driver == "log" else "throw"
    lines = [
        "fcsl-board-plan 1",
        "machine craft 100",
        f"device esc 0 {driver} {address}",
        "output motors esc",
        f"pulse 0 {signal_name} {bits(-1, 1, 1000, 1500, 2000, 0, safe)}",
        "end",
        "",
    ]
    path = folder / "board.plan"
    path.write_text("\n".join(lines))
    return path


def log_values(path: Path) -> list[float]:
    lines = path.read_bytes().replace(b"\0", b"").decode().splitlines()
    return [float(line.partition("number=")[2]) for line in lines if "number=" in line]


def test_up_by_a_ramp_and_down_at_once(tmp_path: Path) -> None:
    plan = write_plan(tmp_path, "log", tmp_path / "log")
    words = ("motors[0]", "--command", "0", "--seconds", "0.8", "--yes-move-it")
    done = run(tmp_path, "test-actuator", plan, *words)
    assert "from 1000 to 1500 within 0.5 s, for 0.8 s, then 1000 (safe)" in done.stdout
    values = log_values(tmp_path / "log")
    assert values[0] == 1000.0 and max(values) == 1500.0 and values[-1] == 1000.0
    assert values[:-1] == sorted(values[:-1])
    assert max(b - a for a, b in zip(values[:-2], values[1:-1], strict=True)) < 250.0


def test_nothing_moves_without_the_word(tmp_path: Path) -> None:
    plan = write_plan(tmp_path, "log", tmp_path / "log")
    done = run(tmp_path, "test-actuator", plan, "motors", "--pulse", "1200", "--seconds", "1", status=2)
    assert "nothing moves without --yes-move-it. It would move motors[0], number of log" in done.stderr
    assert not (tmp_path / "log").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT])
def test_a_signal_makes_it_safe(tmp_path: Path, number: signal.Signals) -> None:
    plan = write_plan(tmp_path, "log", tmp_path / "log")
    line = [*HAL, "test-actuator", str(plan), "motors", "--command", "1", "--seconds", "10", "--yes-move-it"]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment(tmp_path)) as process:
        end = time.monotonic() + 10.0
        while not (tmp_path / "log").exists() or len(log_values(tmp_path / "log")) < 5:
            assert time.monotonic() < end
            time.sleep(0.01)
        while process.poll() is None:  # more than one, up to its end
            process.send_signal(number)
            assert time.monotonic() < end + 10.0
        assert process.returncode == 130
        assert process.stderr is not None and b"Traceback" not in process.stderr.read()
    assert log_values(tmp_path / "log")[-1] == 1000.0


def test_a_driver_of_a_library_that_fails(tmp_path: Path) -> None:
    """It refuses one position, and takes the safe one after that."""
    device = tmp_path / "fin"
    device.touch()
    plan = write_plan(tmp_path, f"{build_driver(tmp_path)}:fin", device, safe=1234.0)
    words = ("motors", "--pulse", "1300", "--seconds", "0.3", "--yes-move-it")
    done = run(tmp_path, "test-actuator", plan, *words, status=1)
    assert "stuck" in done.stderr and "motors[0]: NOT SAFE, cut the power" in done.stderr
    plan = write_plan(tmp_path, f"{tmp_path / 'libfin.so'}:fin", device)
    run(tmp_path, "test-actuator", plan, *words)
    values = [float(line) for line in device.read_text().split()]
    assert values[0] == 1000.0 and max(values) > 1150.0 and values[-1] == 1000.0
    done = run(
        tmp_path, "test-actuator", write_plan(tmp_path, f"{tmp_path / 'libfin.so'}:fin", "/nowhere"), *words, status=1
    )
    assert "no folder '/nowhere'" in done.stderr


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["motor", "--command", "0", "--seconds", "1"], "did you mean `motors[0]`?"),
        (["motors[1]", "--command", "0", "--seconds", "1"], "it has motors[0]"),
        (["motors]", "--command", "0", "--seconds", "1"], "no output `motors]`"),
        (["motors", "--command", "2", "--seconds", "1"], "takes commands from -1 to 1"),
        (["motors", "--pulse", "999", "--seconds", "1"], "takes pulses from 1000 to 2000"),
        (["motors", "--pulse", "nan", "--seconds", "1"], "a number wanted"),
        (["motors", "--command", "0", "--seconds", "11"], "up to 10"),
        (["motors", "--command", "0"], "--seconds"),
        (["motors", "--seconds", "1"], "--command --pulse is required"),
        (["motors", "--seconds", "1", "--command", "0", "--pulse", "1500"], "not allowed with"),
    ],
)
def test_wrong_usage(tmp_path: Path, words: list[str], says: str) -> None:
    plan = write_plan(tmp_path, "log", tmp_path / "log")
    assert says in run(tmp_path, "test-actuator", plan, *words, "--yes-move-it", status=2).stderr
    assert not (tmp_path / "log").exists()


def test_a_board_without_the_output(tmp_path: Path) -> None:
    (tmp_path / "board.plan").write_text("fcsl-board-plan 1\nmachine craft 100\nend\n")
    words = ("motors", "--command", "0", "--seconds", "1", "--yes-move-it")
    assert "it has none" in run(tmp_path, "test-actuator", tmp_path / "board.plan", *words, status=2).stderr


@pytest.mark.parametrize(
    ("signal_name", "says"), [("three", "it is f64[3]"), ("flag", "it is bool"), ("x", "it is missing")]
)
def test_a_signal_that_is_no_number(tmp_path: Path, signal_name: str, says: str) -> None:
    plan = write_plan(tmp_path, "log", tmp_path / "log")
    plan.write_text(re.sub(r"end \w{8}\n", "end\n", plan.read_text().replace("number", signal_name)))
    words = ("motors", "--command", "0", "--seconds", "1", "--yes-move-it")
    assert says in run(tmp_path, "test-actuator", plan, *words, status=2).stderr


# ---- other programs --------------------------------------------------------------------------------------------------


def process(proc: Path, number: int, folder: Path, *words: str) -> None:
    (proc / str(number)).mkdir(parents=True)
    (proc / str(number) / "cmdline").write_bytes(b"\0".join(word.encode() for word in words) + b"\0")
    (proc / str(number) / "cwd").symlink_to(folder)


@pytest.mark.parametrize(
    ("words", "is_used"),
    [
        (("/opt/bin/fcsl-guard", "lib.so", "--slot", "s", "--board", "board.plan"), True),
        (("fcsl-guard", "lib.so", "--slot", "s", "--board=board.plan"), True),
        (("fcsl-guard", "lib.so", "--board", "missing.plan"), True),
        (("fcsl-guard", "lib.so", "--bo", "board.plan"), True),
        (("fcsl-guard", "lib.so", "--actuator", "motors=pwm.pulse0:pwmchip0@400"), True),
        (("fcsl-guard", "lib.so", "--actuator", "motors=/opt/ros@2/libpwm.so:pwm:pwmchip0"), True),
        (("fcsl-guard", "lib.so", "--actuator", "motors=pwm:pwmchip1"), False),
        (("fcsl-guard", "lib.so", "--actuator", "motors=none"), False),
        (("fcsl-fc", "lib.so", "--hal", "linux:board.plan"), True),
        (("fcsl-fc", "lib.so", "--hal", "composite:board.plan,wire:unix:/s,x"), True),
        (("fcsl-fc", "lib.so", "--hal", "composite:board.plan,zenoh:tcp:localhost:7447"), True),
        (("fcsl-fc", "lib.so", "--hal", "linux:missing.plan"), True),
        (("fcsl-fc", "lib.so", "--hal", "linux:pins.plan"), True),
        (("fcsl-fc", "lib.so", "--hal", "linux:inputs.plan"), False),
        (("fcsl-fc", "lib.so", "--hal", "stub"), False),
        (("cat", "--board", "board.plan"), False),
        ((), False),
    ],
)
def test_programs_that_have_the_device(tmp_path: Path, words: tuple[str, ...], is_used: bool) -> None:
    write_plan(tmp_path, "pwm", "pwmchip0")
    for name, pin in (("pins", "gpio_out 17 esc line3 0"), ("inputs", "gpio_in 17 esc line3")):
        lines = ["fcsl-board-plan 1", "machine craft 100", "device esc 0 pwm pwmchip0", pin, "end", ""]
        (tmp_path / f"{name}.plan").write_text("\n".join(lines))
    process(tmp_path / "proc", 7, tmp_path, *words)
    (tmp_path / "proc/self").mkdir()
    assert bool(user_of("pwmchip0@50", tmp_path / "proc")) == is_used


# ---- pulses ----------------------------------------------------------------------------------------------------------

RULE = Pulse(0, "pulse0", -1.0, 1.0, 1000.0, 1400.0, 2000.0, 0.0, 1000.0)


def test_pulses_of_commands() -> None:
    pulses = [RULE.line.at(command) for command in (-1.0, -0.5, 0.0, 0.5, 1.0)]
    assert pulses == [1000.0, 1200.0, 1400.0, 1700.0, 2000.0]


def test_a_ramp_begins_at_a_pulse_that_moves() -> None:
    """0: no pulses at all. What lies between that and 1000 us is nothing that a servo knows."""
    off = Pulse(0, "pulse0", -1.0, 1.0, 1000.0, 1400.0, 2000.0, 0.0, 0.0)
    assert start_of(RULE) == 1000.0 and start_of(off) == 1400.0
    assert start_of(Pulse(0, "pulse0", 0.0, 1.0, 1000.0, 1500.0, 2000.0, 0.0, 0.0)) == 1000.0
    assert [ramp(off, 2000.0, at) for at in (0.0, 0.25, 0.5, 9.0)] == [1400.0, 1700.0, 2000.0, 2000.0]


def test_an_output_may_be_slower_than_the_ramp() -> None:
    slow = Pulse(0, "pulse0", -1.0, 1.0, 1000.0, 1500.0, 2000.0, 500.0, 1000.0)
    assert ramp(slow, 2000.0, 1.0) == 1500.0 and ramp(slow, 2000.0, 2.0) == 2000.0
