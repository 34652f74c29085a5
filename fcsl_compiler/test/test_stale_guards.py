# SPDX-License-Identifier: Apache-2.0
"""W213: a guard with `stale` that may hold only because its state has just been entered. The warning and what the machine
does agree: with it, the time in the state depends on the tick of entry; with the `after_s` that it states, it does not."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine

from fcsl_compiler.driver.passes import compile_machine

ALGORITHM = """class Alg:
    outputs = {"n": "i32"}

    def execute(self):
        self.n += 1
"""
GUARD = {"instance": "nav", "in": ["failed", "stale"]}


def config(tmp_path: Path, states: dict[str, Any], *transitions: dict[str, Any], tick_hz: int = 10) -> Path:
    (tmp_path / "alg.py").write_text(ALGORITHM)
    whole = {
        "tick_hz": tick_hz,
        "initial_state": "A",
        "algorithms": {"Alg": {"source": "alg.py"}},
        "instances": {name: {"algorithm": "Alg"} for name in ("nav", "other")},
        "always": {"other": tick_hz},
        "states": {name: {"schedule": {"nav": rate} if rate else {}} for name, rate in states.items()},
        "transitions": [{"priority": n, **item} for n, item in enumerate(transitions)],
        "requests": ["GO"],
    }
    path = tmp_path / "craft.json"
    path.write_text(json.dumps(whole))
    return path


def edge(source: Any, target: str, **more: Any) -> dict[str, Any]:
    return {"from": source, "to": target, **more}


def failed(instance: str) -> dict[str, Any]:
    return {"health": {"instance": instance, "in": ["failed"]}}


SLOW = {"every": 4}
LATE = {"every": 4, "phase": 2}
OUT = edge("B", "A", health=GUARD)
ENTER = edge("A", "B", after_s=0.5)


@pytest.mark.parametrize(
    ("states", "transitions", "warned"),  # numbers of the transitions with a warning
    [
        ({"A": 0, "B": SLOW}, [ENTER, OUT], [1]),
        ({"A": 0, "B": SLOW}, [ENTER, edge("B", "A", health=GUARD, after_s=0.3)], [1]),
        ({"A": 0, "B": SLOW}, [ENTER, edge("B", "A", health=GUARD, after_s=0.4)], []),
        ({"A": 0, "B": 10}, [ENTER, OUT], []),  # it runs in each tick
        ({"A": 0, "B": SLOW}, [ENTER, edge("B", "A", **failed("nav"))], []),  # no `stale`
        ({"A": 10, "B": SLOW}, [ENTER, OUT], []),  # it goes on
        ({"A": 0, "B": SLOW}, [ENTER, edge("B", "A", health={**GUARD, "instance": "other"})], []),
        ({"A": 0, "B": SLOW}, [edge("B", "A", health=GUARD)], []),  # only a host enters B
        # The initial state: phase 2 is stale for two ticks.
        ({"A": LATE, "B": 0}, [edge("A", "B", health=GUARD)], [0]),
        ({"A": LATE, "B": 0}, [edge("A", "B", health=GUARD, after_s=0.3)], []),
        ({"A": SLOW, "B": 0}, [edge("A", "B", health=GUARD)], []),
        ({"A": SLOW, "B": 0}, [edge("A", "B", health=GUARD, after_s=0.3), edge("B", "A", **failed("other"))], [0]),
        # From a state that is left before it has run it.
        ({"A": 0, "C": SLOW, "B": SLOW}, [edge("A", "C", after_s=0.5), edge("C", "B", after_s=0.1), OUT], [2]),
        ({"A": 0, "C": SLOW, "B": SLOW}, [edge("A", "C", after_s=0.5), edge("C", "B", after_s=0.4), OUT], []),
        ({"A": 0, "C": 10, "B": SLOW}, [edge("A", "C", after_s=0.5), edge("C", "B", after_s=0.1), OUT], []),
        # What enters it needs a run of the instance.
        ({"A": LATE, "B": SLOW}, [edge("A", "B", health={"instance": "nav", "in": ["nominal"]}), OUT], []),
        # One warning for a transition from several states.
        (
            {"A": 0, "B": SLOW, "C": {"every": 5}},
            [ENTER, edge("B", "C", after_s=0.1), edge("*", "A", health=GUARD)],
            [2],
        ),
    ],
)
def test_where_it_can_happen(tmp_path: Path, states: Any, transitions: Any, warned: list[int]) -> None:
    path = config(tmp_path, states, *transitions)
    found = [d for d in compile_machine(path, "").sink.diagnostics if d.code == "W213"]
    text = path.read_text()
    starts = [m.start() for m in re.finditer(r'\{"priority"', text)]
    assert [starts.index(d.span.column - 1) for d in found] == warned


@pytest.mark.parametrize("tick_hz", [10, 30])
def test_the_time_it_proposes_makes_the_phase_irrelevant(tmp_path: Path, tick_hz: int) -> None:
    states = {"A": 0, "B": {"every": 4}}
    go = edge("A", "B", health={"instance": "other", "in": ["degraded"]})
    made = compile_machine(config(tmp_path, states, go, OUT, tick_hz=tick_hz), "")
    (warning,) = [d for d in made.sink.diagnostics if d.code == "W213"]
    (proposed,) = re.findall(r'"after_s": ([\d.]+)', warning.help)
    assert len(_times_in_b(tmp_path / "with", states, go, OUT, tick_hz)) > 1
    mended = edge("B", "A", health=GUARD, after_s=float(proposed))
    assert _times_in_b(tmp_path / "without", states, go, mended, tick_hz) == {20}
    assert "W213" not in [d.code for d in compile_machine(tmp_path / "without" / "craft.json", "").sink.diagnostics]


def _times_in_b(folder: Path, states: Any, go: Any, out: Any, tick_hz: int) -> set[int]:
    """For how many of 20 ticks the machine stays in B, for each phase of its entry."""
    folder.mkdir()
    path, found = config(folder, states, go, out, tick_hz=tick_hz), set()
    for start in range(4):
        m = Machine.build(path)
        m.step(start)
        m.byte(m.instances["other"].inject_fault_offset)[0] = 2  # its health is degraded once
        m.step()
        seen = []
        for _ in range(20):
            m.step()
            seen.append(m.state)
        found.add(seen.count("B"))
    return found
