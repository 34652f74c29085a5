# SPDX-License-Identifier: Apache-2.0
"""What every kind of twin does alike: several values at once, conditions, traces, profiles, faults, channels, comparisons."""

from __future__ import annotations

import csv
import json
import math
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from simclient import AlgTwin, BagError, Twin, TwinError, diff
from simclient.bag import Bag
from simclient.replay import replay
from simclient.twin.close import assert_close
from simclient.twin.condition import FUNCTIONS

ROOT = Path(__file__).resolve().parents[2]

SENSORS = """
class Outputs:
    altitude: "f64 m"
    gyro: "f64[3] rad/s"


def execute() -> None:
    pass
"""

WATCH = """
from fcsl_builtins import Health, TransitionRequest


class Inputs:
    altitude: "f64 m"
    sensors_health: Health
    wish: f64


class Parameters:
    limit: "f64 m in 0..1000"
    floor: "f64 m in ..500"


class Outputs:
    count: i64
    table: "f64[2,3]"
    best: Target
    targets: "Target[2]"
    ok: bool


class State:
    sum: "f64 m"


def execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:
    y.count += 1
    x.sum += u.altitude
    y.ok = u.altitude < p.limit
    y.table[1, 2] = u.altitude
    y.best.pos[0] = x.sum
    y.best.seen = y.ok
    y.targets[1].pos[1] = u.wish
    if u.sensors_health == Health.failed:
        y.health = Health.degraded
    if u.altitude > p.limit:
        y.transition_request = TransitionRequest.STOP
"""

CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "structs": {"Target": {"pos": "f64[2] m", "seen": "bool"}},
    "algorithms": {"sensors": {"source": "sensors.py"}, "watch": {"source": "watch.py"}},
    "instances": {
        "sensors": {"algorithm": "sensors"},
        "watch": {"algorithm": "watch", "parameters": {"limit": 100, "floor": 1}, "max_wcet_us": 100},
    },
    "connections": [
        {"from": "sensors.outputs.altitude", "to": "watch.inputs.altitude"},
        {"from": "sensors.outputs.health", "to": "watch.inputs.sensors_health"},
    ],
    "states": {"RUN": {"schedule": {"sensors": 100, "watch": 100}}, "SAFE": {"schedule": {"sensors": 100}}},
    "transitions": [
        {"from": "RUN", "to": "SAFE", "request": "STOP", "priority": 2},
        {"from": "RUN", "to": "SAFE", "health": {"instance": "watch", "in": ["failed"]}, "priority": 1},
    ],
    "channels": [
        {"name": "alt", "id": 1, "field": "sensors.outputs.altitude", "direction": "sensor", "max_age_ticks": 3},
        {"name": "gyro", "id": 2, "field": "sensors.outputs.gyro", "direction": "sensor"},
        {"name": "sum", "id": 3, "field": "watch.outputs.count", "direction": "actuator"},
    ],
}
Open = Callable[..., Twin]


