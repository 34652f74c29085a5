# SPDX-License-Identifier: Apache-2.0
"""Debounce, Timer and Edge against NumPy and SciPy on random signals; breaks, delays between periods, changed rates."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import ndimage, signal

from simclient import AlgTwin, PyTwin


def chatter(seed: int, runs: int = 300) -> np.ndarray[Any, Any]:
    """A signal with runs of random lengths, at first false."""
    lengths = np.random.default_rng(seed).geometric(0.15, size=runs)
    return np.repeat(np.arange(runs) % 2 == 1, lengths)[:runs]


def follow(debounce: Any, signals: Any) -> list[bool]:
    return [bool(debounce.step(signal=bool(s))["value"]) for s in signals]


@pytest.mark.parametrize(("delay", "runs"), [(0.0, 0), (0.01, 1), (0.03, 3), (0.07, 7), (0.1, 10), (0.102, 11)])
def test_an_on_delay_is_an_erosion(block: Callable[..., Any], delay: float, runs: int) -> None:
    """True where the signal has been true in this run and the `runs` before: a moving sum of SciPy."""
    x = chatter(1)
    found = follow(block("logic.py", "Debounce", on_delay=delay), x)
    assert found == (signal.lfilter(np.ones(runs + 1), [1.0], x) == runs + 1).tolist()
    assert any(found) and (found != x.tolist() or runs == 0)


@pytest.mark.parametrize("runs", [1, 4, 10])
def test_an_off_delay_is_a_dilation(block: Callable[..., Any], runs: int) -> None:
    x = chatter(2)
    found = follow(block("logic.py", "Debounce", off_delay=runs / 100), x)
    window = np.ones(2 * runs + 1, bool)
    window[:runs] = False  # of the runs before alone
    assert found == ndimage.binary_dilation(x, window).tolist()


@pytest.mark.parametrize(("on", "off", "initial"), [(3, 5, False), (8, 2, True), (0, 4, True), (4, 4, False)])
def test_both_delays(block: Callable[..., Any], on: int, off: int, initial: bool) -> None:
    """The value changes where the windows of the last on + 1 or off + 1 runs are all true or all false."""
    x = chatter(3)
    found = follow(block("logic.py", "Debounce", on_delay=on / 100, off_delay=off / 100, initial=initial), x)
    rises = signal.lfilter(np.ones(on + 1), [1.0], x) == on + 1
    falls = signal.lfilter(np.ones(off + 1), [1.0], ~x) == off + 1
    expected, value = [], initial
    for rise, fall in zip(rises, falls, strict=True):
        value = bool(rise or (value and not fall))
        expected.append(value)
    assert found == expected and len(set(found)) == 2


@pytest.mark.parametrize("initial", [False, True])
def test_after_a_break_the_signal_must_hold_again(block: Callable[..., Any], initial: bool) -> None:
    debounce = block("logic.py", "Debounce", on_delay=0.02, off_delay=0.02, initial=initial)
    assert follow(debounce, [not initial] * 3) == [initial, initial, not initial]
    debounce.rest()
    assert follow(debounce, [not initial] * 3) == [initial, initial, not initial]
    follow(debounce, [initial] * 2)
    debounce.rest()  # the time that had passed is forgotten
    assert follow(debounce, [not initial] * 3) == [initial, initial, not initial]


def test_delays_are_times(block: Callable[..., Any]) -> None:
    for rate in (100, 500):
        found = follow(block("logic.py", "Debounce", rate=rate, on_delay=0.1), [True] * rate)
        assert found.index(True) == rate // 10


def test_delays_change_in_flight(block: Callable[..., Any]) -> None:
    debounce = block("logic.py", "Debounce", on_delay=10.0)
    assert follow(debounce, [True] * 5) == [False] * 5
    debounce.set(on_delay=0.06)
    assert follow(debounce, [True] * 2) == [False, True]


@pytest.mark.parametrize("rate", [100, 500])
def test_the_timer_counts_since_the_last_false(block: Callable[..., Any], rate: int) -> None:
    x, timer = chatter(4), block("logic.py", "Timer", rate=rate, delay=4 / rate)
    found = [timer.step(condition=bool(c)) for c in x]
    runs = np.arange(len(x))
    since = np.where(x, runs - np.maximum.accumulate(np.where(x, -1, runs)) - 1, 0)
    np.testing.assert_allclose([f["elapsed"] for f in found], since / rate, atol=1e-12)
    assert [f["done"] for f in found] == (x & (since >= 4)).tolist()


def test_a_long_time_is_met_in_its_run(block: Callable[..., Any]) -> None:
    """2000 sums of 0.002 s, each rounded."""
    timer = block("logic.py", "Timer", rate=500, delay=4.0)
    done = [timer.step(condition=True)["done"] for _ in range(2005)]
    assert done.index(True) == 2000 and all(done[2000:])


def test_the_timer_begins_anew_after_a_break(block: Callable[..., Any]) -> None:
    timer = block("logic.py", "Timer", delay=0.05)
    assert [timer.step(condition=True)["done"] for _ in range(6)][-1]
    timer.rest()
    assert timer.step(condition=True) == {"elapsed": 0.0, "done": False, "health": "nominal"}
    timer.rest()
    assert timer.step(condition=False) == {"elapsed": 0.0, "done": False, "health": "nominal"}


def test_the_delay_of_the_timer_changes_in_flight(block: Callable[..., Any]) -> None:
    timer = block("logic.py", "Timer")
    assert not timer.step(condition=False)["done"] and timer.step(condition=True)["done"]
    timer.set(delay=0.02)
    assert [timer.step(condition=True)["done"] for _ in range(3)] == [False, True, True]


@pytest.mark.parametrize("twin_class", [AlgTwin, PyTwin])
def test_the_time_goes_on_where_the_next_state_has_another_rate(tmp_path: Path, twin_class: Any) -> None:
    config = {
        "tick_hz": 1000,
        "initial_state": "SLOW",
        "algorithms": {"Timer": {"source": "package://fcsl_blocks/logic.py"}},
        "instances": {"timer": {"algorithm": "Timer", "parameters": {"delay": 0.05}, "inputs": {"condition": True}}},
        "connections": [{"from": f"machine.{n}", "to": f"timer.{n}"} for n in ("period", "resumed")],
        "states": {"SLOW": {"schedule": {"timer": 100}}, "FAST": {"schedule": {"timer": 500}}},
        "transitions": [],
    }
    (tmp_path / "rates.json").write_text(json.dumps(config))
    twin = twin_class.from_config(tmp_path / "rates.json")
    twin.tick(30)  # runs at 0, 10 and 20 ms
    twin.set_state("FAST")
    done = []
    for _ in range(15):  # runs at 30, 32, ... ms
        twin.tick(2)
        done.append(twin.get_value("timer.outputs.done"))
    assert done == [False] * 10 + [True] * 5


def test_edges_are_differences(block: Callable[..., Any]) -> None:
    x, edge = chatter(5), block("logic.py", "Edge")
    found = [edge.step(signal=bool(s)) for s in x]
    steps = np.diff(x.astype(int), prepend=int(x[0]))
    assert [f["rising"] for f in found] == (steps > 0).tolist()
    assert [f["falling"] for f in found] == (steps < 0).tolist()


@pytest.mark.parametrize(("before", "after"), [(False, True), (True, False)])
def test_a_break_makes_no_edge(block: Callable[..., Any], before: bool, after: bool) -> None:
    edge = block("logic.py", "Edge")
    none = {"rising": False, "falling": False, "health": "nominal"}
    assert edge.step(signal=before) == none
    edge.rest()
    assert edge.step(signal=after) == none
    assert edge.step(signal=before) == {"rising": before, "falling": after, "health": "nominal"}


@pytest.mark.parametrize("class_", ["Debounce", "Timer"])
def test_extreme_delays_cause_no_fault(block: Callable[..., Any], class_: str) -> None:
    logic = block("logic.py", class_)
    names = ["on_delay", "off_delay"] if class_ == "Debounce" else ["delay"]
    port = "signal" if class_ == "Debounce" else "condition"
    rng = np.random.default_rng(6)
    for _ in range(100):
        logic.set(**{n: float(rng.choice([0.0, -0.0, 5e-324, 1e-9, 0.01, 1e300])) for n in names})
        assert logic.step(**{port: bool(rng.integers(2))})["health"] == "nominal"
    assert logic.native.get_value("block.counters.faults") == 0
