# SPDX-License-Identifier: Apache-2.0
"""A connected input that a host sets: accepted, recorded, overwritten by the next copy, and every kind of twin warns."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simclient import AlgTwin, OverwrittenWarning, Twin, TwinError
from simclient.bag import Bag
from simclient.replay import replay

SENSORS = """
class Sensors:
    outputs = {"altitude": "f64 m", "pose": "Pose"}

    def execute(self):
        pass
"""
WATCH = """
class Watch:
    inputs = {
        "altitude": "f64 m",
        "pose": "Pose",
        "last": "i64",
        "step_s": "f64 s",
        "wish": "f64",
        "fresh": "bool",
        "age": "u32",
        "since": "f64 s",
        "ticks": "u64",
    }
    outputs = {"seen": "f64 m", "seen_last": "i64", "seen_step": "f64 s", "count": "i64"}

    def execute(self):
        self.seen = self.altitude + self.pose.height
        self.seen_last = self.last
        self.seen_step = self.step_s
        self.count += 1
"""
COUNTER = """
class Counter:
    outputs = {"count": "i64"}

    def execute(self):
        self.count += 1
"""
#: `watch` runs in every other tick of RUN, and in no tick of REST.
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "structs": {"Pose": {"height": "f64 m", "valid": "bool"}},
    "algorithms": {
        "Sensors": {"source": "sensors.py"},
        "Watch": {"source": "watch.py"},
        "Counter": {"source": "counter.py"},
    },
    "instances": {
        "sensors": {"algorithm": "Sensors"},
        "watch": {"algorithm": "Watch"},
        "counter": {"algorithm": "Counter"},
    },
    "connections": [
        {"from": "sensors.altitude", "to": "watch.altitude"},
        {"from": "sensors.pose", "to": "watch.pose"},
        {"from": "counter.count", "to": "watch.last", "delayed": True, "initial": -1},
        {"from": "machine.dt", "to": "watch.step_s"},
    ],
    "states": {
        "RUN": {"schedule": {"sensors": 100, "watch": 50, "counter": 100}},
        "REST": {"schedule": {"sensors": 100}},
    },
}
#: The same with a sensor, of which `watch` hears.
HEARD = {
    **CONFIG,
    "connections": [
        *CONFIG["connections"],
        {"from": "channels.baro.fresh", "to": "watch.fresh"},
        {"from": "channels.baro.age_ticks", "to": "watch.age"},
        {"from": "machine.elapsed", "to": "watch.since"},
        {"from": "machine.ticks_in_state", "to": "watch.ticks"},
    ],
    "channels": [{"name": "baro", "id": 1, "field": "sensors.outputs.altitude", "direction": "sensor"}],
}
ALTITUDE, LAST, STEP = "watch.inputs.altitude", "watch.inputs.last", "watch.inputs.step_s"
POSE = {"height": 2.0, "valid": True}


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("connected")
    for name, text in (("sensors", SENSORS), ("watch", WATCH), ("counter", COUNTER)):
        (folder / f"{name}.py").write_text(text)
    (folder / "connected.json").write_text(json.dumps(CONFIG))
    (folder / "heard.json").write_text(json.dumps(HEARD))
    return folder / "connected.json"


@pytest.fixture
def twin(open_twin: Callable[[Path], Twin], config: Path) -> Twin:
    return open_twin(config)


def told(act: Callable[[], object]) -> list[str]:
    """What `act` warns of, all at the line that calls the twin."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        act()
    assert all(w.category is OverwrittenWarning and w.filename == __file__ for w in caught)
    return [str(w.message) for w in caught]


def set_quietly(twin: Twin, path: str, value: Any) -> None:
    assert len(told(lambda: twin.set(path, value))) == 1


def test_it_holds_until_its_instance_runs(twin: Twin) -> None:
    twin.set("sensors.outputs.altitude", 5.0)
    twin.tick()
    set_quietly(twin, ALTITUDE, 9.0)
    kept = twin.save()
    twin.tick()  # `watch` is not due
    assert twin.get_value(ALTITUDE) == 9.0 and twin.get_value("watch.outputs.seen") == 5.0
    twin.tick()
    assert twin.get_value(ALTITUDE) == 5.0 and twin.get_value("watch.outputs.seen") == 5.0
    twin.restore(kept)
    assert twin.get_value(ALTITUDE) == 9.0


