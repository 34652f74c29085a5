# SPDX-License-Identifier: Apache-2.0
"""Traces of every kind of twin, snapshots, and how values are compared."""

from __future__ import annotations

import csv
import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from simclient import Twin, TwinError, diff
from simclient.twin.close import assert_close

ROOT = Path(__file__).resolve().parents[3]
Open = Callable[..., Twin]


# ---- traces -----------------------------------------------------------------------------------------------------------


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, 9), st.floats(-1e6, 99.0)), min_size=1, max_size=8))
def test_a_trace_has_what_each_tick_left(twin: Twin, runs: list[tuple[int, float]]) -> None:
    """Against reading every value after every tick."""
    paths = ("watch.outputs.count", "watch.outputs.table", "watch.state.sum", "watch.outputs.health", "machine.state")
    begin = twin.get_value("machine.tick")
    checkpoint = twin.save()
    with twin.trace("watch", "machine.state") as trace:
        for ticks, altitude in runs:
            twin.set("sensors.outputs.altitude", altitude)
            twin.tick(ticks)
    twin.restore(checkpoint)
    expected: dict[str, list[Any]] = {path: [] for path in paths}
    for ticks, altitude in runs:
        twin.set("sensors.outputs.altitude", altitude)
        for _ in range(ticks):
            twin.tick()
            for path in paths:
                expected[path].append(twin.get_value(path))
    assert trace.tick.tolist() == list(range(begin, begin + len(trace)))
    for path in paths:
        assert trace[path].tolist() == expected[path]


def test_shapes_and_types(twin: Twin) -> None:
    twin.set_many({"sensors.outputs.altitude": 1.5, "watch.inputs.wish": 4.0})
    trace = twin.trace()
    twin.tick(200)
    trace.stop()
    twin.tick()
    assert len(trace) == 200
    assert list(trace) == [field.path for field in twin.fields()] and all(path in trace for path in trace)
    assert "watch.outputs.table[1]" in trace and "watch.outputs.nothing" not in trace and 0 not in trace
    assert trace["watch.outputs.table"].shape == (200, 2, 3) and trace["watch.outputs.table[1]"].shape == (200, 3)
    assert trace["watch.outputs.table[1][2]"].tolist() == [1.5] * 200
    assert trace["watch.outputs.ok"].dtype == bool and trace["watch.outputs.count"].dtype == np.int64
    best, targets = trace["watch.outputs.best"], trace["watch.outputs.targets"]
    assert best.shape == (200,) and best["pos"].shape == (200, 2) and best["pos"][3, 0] == 6.0 and best["seen"].all()
    assert targets.shape == (200, 2) and (targets["pos"][:, 1, 1] == 4.0).all()
    assert (trace["machine.state"] == "RUN").all() and (trace["watch.outputs.transition_request"] == "").all()
    assert trace.time_s[150] == 1.5 and trace.index(tick=150) == trace.index(time_s=1.507) == 150
    with pytest.raises(TwinError, match="no row of tick 200; it has ticks 0 to 199"):
        trace.index(tick=200)
    with pytest.raises(TwinError, match="takes a tick or a time_s"):
        trace.index()


