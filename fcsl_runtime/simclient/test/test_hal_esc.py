# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal calibrate esc`: maximum, minimum, and the safe value last, whatever ends it."""

from __future__ import annotations

import os
import pty
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hal_rig import HAL, build_driver, environment, run
from pwm_tree import Sysfs

from simclient.hal import calibrate_esc

LONG_S = 60.0
#: Of a motor: low, high, minimum, middle, maximum, slew, safe.
MOTOR = (0.0, 1.0, 1000.0, 1500.0, 2000.0, 400.0, 1100.0)


def write_plan(folder: Path, *lines: str) -> Path:
    path = folder / "board.plan"
    path.write_text("\n".join(["fcsl-board-plan 1", "machine craft 100", *lines, "end", ""]))
    return path


def pulse(index: int, signal_name: str, *numbers: float) -> str:
    return f"pulse {index} {signal_name} " + " ".join(struct.pack(">d", number).hex() for number in numbers)


def plan_of_log(folder: Path, *numbers: float) -> Path:
    return write_plan(
        folder, f"device esc 0 log {folder / 'log'}", "output motors esc", pulse(0, "number", *(numbers or MOTOR))
    )


def values(folder: Path) -> list[float]:
    """What the driver `log` got, without repetitions."""
    lines = (folder / "log").read_bytes().replace(b"\0", b"").decode().splitlines()
    numbers = [float(line.partition("number=")[2]) for line in lines if "number=" in line]
    return [number for number, before in zip(numbers, [None, *numbers], strict=False) if number != before]


class Calibration:
    """A running command that waits for Enter."""

    def __init__(self, sysfs: Path, plan: Path, *names: str, terminal: int = subprocess.PIPE):
        self.out = sysfs / "out"
        line = [*HAL, "calibrate", "esc", str(plan), "--channels", *names, "--yes-move-it"]
        with self.out.open("w") as out:
            self.process = subprocess.Popen(
                line, stdin=terminal, stdout=out, stderr=subprocess.PIPE, env=environment(sysfs), text=True
            )

    def wait_for(self, text: str) -> None:
        end = time.monotonic() + LONG_S
        while text not in self.out.read_text():
            assert self.process.poll() is None and time.monotonic() < end, self.out.read_text()
            time.sleep(0.01)

    def enter(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()

    def at_step(self, number: int) -> None:
        """Answers the prompts before this one, and waits until it is shown."""
        for step in range(1, number + 1):
            self.wait_for(f"\n{step}. ")
            if step < number:
                self.enter()

    def end(self) -> tuple[int, str]:
        _, complaint = self.process.communicate(timeout=LONG_S)
        return self.process.returncode, complaint


@pytest.fixture
def calibrating(tmp_path: Path) -> Iterator[Callable[..., Calibration]]:
    begun: list[Calibration] = []

    def begin(plan: Path, *names: str, terminal: int = subprocess.PIPE) -> Calibration:
        begun.append(Calibration(tmp_path, plan, *names, terminal=terminal))
        return begun[-1]

    yield begin
    for calibration in begun:
        calibration.process.kill()
        calibration.process.communicate()


def test_all_controllers_of_a_device_learn_at_once(tmp_path: Path, calibrating: Callable[..., Calibration]) -> None:
    """A reversed output has its longest pulse at the first end. What is not named stays safe."""
    sysfs = Sysfs(tmp_path, (0, 1, 3))
    sysfs.make()
    plan = write_plan(
        tmp_path,
        f"device esc 0 pwm {sysfs.chip}@100",
        f"device fins 0 pwm {sysfs.chip}@100",
        "output motors esc",
        pulse(0, "pulse0", *MOTOR),
        pulse(1, "pulse3", 0.0, 1.0, 1900.0, 1500.0, 950.0, 0.0, 0.0),
        "output rudder fins",
        pulse(0, "pulse1", -1.0, 1.0, 1000.0, 1500.0, 2000.0, 0.0, 1500.0),
    )
    running = calibrating(plan, "motors[0]", "motors")
    running.at_step(1)
    said = " ".join(running.out.read_text().split())
    assert "PROPELLERS OFF" in said and "motors[0] pulse0 2000 1000 1100" in said
    assert "motors[1] pulse3 1900 950 0" in said and "the others of this device are safe: pulse1 1500" in said
    assert sysfs.pulses() == ("1100000", "1500000", "0")
    running.at_step(2)
    assert sysfs.pulses() == ("2000000", "1500000", "1900000")
    running.enter()
    running.wait_for("3. minimum")
    assert sysfs.pulses() == ("1000000", "1500000", "950000")
    running.enter()
    assert running.end() == (0, "")
    assert sysfs.pulses() == ("1100000", "1500000", "0")
    assert "motors[0] is safe: 1100\n" in running.out.read_text()


SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT]
#: What the device has got when a step waits.
STEPS = {1: [1100.0], 2: [1100.0, 2000.0], 3: [1100.0, 2000.0, 1000.0]}