def test_it_holds_while_no_state_schedules_its_instance(twin: Twin) -> None:
    twin.tick()
    twin.set_state("REST")
    set_quietly(twin, ALTITUDE, 9.0)
    twin.tick(10)
    assert twin.get_value(ALTITUDE) == 9.0
    twin.set_state("RUN")
    twin.tick(2)
    assert twin.get_value(ALTITUDE) == 0.0


def test_a_delayed_connection_copies_likewise(twin: Twin) -> None:
    """But for the first tick, which has no tick before it: what is set stands for the connection's `initial`."""
    set_quietly(twin, LAST, 77)
    twin.tick()
    assert twin.get_value("watch.outputs.seen_last") == 77
    set_quietly(twin, LAST, 78)
    twin.tick()
    assert twin.get_value(LAST) == 78
    twin.tick()
    assert twin.get_value(LAST) == twin.get_value("watch.outputs.seen_last") == 2


def test_what_the_machine_feeds_is_overwritten_too(twin: Twin) -> None:
    assert twin.describe(STEP).connected_from == "the machine" and STEP not in twin.machine.host_inputs
    (text,) = told(lambda: twin.set(STEP, 9.0))
    assert text == f"{STEP} is connected from the machine, which is copied over it when `watch` next runs"
    assert twin.get_value(STEP) == 9.0
    twin.tick()
    assert twin.get_value(STEP) == twin.get_value("watch.outputs.seen_step") == 0.01


def test_the_warning_names_the_source_and_what_to_do(twin: Twin) -> None:
    told_of = told(lambda: twin.set(ALTITUDE, 1.0))
    assert told_of == [
        "watch.inputs.altitude is connected from sensors.outputs.altitude, which is copied over it when `watch` next "
        'runs; set sensors.outputs.altitude, or open `watch` without `sensors`: from_instances(…, ["watch"])'
    ]
    whole = "watch.inputs.pose is connected from sensors.outputs.pose, "
    for path, value in (("watch.inputs.pose", POSE), ("watch.inputs.pose.height", 1.0)):
        (text,) = told(lambda path=path, value=value: twin.set(path, value))
        assert text.startswith(whole)
    assert told(lambda: twin.set_many({"watch.inputs.wish": 1.0, "sensors.outputs.altitude": 2.0})) == []


def test_there_is_one_warning_for_a_call(twin: Twin) -> None:
    three = {"watch.inputs.pose": POSE, ALTITUDE: 1.0, "watch.inputs.wish": 2.0, LAST: 3}
    (text,) = told(lambda: twin.set_many(three))
    assert text.startswith(
        "watch.inputs.pose (from sensors.outputs.pose), watch.inputs.altitude (from sensors.outputs.altitude), "
        "watch.inputs.last (from counter.outputs.count) are connected, and their sources are copied over them "
    )
    (text,) = told(lambda: twin.set_many({**three, STEP: 1.0}))
    assert "watch.inputs.last (from counter.outputs.count), 1 more are connected" in text
    assert twin.get_many(three) == three


def test_what_is_refused_is_not_warned_of(twin: Twin) -> None:
    before = twin.save()

    def refused() -> None:
        with pytest.raises(TwinError, match="f64 wanted"):
            twin.set_many({ALTITUDE: 1.0, "watch.inputs.wish": "x"})

    assert told(refused) == [] and twin.save() == before


def test_a_subset_without_the_source_takes_it(config: Path) -> None:
    with AlgTwin.from_instances(config, ["watch"]) as twin:
        assert told(lambda: twin.set(ALTITUDE, 9.0)) == []
        twin.tick()
        assert twin.get_value("watch.outputs.seen") == 9.0


