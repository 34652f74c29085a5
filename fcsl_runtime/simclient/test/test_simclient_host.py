# SPDX-License-Identifier: Apache-2.0
"""What a host may and may not do to a machine: ranges of parameters, injected faults, samples that are old already."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from simclient import AlgTwin, PyTwin, TwinError
from simclient.bag import Bag
from simclient.bag.digest import digest
from simclient.replay import replay

LAW = """
class Law:
    inputs = {"angle": "f64[2] rad"}
    outputs = {"runs": "i64", "force": "f64 N", "transition_request": "TransitionRequest"}
    parameters = {
        "gain": "f64 N/rad in -1.5..10",
        "open": "f64 in 0..",
        "single": "f32 in 0.1..0.7",
        "vector": "f64[3] in ..1",
        "small": "i32 in -5..5",
        "big": "i64 in -9223372036854775808..9007199254740992",
        "word": "u32 in 1..",
        "long_word": "u64 in ..9223372036854775808",
        "free": "f64",
    }
    state = {"total": "f64"}

    def execute(self):
        self.runs += 1
        self.total += self.gain * self.angle[0]
        self.force = self.total
        if self.runs % 7 == 0:
            self.transition_request = "SWITCH"
"""

#: Parameters: struct format, low, high. None bounds nothing.
BOUNDS: dict[str, tuple[str, Any, Any]] = {
    "gain": ("d", Fraction(-3, 2), Fraction(10)),
    "open": ("d", Fraction(0), None),
    "single": ("f", Fraction(float(np.float32(0.1))), Fraction(float(np.float32(0.7)))),
    "small": ("i", -5, 5),
    "big": ("q", -(2**63), 2**53),
    "word": ("I", 1, None),
    "long_word": ("Q", None, 2**63),
}
_FLOATS = {"d": st.floats(), "f": st.floats(width=32)}
_INTEGERS = {"i": (-(2**31), 2**31 - 1), "q": (-(2**63), 2**63 - 1), "I": (0, 2**32 - 1), "Q": (0, 2**64 - 1)}


def config() -> dict[str, Any]:
    values = {"gain": 1, "open": 0, "single": 0.5, "vector": [0, 0, 1], "small": 0, "big": 0, "word": 1, "long_word": 0}
    channel = {"name": "imu.angle", "id": 1, "field": "law.inputs.angle", "direction": "sensor", "max_age_ticks": 3}
    return {
        "tick_hz": 100,
        "initial_state": "A",
        "algorithms": {"Law": {"source": "law.py"}},
        "instances": {"law": {"algorithm": "Law", "parameters": {**values, "free": 0}, "max_wcet_us": 500}},
        "states": {"A": {"schedule": {"law": 100}}, "B": {"schedule": {"law": 50}}},
        "transitions": [
            {"from": "A", "to": "B", "request": "SWITCH"},
            {"from": "B", "to": "A", "health": {"instance": "law", "in": ["failed"]}},
        ],
        "channels": [channel],
    }


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("host")
    (folder / "law.py").write_text(LAW)
    (folder / "craft.json").write_text(json.dumps(config()))
    return folder / "craft.json"


@pytest.fixture(scope="module", params=[AlgTwin, PyTwin], ids=["compiled", "CPython"])
def twin(request: pytest.FixtureRequest, path: Path) -> Iterator[AlgTwin]:
    with request.param.from_config(path) as opened:
        yield opened


# ---- ranges -----------------------------------------------------------------------------------------------------------


def values_near(kind: str, low: Any, high: Any) -> st.SearchStrategy[Any]:
    """Any value of the type, and often one at a bound or next to it."""
    edges = [edge for edge in (low, high) if edge is not None]
    if kind in _INTEGERS:
        least, most = _INTEGERS[kind]
        near = [n for edge in edges for n in (edge - 1, edge, edge + 1) if least <= n <= most]
        return st.sampled_from(near) | st.integers(least, most)
    real = np.float32 if kind == "f" else np.float64
    near = [float(np.nextafter(real(float(e)), real(to))) for e in edges for to in (-math.inf, math.inf)]
    return st.sampled_from([*near, *map(float, edges), math.nan, math.inf, -math.inf, -0.0]) | _FLOATS[kind]


def within(value: float, low: Any, high: Any) -> bool:
    """Exact: no digit is lost on the way."""
    if isinstance(value, float) and not math.isfinite(value):
        return (value == math.inf and high is None) or (value == -math.inf and low is None)
    exact = Fraction(value)
    return (low is None or exact >= low) and (high is None or exact <= high)


@pytest.mark.parametrize("name", BOUNDS)
def test_a_value_is_taken_where_it_lies_in_the_range(twin: AlgTwin, name: str) -> None:
    kind, low, high = BOUNDS[name]
    where = f"law.parameters.{name}"

    @settings(max_examples=150)
    @given(values_near(kind, low, high))
    @example(math.nan if kind in _FLOATS else 0)
    def check(value: Any) -> None:
        before = twin.get_value(where)
        if within(value, low, high):
            twin.set(where, value)
            assert twin.get_value(where) == value
        else:
            with pytest.raises(TwinError, match=rf"{where}.*\[.+, .+\]"):
                twin.set(where, value)
            assert twin.get_value(where) == before

    check()


def test_the_message_has_the_range(twin: AlgTwin) -> None:
    cases: dict[str, tuple[Any, str]] = {
        "gain": (-100.0, "[-1.5, 10]"),
        "open": (-1.0, "[0, inf]"),
        "vector": ([0.0, 2.0, 0.0], "[-inf, 1]"),
        "single": (1.0, "[0.1, 0.7]"),
        "big": (2**53 + 1, "[-9223372036854775808, 9007199254740992]"),
    }
    for name, (value, text) in cases.items():
        with pytest.raises(TwinError) as refused:
            twin.set(f"law.parameters.{name}", value)
        assert str(refused.value) == f"'law.parameters.{name}' lies in {text}"


def test_an_array_is_set_whole_or_not_at_all(twin: AlgTwin) -> None:
    where = "law.parameters.vector"
    twin.set(where, [-1e300, 0.5, 1.0])
    for bad in ([0.0, 0.0, 1.5], [math.nan, 0.0, 0.0]):
        with pytest.raises(TwinError, match="lies in"):
            twin.set(where, bad)
    with pytest.raises(TwinError, match="lies in"):
        twin.set(f"{where}[1]", 1.0000000000000002)
    assert twin.get_value(where) == [-1e300, 0.5, 1.0]


def test_a_parameter_without_range_takes_everything(twin: AlgTwin) -> None:
    for value in (math.nan, math.inf, -1e308):
        twin.set("law.parameters.free", value)
        assert struct.pack("d", twin.get_value("law.parameters.free")) == struct.pack("d", value)


def test_the_descriptor_has_the_ranges(twin: AlgTwin) -> None:
    gain, vector, free = (twin.describe(f"law.parameters.{n}") for n in ("gain", "vector", "free"))
    assert (gain.minimum, gain.maximum, gain.bounded) == (-1.5, 10.0, True)
    assert (vector.minimum, vector.maximum, vector.bounded) == (-math.inf, 1.0, True)
    assert (free.minimum, free.maximum, free.bounded) == (-math.inf, math.inf, False)
    assert "-1.5 to 10" in str(gain) and " to " not in str(free)
    assert not any(f.bounded for f in twin.fields() if f.role != "parameter")


# ---- injected faults and old samples ------------------------------------------------------------------------------------


def test_an_injected_fault_is_one_of_its_own(twin: AlgTwin) -> None:
    with pytest.raises(TwinError, match="did you mean `law`"):
        twin.fault("lw")
    before = twin.get_value("law.outputs.runs"), twin.get_value("law.counters.faults")
    twin.fault("law")
    twin.fault("law")  # it is a state, not a count
    twin.tick(2)
    after = twin.get_value("law.outputs.runs"), twin.get_value("law.counters.faults")
    assert (after[0] - before[0], after[1] - before[1]) == (1, 1)


def test_a_checkpoint_holds_an_injected_fault(path: Path) -> None:
    with AlgTwin.from_config(path) as one, PyTwin.from_config(path) as other:
        one.fault("law")
        other.restore(one.save())
        other.tick()
        assert other.get_value("law.counters.faults") == 1 and one.get_value("law.counters.faults") == 0


def fly(twin: AlgTwin, ticks: int) -> None:
    """Faults, overruns and samples of every age and stamp, in an order without pattern."""
    rng = np.random.default_rng(4)
    twin._run.attach()
    for k in range(ticks):
        if rng.random() < 0.4:
            age = int(rng.choice([0, 0, 1, 3, 4, 2**32 - 1]))
            stamp = int(rng.choice([0, k * 10**7 - 12345, -1, 2**62]))
            sample = struct.pack("<2d", rng.normal(), math.nan if rng.random() < 0.1 else 1.0)
            twin._run.write_channel(0, sample, age, stamp)
        if rng.random() < 0.1:
            twin.fault("law")
        if rng.random() < 0.1:
            twin.overrun("law")
        if rng.random() < 0.1:
            twin.set("law.parameters.gain", float(rng.uniform(-1.5, 10)))
        twin.tick()


def test_records_of_both_twins_are_one_and_replay(path: Path, tmp_path: Path) -> None:
    with AlgTwin.from_config(path) as compiled, PyTwin.from_config(path) as python:
        for twin, bag in ((compiled, "compiled"), (python, "python")):
            twin.record(tmp_path / bag)
            fly(twin, 300)
            twin.stop_recording()
        assert [compiled.get_value(f.path) for f in compiled.fields() if "angle" not in f.path] == [
            python.get_value(f.path) for f in python.fields() if "angle" not in f.path
        ]
        faults, stamp = compiled.get_value("law.counters.faults"), compiled.get_value("channels.imu.angle.stamp_ns")
        assert isinstance(faults, int) and faults > 10 and stamp != 0
    assert digest(tmp_path / "compiled") == digest(tmp_path / "python")
    for bag in ("compiled", "python"):
        verdict = replay(tmp_path / bag, str(path))
        assert verdict.identical and verdict.ticks == 300, str(verdict)


def test_the_record_names_faults_ages_and_stamps(path: Path, tmp_path: Path) -> None:
    """Of the many NaNs that a sensor may send the record has one, as the machine has."""
    sent, nan = bytes.fromhex("010000000000f8ff"), bytes.fromhex("000000000000f87f")
    with AlgTwin.from_config(path) as twin:
        twin.record(tmp_path / "bag")
        twin._run.write_channel(0, struct.pack("<d", 1.0) + sent, 2, 123_456_789)
        twin.fault("law")
        twin.tick()
        twin._run.write_channels({0: struct.pack("<2d", 1.0, 2.0)})
        twin.tick()
    bag = Bag(tmp_path / "bag")
    writes = [bag.decode("/craft/record/writes", data) for _, _, data in bag.messages(["/craft/record/writes"])]
    assert [(w.tick, w.kind, w.path, w.age_ticks, w.stamp_ns, bytes(w.data)) for w in writes] == [
        (0, 3, "imu.angle", 2, 123_456_789, struct.pack("<d", 1.0) + nan),
        (0, 7, "law", 0, 0, b""),
        (1, 3, "imu.angle", 0, 0, struct.pack("<2d", 1.0, 2.0)),
    ]


def test_a_sample_that_does_not_fit_is_refused(path: Path) -> None:
    with AlgTwin.from_config(path) as twin:
        with pytest.raises(TwinError, match="no sensor channel number 1"):
            twin._run.write_channel(1, b"")
        with pytest.raises(TwinError, match="'imu.angle' has 16 bytes, not 8"):
            twin._run.write_channel(0, bytes(8))
        twin.tick()
        assert twin.get_value("channels.imu.angle.stamp_ns") == 0
