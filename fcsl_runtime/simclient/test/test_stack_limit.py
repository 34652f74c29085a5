# SPDX-License-Identifier: Apache-2.0
"""A machine that needs more stack than a thread has is refused, with both figures."""

from __future__ import annotations

import json
import re
import resource
import subprocess
from pathlib import Path

import pytest
from native import PROGRAM as FC

from simclient import AlgTwin, PyTwin
from simclient.errors import TwinError

HELPER = """
def h{n}(a: "f64[65536]", k: i32) -> "f64[65536]":
    b = a
    b[k % 65536] += 1.0
    c = {inner}
    c[(k + 7) % 65536] += b[(k + 3) % 65536]
    return c
"""


def deep(folder: Path, calls: int) -> Path:
    helpers = [HELPER.format(n=n, inner=f"h{n - 1}(b, k + 1)" if n else "b") for n in range(calls)]
    law = (
        'class Law:\n    inputs = {"k": "i32"}\n    outputs = {"y": "f64"}\n    state = {"x": "f64[65536]"}\n\n'
        f"    def execute(self):\n        self.x = h{calls - 1}(self.x, self.k)\n        self.y = self.x[7]\n"
    )
    (folder / "law.py").write_text("from fcsl_builtins import f64, i32\n" + "".join(helpers) + "\n\n" + law)
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Law": {"source": "law.py"}},
        "instances": {"law": {"algorithm": "Law"}},
        "states": {"RUN": {"schedule": {"law": 100}}},
    }
    (folder / "m.json").write_text(json.dumps(config))
    return folder / "m.json"


def test_too_deep_for_the_stack(tmp_path: Path) -> None:
    limit = resource.getrlimit(resource.RLIMIT_STACK)[0]
    if limit == resource.RLIM_INFINITY or limit > 16 << 20:
        pytest.skip("this shell has a stack for it")
    config = deep(tmp_path, 20)
    text = r"machine 'm' needs about \d{8} bytes of stack in a tick, and this thread has \d+ left"
    with pytest.raises(TwinError, match=text):
        AlgTwin.from_config(config)
    built = subprocess.run(["fcslc", "build", config, "-o", tmp_path], capture_output=True, text=True, check=True)
    assert "warning: that is more than 1048576 bytes" in built.stdout
    line = [FC, tmp_path / "libm.so", "--ticks", "3"]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and re.search(text, done.stderr), done.stderr
    more = subprocess.run(["bash", "-c", 'ulimit -s 131072; exec "$@"', "-", *line], capture_output=True, check=False)
    assert more.returncode == 0
    with PyTwin.from_config(config) as twin:  # CPython has its arrays elsewhere
        assert twin.tick() == 1


def test_what_fits_runs(tmp_path: Path) -> None:
    with AlgTwin.from_config(deep(tmp_path, 3)) as twin:
        assert twin.tick(3) == 3