def drive(twin: Twin) -> None:
    """Sets every kind of connected input, when `watch` is due and when it is not."""
    rng = np.random.default_rng(13)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OverwrittenWarning)
        for tick in range(60):
            if tick in (25, 40):
                twin.set_state("REST" if tick == 25 else "RUN")
            values = {ALTITUDE: rng.normal(), LAST: int(rng.integers(9)), STEP: rng.normal()}
            twin.set_many({path: value for path, value in values.items() if rng.random() < 0.5})
            twin.set_many({"sensors.outputs.altitude": rng.normal(), "watch.inputs.pose.height": rng.normal()})
            twin.tick()


def test_it_is_recorded_and_replayed_bit_for_bit(twin: Twin, config: Path, tmp_path: Path) -> None:
    twin.record(tmp_path / "bag")
    drive(twin)
    twin.stop_recording()
    bag = Bag(tmp_path / "bag")
    recorded = bag.machine()
    writes = [bag.decode_own(recorded.writes, data, ("path",)).path for _, _, data in bag.messages({recorded.writes})]
    assert {ALTITUDE, LAST, STEP, "watch.inputs.pose.height"} <= set(writes)
    verdict = replay(tmp_path / "bag", str(config))
    assert verdict.identical and verdict.ticks == 60, verdict
    with AlgTwin.from_config(config) as other:
        drive(other)
        assert twin.snapshot() == other.snapshot()


def test_a_profile_may_write_it(twin: Twin, open_twin: Callable[[Path], Twin], config: Path, tmp_path: Path) -> None:
    with twin.trace(ALTITUDE, "watch.outputs.seen") as trace:
        (text,) = told(lambda: twin.inject({ALTITUDE: np.arange(1.0, 5.0), "watch.inputs.wish": np.ones(4)}))
    assert text.startswith("watch.inputs.altitude is connected from sensors.outputs.altitude, ")
    assert trace[ALTITUDE].tolist() == [0.0, 2.0, 0.0, 4.0] and not trace["watch.outputs.seen"].any()
    twin.record(tmp_path / "bag")
    told(lambda: twin.inject({ALTITUDE: np.arange(1.0, 5.0)}))
    twin.stop_recording()
    other = open_twin(config)
    with other.trace(ALTITUDE) as again:
        assert len(told(lambda: other.inject(tmp_path / "bag"))) == 1
    assert again[ALTITUDE].tolist() == [0.0, 2.0, 0.0, 4.0]


def test_what_a_channel_and_the_machine_offer(open_twin: Callable[[Path], Twin], config: Path, tmp_path: Path) -> None:
    """Settable as every connected input is: recorded, warned of, overwritten when `watch` next runs."""
    twin = open_twin(config.with_name("heard.json"))
    told_of = told(lambda: twin.set("watch.inputs.age", 7))
    assert told_of == [
        "watch.inputs.age is connected from channels.baro.age_ticks, which is copied over it when `watch` next runs"
    ]
    (text,) = told(lambda: twin.set("watch.inputs.fresh", True))
    assert text.startswith("watch.inputs.fresh is connected from the machine, ")
    twin.record(tmp_path / "bag")
    seen = []
    for tick in range(12):
        if tick in (3, 8):
            twin.sample("baro", float(tick))
        if tick == 5:
            set_quietly(twin, "watch.inputs.since", 9.0)
        if tick == 6:
            twin.set_state("RUN")
        twin.tick()
        seen.append(twin.get_many([f"watch.inputs.{n}" for n in ("fresh", "age", "since", "ticks")]))
    twin.stop_recording()
    fresh, age, since, ticks = (list(values) for values in zip(*(row.values() for row in seen), strict=True))
    assert fresh == [False] * 4 + [True] * 2 + [False] * 2 + [True] * 2 + [False] * 2
    assert since == [0.02] * 5 + [9.0] + [0.02] * 6 and ticks == [0, 0, 2, 2, 4, 4, 0, 0, 2, 2, 4, 4]
    assert age[:4] == [0] * 4
    verdict = replay(tmp_path / "bag", str(config.with_name("heard.json")))
    assert verdict.identical and verdict.ticks == 12, verdict
