# SPDX-License-Identifier: Apache-2.0
"""Whatever comes in: no block faults, and none hands on a NaN or an infinity while it says that it is well."""

import json
import math
import random
from pathlib import Path

import numpy as np

from simclient import AlgTwin

EVERY_BLOCK = Path(__file__).with_name("every_block.json")
ODD = [0.0, -0.0, 1.0, -3.0, 0.5, 1e-3, 1e30, -1e300, 1.7e308, 5e-324, math.nan, math.inf, -math.inf]


def test_no_nan_without_a_word() -> None:
    r, names = random.Random(1), list(json.loads(EVERY_BLOCK.read_text())["instances"])
    found = set()
    with AlgTwin.from_config(EVERY_BLOCK) as twin:
        floats = [f for f in twin.fields() if f.type == "f64"]
        inputs = [f for f in floats if f.role == "input" and not f.path.endswith(".period")]
        outputs = {n: [f.path for f in floats if f.path.startswith(f"{n}.outputs.")] for n in names}
        for k in range(200):
            for f in inputs:
                values = np.array([r.choice(ODD if k % 2 else ODD[:6]) for _ in range(f.count)])
                twin.set(f.path, values.reshape(f.shape) if f.shape else float(values[0]))
            twin.tick()
            for name in (n for n in names if twin.get_value(f"{n}.outputs.health") == "nominal"):
                found |= {path for path in outputs[name] if not np.isfinite(twin.get_value(path)).all()}
        assert [n for n in names if twin.get_value(f"{n}.counters.faults")] == []
    assert found == set()