@pytest.fixture(scope="module")
def craft(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("craft")
    (folder / "sensors.py").write_text(SENSORS)
    (folder / "watch.py").write_text(WATCH)
    (folder / "craft.json").write_text(json.dumps(CONFIG))
    return folder / "craft.json"


@pytest.fixture
def twin(open_twin: Open, craft: Path) -> Twin:
    return open_twin(craft)


# ---- several values at once -------------------------------------------------------------------------------------------


def test_several_values_are_set_or_none(twin: Twin) -> None:
    twin.set_many({"sensors.outputs.altitude": 5, "watch.parameters.limit": 7.5, "watch.inputs.wish": 2.0})
    paths = ("sensors.outputs.altitude", "watch.parameters.limit", "watch.inputs.wish")
    assert twin.get_many(paths) == dict(zip(paths, (5.0, 7.5, 2.0), strict=True))
    before = twin.save()
    for path, value, reason in (
        ("watch.parameters.floor", 501.0, "lies in"),
        ("watch.parameters.floor", math.nan, "lies in"),
        ("watch.inputs.altitude", 1.0, "read-only"),
        ("watch.parameters.floor", "x", "f64 wanted"),
        ("watch.parameters.flor", 1.0, "did you mean `watch.parameters.floor`"),
    ):
        with pytest.raises(TwinError, match=reason):
            twin.set_many({"sensors.outputs.altitude": 99.0, "watch.parameters.limit": 1.0, path: value})
        assert twin.save() == before
    with pytest.raises(TwinError, match="did you mean"):
        twin.get_many(["watch.outputs.cont"])


# ---- conditions -------------------------------------------------------------------------------------------------------


def test_run_until(twin: Twin) -> None:
    twin.set("sensors.outputs.altitude", 2.0)
    assert twin.run_until("watch.outputs.count >= 5 and machine.state == 'RUN'", 100) == 5
    assert twin.run_until(lambda t: t.get_value("watch.outputs.table[1,2]") == 2.0, 0) == 0
    assert twin.run_until("abs(watch.outputs.table[1, 2] - 1 - 1) < 1e-9 and not watch.outputs.count < 7", 10) == 2
    assert twin.run_until("1 < watch.outputs.count <= 8 and machine.state in ('SAFE', 'RUN')", 10) == 0
    twin.set("sensors.outputs.altitude", 200.0)
    assert twin.run_until("machine.state == 'SAFE' and 'AF' in machine.state", 10) == 2
    assert twin.run_until("watch.outputs.transition_request == '' or 'SAFE' == machine.state", 10) == 0
    assert twin.get_value("machine.tick") == 9


def test_a_condition_is_true_or_false(twin: Twin) -> None:
    assert (
        twin.run_until("true and not false and True and sqrt(4) == 2 and isnan(0 * 1e999) or watch.outputs.ok", 0) == 0
    )
    assert twin.run_until(lambda t: np.float64(t.get_value("watch.state.sum")) == 0.0, 0) == 0
    with pytest.raises(
        TwinError, match="<lambda> gave 'RUN'; a condition is True or False: let it return a comparison"
    ):
        twin.run_until(lambda t: t.state(), 5)  # type: ignore[arg-type, return-value]
    for wrong in (None, 3, True):
        with pytest.raises(TwinError, match="is not a condition; write an expression as a text, or a function"):
            twin.run_until(wrong, 5)  # type: ignore[arg-type]
    for ticks in (10.5, -1, None, True):
        with pytest.raises(TwinError, match=r"run_until\(…, .*\): a number of ticks from 0"):
            twin.run_until("machine.tick > 5", ticks)  # type: ignore[arg-type]


def test_conditions_have_the_functions_of_eval() -> None:
    protocol = (ROOT / "docs" / "protocol.md").read_text()
    (listed,) = re.findall(
        r"^\*\*`eval`\*\*.*parentheses, `([a-z ]+)`, numbers, `true`, `false`", protocol, re.MULTILINE
    )
    assert set(listed.split()) == set(FUNCTIONS)
    source = (ROOT / "fcsl_runtime" / "src" / "vars" / "expression_atom.c").read_text()
    (compiled,) = re.findall(r"functions\[\] = \{(.*)\}", source)
    assert set(re.findall(r"\w+", compiled)) == set(FUNCTIONS)


def test_a_condition_that_never_holds_says_what_it_read(twin: Twin) -> None:
    twin.set("sensors.outputs.altitude", 3.0)
    with pytest.raises(TwinError) as failed:
        twin.run_until("watch.state.sum > 100 or watch.outputs.targets[0].seen", 4)
    assert str(failed.value) == (
        "`watch.state.sum > 100 or watch.outputs.targets[0].seen` does not hold after 4 ticks; "
        "the machine is at tick 4, in state RUN\n  watch.state.sum = 12.0 m\n  watch.outputs.targets[0].seen = False"
    )

    def high(t: Twin) -> bool:
        return bool(t.get_value("watch.state.sum") > 100)

    with pytest.raises(TwinError, match=r"^high does not hold after 2 ticks(.|\n)*watch.state.sum = 18.0 m$"):
        twin.run_until(high, 2)


@pytest.mark.parametrize(
    ("condition", "reason"),
    [
        ("watch.outputs.cont > 1", "did you mean `watch.outputs.count`"),
        ("watch.outputs.count >", "is not a condition"),
        ("__import__('os').system('true')", "is not a condition"),
        ("watch.outputs.count.__class__", "no such field"),
        ("[c for c in 'ab']", "is not a condition"),
        ("(lambda: 1)()", "`(lambda: 1)()` is neither path"),
        ("watch.outputs.table[0:1] == 1", "is not a condition"),
        ("abs(watch.outputs.table[0]) > 1", "cannot be evaluated: bad operand"),
        ("1 / watch.outputs.count > 1", "cannot be evaluated: division by zero\n  watch.outputs.count = 0"),
        ("1" + " + 1" * 200, "too long"),
        ("machine.state == 'SAVE'", "machine.state: state wanted, got 'SAVE'; did you mean `SAFE`"),
        ("machine.state in ('RUN', 'LANDED')", "got 'LANDED'; one of"),
        ("'good' != watch.outputs.health", "one of 'nominal', 'degraded', 'failed', 'stale'"),
        ("machine.tick > 3 and watch.outputs.transition_request == 'GO'", "TransitionRequest wanted, got 'GO'"),
        ("machine.state == 'RUN' or 'SAVE'", "`'SAVE'` is 'SAVE', neither True nor False; compare it: `… == 'SAVE'`"),
        ("watch.outputs.health", "is 'stale', neither True nor False; compare it: `watch.outputs.health == …`"),
        ("not watch.outputs.count", "`watch.outputs.count` is 0, neither True nor False"),
        ("'SAFE'", "is 'SAFE', neither"),
        ("watch.outputs.ok and 1", "`1` is 1, neither"),
        ("watch.outputs.count + 1", "`watch.outputs.count + 1` is a number, neither"),
        ("max(true, watch.outputs.ok)", "is a number, neither"),
        ("[watch.outputs.ok]", "is a list, neither"),
        ("watch.outputs.table[0]", "is [0.0, 0.0, 0.0], neither"),
        ("sqrt(watch.outputs.count - 1) > 0", "cannot be evaluated: math domain error\n  watch.outputs.count = 0"),
        ("true.x", "`true` is neither path"),
    ],
)
def test_what_is_no_condition_is_refused_before_the_first_tick(twin: Twin, condition: str, reason: str) -> None:
    with pytest.raises(TwinError) as failed:
        twin.run_until(condition, 5)
    assert reason in str(failed.value) and twin.get_value("machine.tick") == 0


# ---- traces -----------------------------------------------------------------------------------------------------------


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
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


# ---- profiles ---------------------------------------------------------------------------------------------------------


def test_a_profile_is_sets_and_samples_before_every_tick(twin: Twin) -> None:
    rng = np.random.default_rng(3)
    altitude = np.ma.masked_array(rng.normal(10, 3, 400), mask=rng.random(400) < 0.6)
    wish, limit = rng.normal(size=400), rng.uniform(1, 1000, 400)
    gyro = rng.normal(size=(400, 3))
    checkpoint = twin.save()
    profile = {"alt": altitude, "watch.inputs.wish": wish, "watch.parameters.limit": limit, "gyro": gyro}
    with twin.trace() as given:
        assert twin.inject(profile) == 400
    twin.restore(checkpoint)
    twin.attach("alt", "gyro")
    with twin.trace() as by_hand:
        for k in range(400):
            if not altitude.mask[k]:
                twin.sample("alt", float(altitude[k]))
            twin.set_many({"watch.inputs.wish": wish[k], "watch.parameters.limit": limit[k]})
            twin.sample("gyro", gyro[k])
            twin.tick()
    for field in twin.fields():
        np.testing.assert_array_equal(given[field.path], by_hand[field.path], err_msg=field.path)
    assert not given["channels.alt.valid"].all() and (given["watch.outputs.health"] == "degraded").any()


@pytest.mark.parametrize(
    ("profile", "reason"),
    [
        ({}, "no array"),
        ({"alt": [1.0], "watch.inputs.wish": [1.0, 2.0]}, "different lengths, in ticks: alt 1, watch.inputs.wish 2"),
        ({"watch.inputs.wish": [[1.0]]}, "an array of ticks wanted, got one of 1 × 1"),
        ({"gyro": np.zeros((5, 2))}, "an array of ticks × 3 wanted, got one of 5 × 2"),
        ({"watch.inputs.wish": [True]}, "f64 wanted, got an array of bool"),
        ({"watch.inputs.altitude": [1.0]}, "altitude: read-only: it is connected from sensors.outputs.altitude"),
        ({"watch.outputs.best": [1.0]}, "did you mean"),
        ({"watch.parameters.limit": [1.0, 1001.0]}, "lies in"),
        ({"alt": 3.0}, "alt: an array with a row for every tick wanted, got 3.0"),
        ({"gyro": [[1, 2, 3], [1, 2]]}, "gyro: the rows of the array are of different lengths"),
        ({"gyr": np.zeros((3, 3))}, "`gyr` is neither a sensor channel nor a path; did you mean `gyro`"),
        ({"watch.inputs.wsh": np.zeros(3)}, "did you mean `watch.inputs.wish`"),
        ({"sum": np.zeros(3)}, "`sum` is an actuator channel; there are sensor channels alt, gyro"),
        (None, r"inject\(None\): a dict of paths and arrays, or a bag or its path, wanted"),
    ],
)
def test_what_cannot_be_injected(twin: Twin, profile: Any, reason: str) -> None:
    if profile and "watch.outputs.best" in profile:
        reason = "a struct; give an array for each of its fields"
    with pytest.raises(TwinError, match=reason):
        twin.inject(profile)


def test_a_bag_is_injected(twin: Twin, open_twin: Open, craft: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    twin.tick(3)
    twin.record(tmp_path / "bag")
    with twin.trace() as original:
        altitude = np.ma.masked_array(rng.normal(10, 3, 100), mask=rng.random(100) < 0.5)
        twin.inject({"alt": altitude, "watch.inputs.wish": rng.normal(size=100)})
        twin.set("watch.parameters.limit", 500.0)
        twin.tick(10)
    twin.stop_recording()
    other = open_twin(craft)
    other.tick(17)
    other.set("watch.parameters.limit", 1.0)  # the twin's own parameters count, not the bag's
    with other.trace() as again:
        assert other.inject(tmp_path / "bag") == 110
    for path in ("sensors", "channels", "watch.inputs.wish"):
        for field in twin.fields(path):
            np.testing.assert_array_equal(original[field.path], again[field.path], err_msg=field.path)
    assert (again["machine.state"] == "SAFE").any() and (original["machine.state"] == "RUN").all()
    with pytest.raises(BagError):
        other.inject(tmp_path / "nothing")


def changed(craft: Path, folder: Path, **keys: Any) -> Path:
    """The machine with other values of these keys, in a folder of its own."""
    folder.mkdir()
    for name in ("sensors.py", "watch.py"):
        (folder / name).write_bytes((craft.parent / name).read_bytes())
    (folder / "craft.json").write_text(json.dumps({**CONFIG, **keys}))
    return folder / "craft.json"


def test_a_bag_of_what_a_machine_does_not_have_is_refused(open_twin: Open, craft: Path, tmp_path: Path) -> None:
    """Nothing that it says is left out without a word, but for what another part of the same machine is told."""
    with AlgTwin.from_config(craft) as twin:
        twin.record(tmp_path / "bag")
        twin.inject({"alt": np.full(20, 3.0), "watch.inputs.wish": np.ones(20)})
        twin.stop_recording()
    other_name = [{**CONFIG["channels"][0], "name": "altitude"}, CONFIG["channels"][1]]
    renamed = open_twin(changed(craft, tmp_path / "renamed", channels=other_name))
    with pytest.raises(
        BagError, match="feeds sensor channel `alt`, which machine `craft` does not have; did you mean `al"
    ):
        renamed.inject(tmp_path / "bag")
    wired = [*CONFIG["connections"], {"from": "sensors.outputs.altitude", "to": "watch.inputs.wish"}]
    with pytest.raises(BagError, match="`watch.inputs.wish`: read-only: it is connected from sensors.outputs.altitude"):
        open_twin(changed(craft, tmp_path / "wired", connections=wired)).inject(tmp_path / "bag")
    stranger = changed(craft, tmp_path / "other", channels=[]).rename(tmp_path / "other" / "other.json")
    with pytest.raises(BagError, match="feeds sensor channel `alt`, which machine `other` does not have"):
        open_twin(stranger).inject(tmp_path / "bag")
    with AlgTwin.from_instances(craft, ["sensors"]) as part:
        assert part.inject(tmp_path / "bag") == 20 and part.get_value("sensors.outputs.altitude") == 3.0
    with AlgTwin.from_instances(changed(craft, tmp_path / "part", channels=other_name), ["sensors"]) as part:
        with pytest.raises(
            BagError, match=r"nothing of what its host wrote is for this part of `craft`; call tick\(20\)"
        ):
            part.inject(tmp_path / "bag")
        assert part.get_value("machine.tick") == renamed.get_value("machine.tick") == 0


def test_an_incomplete_bag_is_injected_with_a_word(twin: Twin, craft: Path, tmp_path: Path) -> None:
    twin.record(tmp_path / "bag")
    twin.inject({"alt": np.full(2000, 3.0)})
    twin.stop_recording()
    file = tmp_path / "bag" / "bag_0.mcap"
    whole = file.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    with warnings.catch_warnings(action="error"):
        assert twin.inject(tmp_path / "bag") == 2000
    with pytest.warns(UserWarning, match=r"inject\(\): \d+ ticks; the bag is incomplete: ") as told:
        ticks = twin.inject(tmp_path / "cut.mcap")
    assert 0 < ticks < 2000 and f" {ticks} ticks;" in str(told[0].message) and told[0].filename == __file__


# ---- faults, healths, channels ----------------------------------------------------------------------------------------


def test_a_fault_trips_the_guard(twin: Twin) -> None:
    twin.tick(3)
    twin.fault("watch")
    with twin.trace("watch", "machine") as trace:
        twin.tick(2)
    assert trace["watch.outputs.health"].tolist() == ["failed", "stale"]
    assert trace["watch.counters.faults"].tolist() == [1, 1] and trace["watch.outputs.count"].tolist() == [3, 3]
    assert trace["machine.state"].tolist() == ["RUN", "SAFE"]


def test_an_overrun_degrades(twin: Twin) -> None:
    twin.overrun("watch")
    twin.tick()
    assert twin.get_value("watch.outputs.health") == "degraded" and twin.get_value("watch.counters.overruns") == 1
    with pytest.raises(TwinError, match="max_wcet_us"):
        twin.overrun("sensors")


@pytest.mark.parametrize(("health", "state"), [("degraded", "RUN"), ("failed", "SAFE")])
def test_a_health_is_forced_for_one_execute_that_counts(twin: Twin, health: str, state: str) -> None:
    twin.set("sensors.outputs.altitude", 5.0)
    twin.tick(3)
    twin.force_health("watch", health)
    twin.force_health("sensors", "failed")  # seen by `watch` in the same tick
    with twin.trace("watch", "sensors", "machine") as trace:
        twin.tick(2)
    assert trace["watch.outputs.health"][0] == health and trace["watch.outputs.count"][0] == 4
    assert trace["sensors.outputs.health"].tolist() == ["failed", "nominal"]
    assert trace["watch.inputs.sensors_health"][0] == "failed" and trace["machine.state"][1] == state
    assert trace["watch.counters.faults"].tolist() == [0, 0]
    if state == "RUN":
        assert trace["watch.outputs.health"][1] == "nominal"


def test_a_forced_health_is_no_better_than_the_real_one(twin: Twin) -> None:
    twin.silence("alt")
    twin.force_health("sensors", "degraded")
    twin.overrun("watch")
    twin.force_health("watch", "failed")
    twin.tick()
    assert twin.get_value("sensors.outputs.health") == twin.get_value("watch.outputs.health") == "failed"


def test_wrong_names(twin: Twin) -> None:
    for refused in (twin.fault, twin.overrun, lambda name: twin.force_health(name, "failed")):
        with pytest.raises(TwinError, match="did you mean `watch`"):
            refused("wach")
    with pytest.raises(TwinError, match="degraded' or 'failed', not 'stale'"):
        twin.force_health("watch", "stale")
    for refused in (lambda: twin.sample("altt", 1.0), lambda: twin.silence("altt"), lambda: twin.attach("altt")):
        with pytest.raises(TwinError, match=r"not a sensor channel; did you mean `alt`\?; there are: alt, gyro"):
            refused()
    with pytest.raises(TwinError, match="never becomes too old"):
        twin.silence("gyro")


def test_ages_and_times_that_are_none(twin: Twin) -> None:
    wrong: list[tuple[Any, Any, str]] = [
        (-1, 0, "age_ticks is an integer from 0 to 4294967295, not -1"),
        (2**32, 0, "age_ticks is an integer from 0 to 4294967295, not 4294967296"),
        (1.5, 0, "age_ticks is an integer"),
        (True, 0, "age_ticks is an integer"),
        (0, 2**63, "stamp_ns is an integer from 0 to 9223372036854775807, not 9223372036854775808"),
        (0, "now", "stamp_ns is an integer"),
    ]
    before = twin.save()
    for age, stamp, reason in wrong:
        with pytest.raises(TwinError, match=rf"sample\(\): {reason}"):
            twin.sample("alt", 1.0, age, stamp)
    assert twin.save() == before
    twin.sample("alt", 1.0, np.uint32(2**32 - 2), np.int64(2**63 - 1))
    twin.tick()
    assert twin.get_many(("channels.alt.age_ticks", "channels.alt.stamp_ns")) == {
        "channels.alt.age_ticks": 2**32 - 2,
        "channels.alt.stamp_ns": 2**63 - 1,
    }


def test_arguments_of_another_kind(twin: Twin, craft: Path) -> None:
    wrong: Any = twin
    for call, reason in (
        (lambda: wrong.get_many("machine.tick"), r'get_many\("machine.tick"\): a list of paths wanted'),
        (lambda: wrong.set_many([("watch.inputs.wish", 1.0)]), "a dict of paths and values wanted"),
        (lambda: type(wrong).from_instances(craft, [3]), "a list of names of instances wanted"),
        (lambda: diff(twin.snapshot(), twin.snapshot(), ignore="machine"), "a list of paths wanted"),
        (lambda: diff(twin.snapshot(), twin.snapshot(), ignore=["machne.tick"]), "did you mean `machine.tick`"),
    ):
        with pytest.raises(TwinError, match=reason):
            call()
    twin.set_many({})
    assert twin.inject({"alt": np.zeros(0), "gyro": np.zeros((0, 3))}) == 0


def test_a_silent_channel_is_stale_until_the_next_sample(twin: Twin) -> None:
    twin.tick()
    twin.set("sensors.outputs.altitude", 8.0)
    twin.silence("alt")
    twin.tick(10)
    assert twin.get_value("sensors.outputs.health") == "failed" and twin.get_value("watch.outputs.health") == "degraded"
    assert twin.get_value("channels.alt.valid") is False and twin.get_value("sensors.outputs.altitude") == 8.0
    twin.sample("alt", 9.0, age_ticks=1, stamp_ns=77)
    twin.tick()
    assert twin.get_value("channels.alt.valid") is True and twin.get_value("channels.alt.age_ticks") == 1
    assert twin.get_value("channels.alt.stamp_ns") == 77 and twin.get_value("sensors.outputs.health") == "nominal"
    twin.attach("alt")
    assert twin.run_until("not channels.alt.valid", 10) == 3  # ages 2, 3, 4: the third is above max_age_ticks


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


# ---- the record ---------------------------------------------------------------------------------------------------------


def test_all_that_a_host_does_is_replayed(twin: Twin, craft: Path, tmp_path: Path) -> None:
    twin.record(tmp_path / "bag")
    twin.attach("alt")
    twin.inject(
        {"alt": np.ma.masked_array(np.arange(20.0), mask=np.arange(20) % 5 != 0), "watch.inputs.wish": np.ones(20)}
    )
    for what in (
        lambda: twin.fault("watch"),
        lambda: twin.overrun("watch"),
        lambda: twin.silence("alt"),
        lambda: twin.force_health("watch", "failed"),
    ):
        what()
        twin.tick(2)
        twin.set_state("RUN")
    twin.stop_recording()
    verdict = replay(Bag(tmp_path / "bag"), str(craft))
    assert verdict.identical and verdict.ticks == 28, str(verdict)
