# SPDX-License-Identifier: Apache-2.0
"""`fcsl sim --pil`: the flight of a processor compared with that of this process. fcsl-fc stands for the processor, at the other end of a
serial line; an emulated Cortex-M7 flies in `make verify`."""

from __future__ import annotations

import json
import os
import pty
import select
import shutil
import subprocess
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.api.build import build_machine
from fcsl_sim import SimError, boards, load, pil
from fcsl_sim.cli import main

ROOT = Path(__file__).resolve().parents[2]
LANDER = ROOT / "examples/lander/sim/lander.sim.json"
MACHINE = ROOT / "examples/lander/fc/lander_control.json"


@contextmanager
def serial_line() -> Iterator[tuple[str, str]]:
    """The names of its two ends: pseudo-terminals, between which a thread carries bytes."""
    (one, here), (other, there) = pty.openpty(), pty.openpty()
    for end in (here, there):
        tty.setraw(end)
    stop_read, stop = os.pipe()

    def carry() -> None:
        while True:
            ready, _, _ = select.select([one, other, stop_read], [], [])
            if stop_read in ready:
                return
            for end in ready:
                os.write(other if end == one else one, os.read(end, 4096))

    thread = threading.Thread(target=carry)
    thread.start()
    try:
        yield os.ttyname(here), os.ttyname(there)
    finally:
        os.close(stop)
        thread.join()
        for end in (one, here, other, there, stop_read):
            os.close(end)


def fly(machine: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict[str, Any]]:
    """Exit status and document, with this machine at the other end."""
    library = build_machine(machine).library
    with serial_line() as (here, there):
        line = ["fcsl-fc", library, "--hal", f"wire:uart:{there}:921600", "--timeout", "60"]
        with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as processor:
            try:
                arguments = [
                    str(LANDER),
                    "--pil",
                    f"uart:{here}:921600",
                    "--duration",
                    "2",
                    "--json",
                    "--timeout",
                    "60",
                ]
                status = main(["run", *arguments])
            finally:
                processor.kill()
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    return status, document


def test_a_processor_that_flies_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    status, said = fly(MACHINE, capsys)
    assert (status, said["equal"], said["difference"]) == (0, True, None)
    assert said["here"]["ticks"] == said["there"]["ticks"] == 200
    assert said["here"]["truth"] == said["there"]["truth"] and said["there"]["fields"] is None


def test_a_processor_that_flies_otherwise(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The flight ends at once, with the tick and its time."""
    shutil.copytree(MACHINE.parent, tmp_path / "fc")
    changed = tmp_path / "fc" / MACHINE.name
    changed.write_text(MACHINE.read_text().replace('"climb_rate": 8.0', '"climb_rate": 1.0'))
    status, said = fly(changed, capsys)
    ticks = said["there"]["ticks"]
    assert (status, said["equal"]) == (1, False) and 0 < ticks < 200
    assert said["difference"] == f"the truth of tick {ticks - 1}, at {(ticks - 1) / 100:g} s, is another one"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--pil", "qemu:mps3"], ["no such board", "mps2-an500"]),
        (["--pil", "tcp:127.0.0.1:7600"], ["qemu:mps2-an500", "uart:/dev/ttyACM0:921600"]),
        (["--pil", "uart:/dev/none:9600"], ["/dev/none"]),
        (["--pil", "qemu:mps2-an500", "--record", "bag", "--speed", "1"], ["`--record`, `--speed`", "--external"]),
        (["--timeout", "1"], ["--pil"]),
    ],
)
def test_arguments_that_make_no_sense(
    arguments: list[str], words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", str(LANDER), "--duration", "0.1", *arguments]) == 2
    said = capsys.readouterr().err
    assert all(word in said for word in words), said


def test_without_qemu_the_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boards.shutil, "which", lambda _: None)
    with pytest.raises(SimError, match="apt-get install qemu-system-arm"):
        pil.compare(load(LANDER, duration_s=1), "qemu:mps2-an500", 1000)


def test_a_firmware_that_ends_early_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its own words, and no wait for the end of the time limit."""
    monkeypatch.setitem(boards.BOARDS, "mps2-an500", boards.Board("cortex-m7", ("sh", "-c", "echo no room; exit 3")))
    monkeypatch.setattr(pil, "build", lambda *_: tmp_path / "firmware.elf")
    with pytest.raises(SimError, match="status 3: no room"):
        pil.compare(load(LANDER, duration_s=1), "qemu:mps2-an500", 60_000)
