# SPDX-License-Identifier: Apache-2.0
"""docs/bus.md: its plant, which is a Python script over Zenoh's own package, flies the lander."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
from pathlib import Path

from test_wires import free_port

from simclient.replay import replay

ROOT = Path(__file__).resolve().parents[1]
LONG_S = 120


def test_the_plant_of_the_page_flies_the_lander(tmp_path: Path) -> None:
    (script,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/bus.md").read_text(), re.DOTALL)
    (tmp_path / "plant.py").write_text(script)
    machine = ROOT / "examples/lander/fc/lander_control.json"
    subprocess.run(["fcslc", "build", machine, "-o", tmp_path], check=True, capture_output=True)
    library, bag = tmp_path / "liblander_control.so", tmp_path / "bag"
    place = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    line = [sys.executable, tmp_path / "plant.py", place]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as plant:
        options = ["--hal", f"zenoh:{place}", "--timeout-ms", "30000", "--record", bag]
        flown = subprocess.run(
            ["fcsl-fc", library, *options], capture_output=True, text=True, timeout=LONG_S, check=False
        )
        said, _ = plant.communicate(timeout=LONG_S)
    assert flown.returncode == 0, flown.stdout + flown.stderr
    (speed,) = re.findall(r"touchdown at ([0-9.]+) m/s", said)
    assert float(speed) < 2.0
    assert replay(bag, library=str(library)).identical
