# SPDX-License-Identifier: Apache-2.0
"""docs/start/first_vehicle.md runs as printed: its files and commands in their order, and what they print."""

from __future__ import annotations

import os
import re
import signal
import subprocess
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryFile

import numpy as np
import pytest

from simclient import bag
from simclient.bag.digest import digest

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs/start/first_vehicle.md").read_text()
BLOCK = re.compile(r"(?:<!-- file: (\S+) -->\n)?```(\w+)\n(.*?)```\n", re.DOTALL)
BLOCKS: list[tuple[str, str, str]] = BLOCK.findall(PAGE)
#: What a shell would still know in a later block.
ASSIGNMENT = re.compile(r"^(?:export )?\w+=(?!\$!)\S+$", re.MULTILINE)
#: The first gains are too low: the campaign says so.
STATUS = {"fcsl campaign lift.study.json\n": 1}


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What each block of commands prints, by its text; the folder of the vehicle is under `folder`."""
    top = tmp_path_factory.mktemp("first_vehicle")
    found = {"folder": str(top / "lift")}
    before = ""
    for name, language, text in BLOCKS:
        if name:
            (top / "lift" / name).write_text(text)
        elif language == "sh":
            found[text] = run(before + text, top / "lift" if found.keys() - {"folder"} else top, STATUS.get(text, 0))
            before += "".join(f"{line}\n" for line in ASSIGNMENT.findall(text))
    return found


def run(commands: str, folder: Path, status: int) -> str:
    with TemporaryFile("w+") as output:
        shell = subprocess.Popen(
            ["bash", "-euc", commands], cwd=folder, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
        )
        try:
            shell.wait(timeout=300)
        except subprocess.TimeoutExpired:
            pass  # its status is none; what it printed says where it stood
        finally:
            with suppress(ProcessLookupError):
                os.killpg(shell.pid, signal.SIGKILL)  # what a failure leaves behind
            output.seek(0)
            printed = output.read()
    assert shell.returncode == status, f"{commands}\n{printed}"
    return printed


def test_every_block_is_tried() -> None:
    """A block is a file, commands, or what the commands before it print."""
    assert PAGE.count("```") == 2 * len(BLOCKS)
    for (_, before, _), (name, language, _) in pairwise(BLOCKS):
        assert name or language == "sh" or (language, before) == ("text", "sh")


def test_commands_print_what_is_shown(said: dict[str, str]) -> None:
    shown = [(before, text) for (_, _, before), (_, language, text) in pairwise(BLOCKS) if language == "text"]
    assert len(shown) >= 4
    for commands, text in shown:
        lines = [re.escape(line).replace("…", ".*") for line in text.splitlines()]
        assert re.search("^" + "\n(?:.*\n)*?".join(lines) + "$", said[commands], re.MULTILINE), said[commands]


def test_the_tests_of_the_page_pass(said: dict[str, str]) -> None:
    assert all("3 passed" in text for commands, text in said.items() if "fcsl test\n" in commands)


def test_the_lever_flies_it(said: dict[str, str]) -> None:
    """In real time, with the potentiometer and the pulses of the folder that stands for /sys."""
    folder = Path(said["folder"])
    flown = next(text for commands, text in said.items() if "fcsl-guard build" in commands)
    assert "sensor 'lever': primary is device 'potentiometer'" in flown
    assert re.search(r"fcsl-guard: armed, at tick \d+", flown) and "fcsl-guard: disarmed" in flown
    _, height = bag.columns(bag.Bag(folder / "flight"), "estimate.outputs.height")
    assert 1.1 < max(height) < 1.35 and height[-1] < 0.2
    assert (folder / "sys/class/pwm/pwmchip0/pwm0/duty_cycle").read_text().strip() == "1000000"  # ns: at rest
    assert (folder / "flight.png").stat().st_size > 10_000
    assert (folder / "lift.campaign/report.html").stat().st_size > 10_000


def test_blocks_alone_fly_a_quadrotor(said: dict[str, str]) -> None:
    recorded = bag.Bag(Path(said["folder"]) / "quad")
    t_s, height = bag.columns(recorded, "/sim/earth:height")
    _, q = bag.columns(recorded, "/sim/body:attitude_body_to_inertial")
    _, position = bag.columns(recorded, "/sim/body:position_inertial")
    tilt = np.degrees(2.0 * np.arcsin(np.hypot(q[:, 1], q[:, 2])))
    hovers = (t_s > 7.0) & (t_s < 9.0)
    assert np.abs(height[hovers] - 1.2).max() < 0.06 and tilt[hovers].max() < 0.5
    assert 4.0 < tilt[(t_s > 5.0) & (t_s < 5.5)].max() < 30.0  # the blow
    assert height[-1] == pytest.approx(0.15, abs=0.01) and tilt[-1] < 0.1
    assert np.hypot(*position[-1, :2]) == pytest.approx(2.7, abs=0.1)
    assert (Path(said["folder"]) / "quad.png").stat().st_size > 10_000


def test_gains_that_were_set_in_flight_stay(said: dict[str, str]) -> None:
    folder = Path(said["folder"])
    tuned, adopted = (bag.Bag(folder / name) for name in ("tuned_flight", "adopted_flight"))
    assert digest(tuned) == digest(adopted)
    recorded = bag.Bag(folder / "day")
    assert len(list((folder / "day").glob("*.mcap"))) >= 2
    flown = next(text for commands, text in said.items() if "--times" in commands)
    assert re.search(r"^estimate +.*\d", flown, re.MULTILINE) and "armed" in str(
        list(recorded.messages("/lift/events"))
    )
    assert '"kp": 20.0, "kd": 9.0, "ki": 12.0' in (folder / "lift.json").read_text()