def test_a_trace_outgrows_its_ring(twin: Twin, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simclient.twin.trace._RING_BYTES", 1)
    monkeypatch.setattr("simclient.twin.trace._MIN_ROWS", 7)
    with twin.trace("watch.outputs.count") as first:
        twin.tick(3)
        with twin.trace("machine.tick") as second:
            twin.tick(50)
            assert first["watch.outputs.count"].tolist() == list(range(1, 54))  # while it goes on
            for _ in range(10):
                twin.tick()
    assert first["watch.outputs.count"].tolist() == list(range(1, 64)) and second.tick.tolist() == list(range(3, 63))
    with pytest.raises(TwinError, match="`watch.outputs.ok` was not traced"):
        first["watch.outputs.ok"]
    with pytest.raises(TwinError, match="did you mean"):
        twin.trace("watch.outputs.cont")


def test_a_trace_outlives_its_twin_and_is_written_as_csv(twin: Twin, tmp_path: Path) -> None:
    twin.set("sensors.outputs.altitude", 0.1)
    trace = twin.trace("watch.outputs")
    twin.tick(3)
    twin.close()
    trace.to_csv(tmp_path / "trace.csv")
    with open(tmp_path / "trace.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["tick"] for row in rows] == ["0", "1", "2"] and rows[2]["time_s"] == "0.02"
    assert [float(row["watch.outputs.table[1][2]"]) for row in rows] == [0.1] * 3
    assert rows[0]["watch.outputs.targets[1].pos[1]"] == "0.0" and rows[0]["watch.outputs.health"] == "nominal"


def test_a_twin_that_runs_by_itself_is_not_traced(twin: Twin) -> None:
    with twin.trace():
        with pytest.raises(TwinError, match=r"leave its block before resume\(\)"):
            twin.resume()
    twin.resume()
    with pytest.raises(TwinError, match=r"call pause\(\) before trace\(\)"):
        twin.trace()
    with pytest.raises(TwinError, match=r"call pause\(\)"):
        twin.inject({"watch.inputs.wish": [1.0]})
    twin.pause()


# ---- comparisons ------------------------------------------------------------------------------------------------------


def test_snapshots(twin: Twin) -> None:
    before = twin.snapshot()
    assert before == twin.snapshot() and not diff(before, twin.snapshot())
    twin.set("watch.inputs.wish", -0.0)
    assert str(diff(before, twin.snapshot())) == (
        "path               before  after  unit\nwatch.inputs.wish  0.0     -0.0"
    )
    twin.set("sensors.outputs.altitude", 2.5)
    twin.tick()
    after = twin.snapshot()
    assert after != before and (before.tick, after.tick) == (0, 1)
    assert after["watch.outputs.table"] == [[0.0] * 3, [0.0, 0.0, 2.5]] == after.values["watch"]["outputs"]["table"]
    assert after["watch.outputs.best"]["pos"] == [2.5, 0.0]
    changes = {
        c.path: (c.before, c.after, c.unit) for c in diff(before, after, ignore=["machine", "watch.inputs"]).changes
    }
    assert changes["watch.outputs.table[1][2]"] == (0.0, 2.5, "") and changes["watch.state.sum"] == (0.0, 2.5, "m")
    assert not [p for p in changes if p.startswith(("machine", "watch.inputs"))]
    assert {c.path for c in diff(before, after).changes} - {
        c.path for c in diff(before, after, ignore=["watch.outputs.table[1]", "watch.state"]).changes
    } == {"watch.outputs.table[1][2]", "watch.state.sum"}


def test_assert_close_passes_and_fails(twin: Twin) -> None:
    twin.set("sensors.outputs.altitude", 2.0)
    with twin.trace() as trace:
        twin.tick(3)
    twin.assert_close("watch.state.sum", 6.0)
    twin.assert_close("watch.outputs.best", {"pos": [6.0, 0.0], "seen": True})
    trace.assert_close("watch.state.sum", [2.0, 4.0, 6.0])
    trace.assert_close("watch.outputs.table", [[0, 0, 0], [0, 0, 2]])
    with pytest.raises(AssertionError) as failed:
        trace.assert_close("watch.state.sum", [2.0, 4.5, 6.0], atol=0.1)
    assert str(failed.value) == (
        "watch.state.sum: 1 of 3 values are not close (rtol 1e-09, atol 0.1)\n"
        "  tick  value            actual  expected  difference  allowed  unit\n"
        "  1     watch.state.sum  4.0     4.5       0.5         0.1      m"
    )
    with pytest.raises(AssertionError, match=r"watch.state.sum(.|\n)*at tick 3, in state RUN(.|\n)* 6.0 +6.1 +0.1 "):
        twin.assert_close("watch.state.sum", 6.1)
    with pytest.raises(AssertionError, match="watch.outputs.best.seen +True +False"):
        twin.assert_close("watch.outputs.best", {"pos": [6.0, 0.0], "seen": False})
    trace.assert_close("watch.state.sum", np.ma.masked_array([2.0, 99.0, 6.0], mask=[False, True, False]))
    trace.assert_close("watch.outputs.table", np.ma.masked_equal([[0, 0, 0], [9, 0, 2]], 9))
    with pytest.raises(AssertionError, match="1 of 3 values"):
        trace.assert_close("watch.state.sum", np.ma.masked_array([2.0, 99.0, 7.0], mask=[False, True, False]))
    for path, expected, said in (
        ("watch.outputs.best", 3, "best: a struct of pos, seen, expected 3"),
        ("watch.outputs.best", {"pos": [6.0, 0.0]}, "best: members pos, seen, expected pos"),
        ("watch.outputs.targets", 3, "targets: 2 structs, expected 3"),
        ("watch.outputs.targets", [1.0], "targets: 2 structs, expected an array of 1"),
    ):
        with pytest.raises(AssertionError, match=said):
            twin.assert_close(path, expected)
    with pytest.raises(AssertionError, match="best: a struct of pos, seen, expected an array of 3 × 3"):
        trace.assert_close("watch.outputs.best", np.zeros((3, 3)))
    with pytest.raises(AssertionError, match="3 ticks, 2 expected"):
        trace.assert_close("watch.state.sum", [2.0, 4.0])
    with pytest.raises(AssertionError, match="'RUN' +'SAFE'"):
        twin.assert_close("machine.state", "SAFE")


@given(
    st.floats(), st.floats(), st.sampled_from([0.0, 1e-9, 0.5]), st.sampled_from([0.0, 1e-3, math.inf]), st.booleans()
)
def test_what_is_close_is_so_to_numpy(
    actual: float, expected: float, rtol: float, atol: float, equal_nan: bool
) -> None:
    """The reference is numpy's isclose, where it does not round (its tolerance is a double)."""
    with warnings.catch_warnings(action="ignore"):  # numpy finds an infinite tolerance odd
        wanted = bool(np.isclose(np.longdouble(actual), np.longdouble(expected), rtol, atol, equal_nan))
    if math.isinf(actual) != math.isinf(expected):
        wanted = False  # with an infinite tolerance numpy says yes
    try:
        assert_close(actual, expected, rtol, atol, equal_nan)
        close = True
    except AssertionError:
        close = False
    assert close == wanted


def test_the_worst_are_shown_first() -> None:
    actual = np.zeros(100)
    actual[[3, 70]] = 1.0, 5.0
    with pytest.raises(AssertionError) as failed:
        assert_close(actual, np.full(100, -1.0), atol=0.1, label="x")
    lines = str(failed.value).splitlines()
    assert lines[0].startswith("x: 100 of 100 values") and lines[2].split()[:2] == ["x[70]", "5.0"]
    assert lines[3].split()[0] == "x[3]" and lines[-1] == "  … and 90 more"
