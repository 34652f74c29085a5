# SPDX-License-Identifier: Apache-2.0
"""What every kind of twin does alike: several values at once, faults, channels, and the record of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simclient import AlgTwin, PyTwin, Twin, TwinError, diff
from simclient.bag import Bag
from simclient.replay import replay

ROOT = Path(__file__).resolve().parents[3]
Open = Callable[..., Twin]


# ---- several values at once -------------------------------------------------------------------------------------------


def test_several_values_are_set_or_none(twin: Twin) -> None:
    twin.set_many({"sensors.outputs.altitude": 5, "watch.parameters.limit": 7.5, "watch.inputs.wish": 2.0})
    paths = ("sensors.outputs.altitude", "watch.parameters.limit", "watch.inputs.wish")
    assert twin.get_many(paths) == dict(zip(paths, (5.0, 7.5, 2.0), strict=True))
    before = twin.save()
    for path, value, reason in (
        ("watch.parameters.floor", 501.0, "lies in"),
        ("watch.parameters.floor", math.nan, "lies in"),
        ("watch.outputs.health", "failed", "read-only"),
        ("watch.parameters.floor", "x", "f64 wanted"),
        ("watch.parameters.flor", 1.0, "did you mean `watch.parameters.floor`"),
    ):
        with pytest.raises(TwinError, match=reason):
            twin.set_many({"sensors.outputs.altitude": 99.0, "watch.parameters.limit": 1.0, path: value})
        assert twin.save() == before
    with pytest.raises(TwinError, match="did you mean"):
        twin.get_many(["watch.outputs.cont"])


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


@pytest.mark.parametrize(
    "words", [("fault", "degraded"), ("failed", "fault"), ("failed", "degraded"), ("fault", "fault")]
)
def test_of_several_injections_the_worst_counts(twin: Twin, words: tuple[str, str]) -> None:
    twin.set("sensors.outputs.altitude", 5.0)
    twin.tick(3)
    for word in words:
        twin.fault("watch") if word == "fault" else twin.force_health("watch", word)
    twin.tick()
    faulted = "fault" in words
    assert twin.get_value("watch.outputs.health") == "failed"
    assert twin.get_value("watch.counters.faults") == faulted
    assert twin.get_value("watch.outputs.count") == (3 if faulted else 4)


def test_wrong_names(twin: Twin) -> None:
    for refused in (twin.fault, twin.overrun, lambda name: twin.force_health(name, "failed")):
        with pytest.raises(TwinError, match="did you mean `watch`"):
            refused("wach")
    with pytest.raises(TwinError, match="degraded' or 'failed', not 'stale'"):
        twin.force_health("watch", "stale")
    for refused in (lambda: twin.sample("altt", 1.0), lambda: twin.silence("altt"), lambda: twin.attach("altt")):
        with pytest.raises(TwinError, match=r"not a sensor channel; did you mean `alt`\?; there are: alt, gyro"):
            refused()
    with pytest.raises(TwinError, match="never expires"):
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


@pytest.mark.parametrize("kind", [AlgTwin, PyTwin])
def test_a_path_is_no_run(kind: Callable[[Any], Twin], craft: Path) -> None:
    for path in (craft, str(craft)):
        with pytest.raises(TypeError, match=r"Twin\.from_config\(path\) opens a machine"):
            kind(path)


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
