# SPDX-License-Identifier: Apache-2.0
"""docs/hardware/hal.md: its steps with the lander, run in their order. A folder stands for the lidar."""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path

from simclient.replay import replay

ROOT = Path(__file__).resolve().parents[1]
(PAGE,) = re.findall(r"^## Bring-up\n(.*?)^## ", (ROOT / "docs/hardware/hal.md").read_text(), re.DOTALL | re.MULTILINE)
LIBRARY = ROOT / "install/lander/lib/lander/liblander_machines.so"
FENCED = r"```{kind}\n(.*?)^```$"


def fenced(kind: str, text: str) -> str:
    found = re.search(FENCED.format(kind=kind), text, re.MULTILINE | re.DOTALL)
    assert found
    return found[1]


def add_members(file: Path, added: dict[str, dict[str, object]]) -> None:
    """Adds the members of the objects in `added` to those of the same name in the file."""
    whole = json.loads(file.read_text())
    for name, members in added.items():
        whole[name] = whole.get(name, {}) | members
    file.write_text(json.dumps(whole))


def test_the_steps(tmp_path: Path) -> None:
    for folder in ("examples", "install"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    device = tmp_path / "sys/bus/iio/devices/iio:device0"
    device.mkdir(parents=True)
    for name, text in {"name": "lidar", "in_distance_raw": "250", "in_distance_scale": "0.01"}.items():
        (device / name).write_text(f"{text}\n")
    said = {}
    variables, parts = fenced("sh", PAGE), re.split(r"^<!-- (step|file|members): (.*) -->$", PAGE, flags=re.MULTILINE)
    for kind, name, text in zip(parts[1::3], parts[2::3], parts[3::3], strict=True):
        if kind == "file":
            (tmp_path / name).write_text(fenced("json", text))
            continue
        if kind == "members":
            add_members(tmp_path / name, json.loads(fenced("json", text)))
            continue
        done = subprocess.run(
            ["bash", "-uc", f"{variables}\n{fenced('sh', text)}"],
            cwd=tmp_path,
            env={**os.environ, "FCSL_SYSFS": str(tmp_path / "sys")},
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        said[name] = done.stdout + done.stderr
    assert said["simulated"].count("end: ") == 2, said["simulated"]
    assert "lidar" in said["list"] and "2.5" in said["list"], said["list"]
    assert "no sensor feeds channel `velocity`" in said["board"] and "2.5" in said["board"], said["board"]
    assert "sensor 'altimeter': primary is device 'lidar'" in said["composite"], said["composite"]
    whole = replay(tmp_path / "one_real", library=str(LIBRARY), board=tmp_path / "board.plan")
    assert whole.identical and whole.ticks > 250, str(whole)
    assert re.search(r"fcsl-guard: armed, at tick \d+", said["guard"]), said["guard"]
    assert re.findall(r" number=(\S+)\s", said["guard"])[-1] == "1000", said["guard"]  # safe at the end
