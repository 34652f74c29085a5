# SPDX-License-Identifier: Apache-2.0
"""What fcsl-fc prints of the HAL's log: each change of the arm flag, or how many lines were lost."""

from __future__ import annotations

import json
import re
from pathlib import Path

from native import flying

from fcsl_compiler.driver.cache import build_machine

TOGGLE = """class Toggle:
    outputs = {"on": "bool"}

    def execute(self):
        self.on = not self.on
"""
#: A change per tick: more than are printed meanwhile, and few enough for a pipe to hold a line of each.
TICKS = 1500


def test_each_change_of_the_arm_flag_is_printed_or_counted(tmp_path: Path) -> None:
    config = {
        "tick_hz": 1000,
        "initial_state": "RUN",
        "algorithms": {"Toggle": {"source": "toggle.py"}},
        "instances": {"toggle": {"algorithm": "Toggle"}},
        "states": {"RUN": {"schedule": {"toggle": 1000}}},
        "channels": [{"name": "on", "id": 1, "field": "toggle.outputs.on", "direction": "actuator", "safe": False}],
        "arm": "toggle.on",
    }
    (tmp_path / "toggle.py").write_text(TOGGLE)
    (tmp_path / "toggling.json").write_text(json.dumps(config))
    library = build_machine(tmp_path / "toggling.json").library
    with flying("--socket", tmp_path / "fc.sock", "--paused", library=str(library)) as fc:
        client = fc.client(tmp_path / "fc.sock")
        client.ok("tick", count=TICKS)
        client.close()
        code, out, err = fc.stop()
    assert (code, err) == (0, "")
    changes = re.findall(r"^fcsl-fc: (disarmed|armed) at tick (\d+)$", out, re.MULTILINE)
    lost = [int(n) for n in re.findall(r"^fcsl-fc: (\d+) lines were not printed: whoever", out, re.MULTILINE)]
    assert changes[:3] == [("armed", "0"), ("disarmed", "1"), ("armed", "2")]
    assert lost and len(changes) + sum(lost) == TICKS