@pytest.mark.parametrize("step", STEPS)
def test_whatever_ends_a_step_makes_it_safe(tmp_path: Path, calibrating: Callable[..., Calibration], step: int) -> None:
    """Signals, and the end of the input."""
    plan = plan_of_log(tmp_path)
    safe = [*STEPS[step], 1100.0] if step > 1 else STEPS[1]
    for number in SIGNALS:
        (tmp_path / "log").unlink(missing_ok=True)
        running = calibrating(plan, "motors")
        running.at_step(step)
        assert values(tmp_path) == STEPS[step]
        while running.process.poll() is None:  # more than one, up to its end
            running.process.send_signal(number)
        assert running.end() == (130, "")
        assert values(tmp_path) == safe
    (tmp_path / "log").unlink()
    running = calibrating(plan, "motors")
    running.at_step(step)
    status, complaint = running.end()  # closes its input
    assert status == 1 and "the input has ended" in complaint and "then it took its safe values" in complaint
    assert values(tmp_path) == safe


def test_output_that_nobody_takes_makes_it_safe(tmp_path: Path) -> None:
    plan = plan_of_log(tmp_path)
    line = [*HAL, "calibrate", "esc", str(plan), "--channels", "motors", "--yes-move-it"]
    pipe = subprocess.PIPE
    with subprocess.Popen(line, stdin=pipe, stdout=pipe, stderr=pipe, env=environment(tmp_path), text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        while "1. take" not in (said := process.stdout.readline()):
            assert said, process.stderr and process.stderr.read()
        process.stdout.close()
        process.stdin.write("\n")
        process.stdin.flush()
        assert process.wait(LONG_S) == 128 + signal.SIGPIPE
    assert values(tmp_path) == [*STEPS[2], 1100.0]


def test_nobody_answers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = plan_of_log(tmp_path)
    reading, writing = os.pipe()
    monkeypatch.setattr(calibrate_esc, "_STEP_S", 0.1)
    with os.fdopen(reading) as answers, os.fdopen(writing, "wb", buffering=0) as user:
        monkeypatch.setattr(sys, "stdin", answers)
        user.write(b"yes\n")
        done = run(tmp_path, "calibrate", "esc", plan, "--channels", "motors", "--yes-move-it", status=1)
    assert "no Enter came for 0.1 s; then it took its safe values" in done.stderr
    assert values(tmp_path) == [*STEPS[2], 1100.0]


def test_a_terminal_neither_stops_it_nor_answers_early(tmp_path: Path, calibrating: Callable[..., Calibration]) -> None:
    """An Enter that was pressed before the prompt is none. Ctrl-Z would leave the maximum for good."""
    user, terminal = pty.openpty()
    os.write(user, b"\n\n\n")
    running = calibrating(plan_of_log(tmp_path), "motors", terminal=terminal)
    running.at_step(1)
    ignored = next(
        line for line in Path(f"/proc/{running.process.pid}/status").read_text().splitlines() if "SigIgn" in line
    )
    for number in (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU):
        assert int(ignored.split()[1], 16) >> (number - 1) & 1
    time.sleep(0.3)
    assert values(tmp_path) == STEPS[1] and "2. " not in running.out.read_text()
    os.write(user, b"\n")
    running.wait_for("2. maximum")
    os.close(user)  # the terminal has gone
    os.close(terminal)
    assert running.end()[0] != 0
    assert values(tmp_path) == [*STEPS[2], 1100.0]


@pytest.mark.parametrize(("safe", "says"), [(0.0, "stuck; then it took its safe values"), (1234.0, "NOT SAFE, cut")])
def test_a_device_that_fails(tmp_path: Path, calibrating: Callable[..., Calibration], safe: float, says: str) -> None:
    """It does not take 1234: the minimum, or even the safe value."""
    device = tmp_path / "fin"
    device.touch()
    lines = f"device esc 0 {build_driver(tmp_path)}:fin {device}", "output motors esc"
    plan = write_plan(tmp_path, *lines, pulse(0, "throw", 0.0, 1.0, 1234.0, 1300.0, 2000.0, 0.0, safe))
    running = calibrating(plan, "motors")
    if safe != 1234.0:
        running.at_step(2)
        running.enter()
    status, complaint = running.end()
    assert status == 1 and says in complaint
    assert float(device.read_text().split()[-1]) == safe


def test_nothing_moves_without_the_word(tmp_path: Path) -> None:
    done = run(tmp_path, "calibrate", "esc", plan_of_log(tmp_path), "--channels", "motors", status=2)
    assert "nothing moves without --yes-move-it. PROPELLERS OFF" in done.stderr
    assert "motors[0]  number  2000     1000     1100" in done.stderr
    assert not (tmp_path / "log").exists()


def test_a_guard_has_the_device(tmp_path: Path) -> None:
    plan = plan_of_log(tmp_path)
    line = ["fcsl-guard", "-c", "import time; time.sleep(60)", "--actuator", f"motors=log:{tmp_path / 'log'}"]
    with subprocess.Popen(line, executable=sys.executable) as guard:
        try:
            deadline = time.monotonic() + 60.0
            while not Path(f"/proc/{guard.pid}/cmdline").read_bytes().startswith(b"fcsl-guard"):  # exec sets it late
                assert time.monotonic() < deadline
            done = run(tmp_path, "calibrate", "esc", plan, "--channels", "motors", "--yes-move-it", status=1)
        finally:
            guard.kill()
    assert f"motors[0] must not move: fcsl-guard (process {guard.pid}) drives this device" in done.stderr
    assert not (tmp_path / "log").exists()


@pytest.mark.parametrize(
    ("names", "says"),
    [
        (["motor"], "did you mean `motors[0]`?"),
        (["motors[1]"], "it has motors[0], rudder[0], spare[0]"),
        (["motors", "rudder"], "motors[0] and rudder[0] are of two devices"),
        (["spare"], "the safe value of spare[0], 2000, is its longest pulse"),
        ([], "expected at least one argument"),
    ],
)
def test_wrong_usage(tmp_path: Path, names: list[str], says: str) -> None:
    plan = write_plan(
        tmp_path,
        *(f"device {name} 0 log {tmp_path / name}" for name in ("one", "two", "three")),
        *("output motors one", pulse(0, "number", *MOTOR), "output rudder two", pulse(0, "number", *MOTOR)),
        *("output spare three", pulse(0, "number", 0.0, 1.0, 1000.0, 1500.0, 2000.0, 0.0, 2000.0)),
    )
    done = run(tmp_path, "calibrate", "esc", plan, "--yes-move-it", "--channels", *names, status=2)
    assert says in done.stderr
    assert not any((tmp_path / name).exists() for name in ("one", "two", "three"))
