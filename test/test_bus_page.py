# SPDX-License-Identifier: Apache-2.0
"""docs/reference/transports.md: the plant that it names, a Python script over Zenoh's own package, flies the lander; its source is one."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

from simclient.bus.endpoint import zenoh_locator
from simclient.bus.free_port import free_endpoint
from simclient.replay import replay

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/reference/transports.md").read_text()
PLANT = ROOT / "test/bus_plant.py"
LONG_S = 120


def test_the_plant_of_the_page_flies_the_lander(tmp_path: Path) -> None:
    assert "(../../test/bus_plant.py)" in PAGE
    machine = ROOT / "examples/lander/fc/lander_control.json"
    subprocess.run(["fcslc", "build", machine, "-o", tmp_path], check=True, capture_output=True)
    library, bag = tmp_path / "liblander_control.so", tmp_path / "bag"
    place = free_endpoint()
    line = [sys.executable, PLANT, zenoh_locator(place)]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as plant:
        options = ["--hal", f"zenoh:{place}", "--timeout", "30", "--record", bag]
        flown = subprocess.run(
            ["fcsl-fc", library, *options], capture_output=True, text=True, timeout=LONG_S, check=False
        )
        said, _ = plant.communicate(timeout=LONG_S)
    assert flown.returncode == 0, flown.stdout + flown.stderr
    (speed,) = re.findall(r"touchdown at ([0-9.]+) m/s", said)
    assert float(speed) < 2.0
    assert replay(bag, library=str(library)).identical


def test_the_source_of_the_page_is_one(tmp_path: Path) -> None:
    (script,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "source.py").write_text(script)
    machine, summary = ROOT / "examples/lander/fc/lander_control.json", tmp_path / "summary.json"
    subprocess.run(["fcslc", "build", machine, "-o", tmp_path], check=True, capture_output=True)
    place = free_endpoint()
    with subprocess.Popen([sys.executable, tmp_path / "source.py", zenoh_locator(place)]) as source:
        options = ["--hal", f"zenoh:{place},free-running", "--ticks", "300", "--summary", summary]
        try:
            subprocess.run(["fcsl-fc", tmp_path / "liblander_control.so", *options], check=True, timeout=LONG_S)
        finally:
            source.kill()
    counted = json.loads(summary.read_text())["hal"]
    assert counted["messages"] > 50 and counted["bus.strays"] == counted["bus.wrong_size"] == 0
