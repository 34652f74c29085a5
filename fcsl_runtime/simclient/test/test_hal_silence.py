# SPDX-License-Identifier: Apache-2.0
"""What `fcsl hal` says of receivers that give nothing: which bytes arrive, and why no sample comes of them."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from functools import reduce
from pathlib import Path
from typing import Any

import pytest
from hal_rig import HAL, environment, run

GGA = "GNGGA,101736.40,3746.49577,N,12225.16493,W,1,11,0.84,80.4,M,-32.3,M,,"
RMC = "GNRMC,101736.40,A,3746.49577,N,12225.16493,W,27.386,331.19,170524,,,A"


def sentence(body: str, end: str = "\r\n") -> bytes:
    return f"${body}*{reduce(lambda a, b: a ^ b, body.encode()):02X}{end}".encode()


#: Per device: driver, what it sends, how much of it is rejected, and why it is silent.
CASES: dict[str, tuple[str, bytes, bool, str]] = {
    "good": ("nmea", sentence(GGA) + sentence(RMC), False, ""),
    "lines": ("nmea", sentence(GGA, "\n") + sentence(RMC, "\n"), True, "lines arrive that do not end with CR LF"),
    "gga": ("nmea", sentence(GGA), False, "GGA arrives without an RMC of the same time"),
    "cold": (
        "nmea",
        sentence("GNGGA,,,,,,0,00,99.99,,,,,,") + sentence("GNRMC,,V,,,,,,,,,,N"),
        False,
        "sentences arrive without a time: the receiver knows none yet",
    ),
    "other": (
        "ubx",
        sentence(GGA) + sentence(RMC),
        True,
        "bytes arrive, and none are a frame of this protocol: another protocol or baud rate?",
    ),
    "mute": ("ubx", b"", False, "no bytes arrive"),
}


@contextmanager
def receivers() -> Iterator[dict[str, str]]:
    """The ttys of all devices, which send again and again."""
    lines, stop, masters, slaves = {}, threading.Event(), {}, []
    for name in CASES:
        masters[name], slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(masters[name], False)
        lines[name] = os.ttyname(slave)
        slaves.append(slave)

    def send() -> None:
        while not stop.wait(0.1):
            for name, (_, data, _, _) in CASES.items():
                try:
                    os.write(masters[name], data)
                except BlockingIOError:  # nobody reads yet
                    continue

    sender = threading.Thread(target=send)
    sender.start()
    try:
        yield lines
    finally:
        stop.set()
        sender.join()
        for file in (*masters.values(), *slaves):
            os.close(file)


def plan_of(folder: Path, lines: dict[str, str]) -> Path:
    devices = {name: {"driver": CASES[name][0], "device": line} for name, line in lines.items()}
    sensors = {name: {"kind": "gnss", "channels": {}, "backends": [{"device": name}]} for name in lines}
    channels = [{"name": f"{name}.{what}", "id": 2 * i + j, "field": f"pilot.inputs.{name}_{what}", "direction": "sensor"}
                for i, name in enumerate(lines) for j, what in enumerate(("latitude", "longitude"))]  # fmt: skip
    for name, sensor in sensors.items():
        sensor["channels"] = {what: f"{name}.{what}" for what in ("latitude", "longitude")}
    inputs = {channel["field"].rpartition(".")[2]: "f64 deg" for channel in channels}
    (folder / "pilot.py").write_text(
        f"class Pilot:\n    inputs = {inputs!r}\n    outputs = {{'y': 'f64'}}\n    parameters = {{}}\n    state = {{}}\n\n"
        "    def execute(self):\n        self.y = 0.0\n"
    )
    machine: dict[str, Any] = {"tick_hz": 50, "initial_state": "RUN", "algorithms": {"Pilot": {"source": "pilot.py"}}}
    machine |= {"instances": {"pilot": {"algorithm": "Pilot"}}, "connections": [], "transitions": []}
    machine |= {"states": {"RUN": {"schedule": {"pilot": 50}}}, "channels": channels}
    (folder / "craft.json").write_text(json.dumps(machine))
    (folder / "board.json").write_text(json.dumps({"machine": "craft.json", "devices": devices, "sensors": sensors}))
    subprocess.run(["fcslc", "board", folder / "board.json"], check=True, capture_output=True)
    return folder / "board.plan"


def test_the_monitor_says_why_a_receiver_is_silent(tmp_path: Path) -> None:
    expected = {name: why for name, (_, _, _, why) in CASES.items()}
    errors = tmp_path / "errors"
    with receivers() as lines, errors.open("w") as stderr:
        line = [*HAL, "monitor", str(plan_of(tmp_path, lines)), "--json"]
        with subprocess.Popen(
            line, stdout=subprocess.PIPE, stderr=stderr, text=True, env=environment(tmp_path)
        ) as process:
            assert process.stdout is not None
            told: dict[str, Any] = {}
            for text in process.stdout:
                told = {device["name"]: device for device in json.loads(text)["devices"]}
                if {name: device["why"] for name, device in told.items()} == expected:
                    break
            process.send_signal(signal.SIGINT)
            assert process.wait(timeout=60) == 0
    for name, (_, data, is_rejected, _) in CASES.items():
        assert (told[name]["bytes"] > 0) == bool(data) and told[name]["errors"] == 0
        assert (told[name]["rejected"] > 0) == is_rejected
        assert (told[name]["frames"] > 0) == (bool(data) and not is_rejected)
    said = errors.read_text()
    assert all(f"device '{name}' is silent: {why}" in said for name, why in expected.items() if why)
    assert "device 'good' is silent" not in said


def test_what_a_device_tells(tmp_path: Path) -> None:
    """Coordinates to a centimetre; without a sample the reason."""
    with receivers() as lines:
        good = run(tmp_path, "describe", "nmea", lines["good"], "--seconds", "60").stdout
        assert "37.7749295" in good and "-122.4194155" in good
        for name in ("lines", "cold", "other", "mute"):
            driver, _, _, why = CASES[name]
            failed = run(tmp_path, "describe", driver, lines[name], "--seconds", "0.5", status=1)
            assert failed.stderr.rstrip().endswith(f"gave no sample in 0.5 s: {why}")


@pytest.mark.parametrize("sensor", ["good", "lines"])
def test_lines_of_the_monitor(tmp_path: Path, sensor: str) -> None:
    with receivers() as lines:
        plan = plan_of(tmp_path, lines)
        told = run(tmp_path, "monitor", plan, "--sensor", sensor, "--seconds", "4").stdout.splitlines()[-1]
    if sensor == "good":
        assert "latitude 37.7749295 deg  longitude -122.4194155 deg" in told and "rejected" not in told
    else:
        assert f"bytes rejected: {CASES[sensor][3]}" in told
