# SPDX-License-Identifier: Apache-2.0
"""Sources of inputs other than outputs: elapsed time, time in the state, values of sensor channels."""

from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine, write_machine
from fcsl_test_tables import kind, machine

from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.graph.model import dataflow
from fcsl_compiler.model.machine import Machine as Checked

__all__ = ["kind"]  # runs the tests of machines on both kinds

HEARER = """
class Hearer:
    inputs = {
        "elapsed": "f64 s",
        "period": "f64 s",
        "resumed": "bool",
        "ticks": "u64",
        "valid": "bool",
        "age": "u32",
        "fresh": "bool",
        "also_fresh": "bool",
        "divisor": "i32",
    }
    outputs = {"quotient": "i32", "runs": "i32"}

    def execute(self):
        self.runs += 1
        self.quotient = 1 // self.divisor
"""
SENSORS = """
class Sensors:
    outputs = {"altitude": "f64 m", "rate": "f64"}

    def execute(self):
        pass
"""
#: Names of channels that are prefixes of one another.
CONFIG: dict[str, Any] = {
    "tick_hz": 1000,
    "initial_state": "A",
    "instances": {"sensors": {"algorithm": "Sensors"}, "nav": {"algorithm": "Hearer", "inputs": {"divisor": 1}}},
    "connections": [
        {"from": "machine.elapsed", "to": "nav.elapsed"},
        {"from": "machine.period", "to": "nav.period"},
        {"from": "machine.resumed", "to": "nav.resumed"},
        {"from": "machine.ticks_in_state", "to": "nav.ticks"},
        {"from": "channels.baro.valid", "to": "nav.valid"},
        {"from": "channels.baro.age_ticks", "to": "nav.age"},
        {"from": "channels.baro.fresh", "to": "nav.fresh"},
        {"from": "channels.baro.valid.fresh", "to": "nav.also_fresh"},
    ],
    "channels": [
        {"name": "baro", "id": 1, "field": "sensors.outputs.altitude", "direction": "sensor", "max_age_ticks": 2},
        {"name": "baro.valid", "id": 2, "field": "sensors.outputs.rate", "direction": "sensor"},
    ],
    "always": {"sensors": 1000},
    "states": {
        "A": {"schedule": {"nav": 1000}},
        "SLOW": {"schedule": {"nav": {"every": 3, "phase": 1}}},
        "OUT": {},
    },
}


#: What a machine struct has only where a source needs it.
KEPT = ("last_run", "completed", "last_sample", "ticks_in_state")


def craft(tmp_path: Path, **more: Any) -> Machine:
    return machine(tmp_path, {**CONFIG, **more}, hearer=HEARER, sensors=SENSORS)


def inputs(m: Machine, *names: str) -> list[Any]:
    return [m.get(f"nav.inputs.{n}") for n in names]


def test_elapsed_is_the_time_since_the_last_run(tmp_path: Path) -> None:
    """It differs from the period after a change of rate. On a first run, and after a pause, it is the period."""
    m = craft(tmp_path)
    seen = []
    for state in ("A", "A", "SLOW", "SLOW", "SLOW", "SLOW", "SLOW", "SLOW", "A", "OUT", "OUT", "A", "A"):
        m.force_state(state)
        runs = m.get("nav.outputs.runs")
        m.step()
        ran = m.get("nav.outputs.runs") > runs
        seen.append((*inputs(m, "elapsed", "period", "resumed"), m.get("nav.counters.last_run")) if ran else None)
    assert seen == [
        (0.001, 0.001, True, 1),  # tick 0
        (0.001, 0.001, False, 2),
        None,  # SLOW is due at 1, 4, 7
        None,
        (0.003, 0.003, False, 5),  # tick 4; the last run was in tick 1
        None,
        None,
        (0.003, 0.003, False, 8),
        (0.001, 0.001, False, 9),  # tick 8
        None,
        None,
        (0.001, 0.001, True, 12),  # stale after OUT
        (0.001, 0.001, False, 13),
    ]


def test_a_change_of_rate_makes_the_first_elapsed_another_than_the_period(tmp_path: Path) -> None:
    m = craft(tmp_path)
    m.step(3)  # the last run is in tick 2, the next one in tick 4
    m.force_state("SLOW")
    m.step(2)
    assert inputs(m, "elapsed", "period", "resumed") == [0.002, 0.003, False]
    m.step(1)  # tick 5
    m.force_state("A")
    m.step(1)
    assert inputs(m, "elapsed", "period", "resumed") == [0.002, 0.001, False]


def test_elapsed_is_rounded_once(tmp_path: Path) -> None:
    """2 / 3 and 5 / 3 s, each the nearest f64."""
    states = {"A": {"schedule": {"nav": {"every": 2}}}, "B": {"schedule": {"nav": {"every": 5}}}}
    m = craft(tmp_path, tick_hz=3, always={"sensors": 3}, states=states)
    m.step(3)
    assert inputs(m, "elapsed") == [2 / 3]
    m.force_state("B")
    m.step(8)  # due at 5 and 10
    assert inputs(m, "elapsed") == [5 / 3]


@pytest.mark.parametrize("injected", [False, True])
def test_a_run_that_faults_consumes_nothing(tmp_path: Path, injected: bool) -> None:
    """The next run sees the same reset, the whole time and the same sample."""
    m = craft(tmp_path)

    def fault() -> None:
        if injected:
            m.byte(m.instances["nav"].inject_fault_offset)[0] = 1
        m.set("nav.inputs.divisor", 1 if injected else 0)
        m.step(1)
        assert (m.get("nav.outputs.health"), inputs(m, "fresh")) == ("failed", [True])
        m.set("nav.inputs.divisor", 1)

    m.sample("baro")
    fault()
    fault()
    m.step(1)  # the first completed run
    assert (*inputs(m, "elapsed", "resumed", "fresh"), m.get("nav.counters.last_run")) == (0.001, True, True, 3)
    m.step(1)
    assert inputs(m, "elapsed", "resumed", "fresh") == [0.001, False, False]
    m.sample("baro")
    fault()
    fault()
    m.step(1)
    assert inputs(m, "elapsed", "resumed", "fresh") == [0.003, False, True]
    m.force_state("OUT")
    m.step(2)
    m.force_state("A")
    m.sample("baro")
    fault()
    m.step(1)
    assert inputs(m, "elapsed", "resumed", "fresh") == [0.001, True, True]
    assert m.get("nav.counters.completed") and m.get("nav.counters.faults") == 5


def test_the_first_tick_of_a_state_is_0(tmp_path: Path) -> None:
    """Also after set_state to the active state, and in a machine without timed transitions."""
    m = craft(tmp_path)
    seen = []
    for force in (None, None, None, "A", None, "SLOW", None, None, None):
        if force:
            m.force_state(force)
        m.step()
        seen.append((m.get("nav.inputs.ticks"), m.get("machine.ticks_in_state")))
    # SLOW runs `nav` in tick 7 only, its third tick.
    assert seen == [(0, 1), (1, 2), (2, 3), (0, 1), (1, 2), (1, 1), (1, 2), (2, 3), (2, 4)]
    assert not m.d.after_ticks


def test_what_a_sensor_offers(tmp_path: Path) -> None:
    m = craft(tmp_path)
    m.byte(m.channels["baro"].attached)[0] = 1
    seen = []
    for age in (None, 0, None, None, None, 2, 3, None):
        if age is not None:
            m.sample("baro", age)
        m.step()
        seen.append(inputs(m, "valid", "age", "fresh", "also_fresh"))
    assert seen == [
        [False, 1, False, False],  # no sample has come yet
        [True, 0, True, False],
        [True, 1, False, False],
        [True, 2, False, False],
        [False, 3, False, False],
        [True, 2, True, False],  # a sample that was old on arrival
        [False, 3, True, False],  # and one that was too old
        [False, 4, False, False],
    ]
    m.sample("baro.valid")
    m.step()
    assert inputs(m, "fresh", "also_fresh") == [False, True]


def test_a_sample_is_fresh_until_its_receiver_has_run(tmp_path: Path) -> None:
    """For any state and rate, and any number of samples."""
    m = craft(tmp_path)
    m.force_state("SLOW")
    seen = []
    for tick in range(12):
        if tick in (2, 3, 7):
            m.sample("baro")
        if tick == 8:
            m.sample("baro")
            m.force_state("OUT")
        if tick == 10:
            m.force_state("A")
        m.step()
        seen.append(m.get("nav.inputs.fresh"))
    #       due at 1 | 2, 3 came, due at 4 | 7 came, due at once | 8 came, OUT | A: due
    assert seen == [False, False, False, False, True, True, True, True, True, True, True, False]
    assert m.get("channels.baro.last_sample") == 9 and m.get("nav.counters.last_run") == 12


def test_a_checkpoint_keeps_what_is_fresh(tmp_path: Path) -> None:
    m = craft(tmp_path)
    m.force_state("SLOW")
    m.step(2)
    m.sample("baro")
    m.step(1)
    saved = m.save()
    found = []
    for _ in range(2):
        m.step(3)
        found.append((*inputs(m, "fresh", "elapsed"), m.save()))
        m.restore(saved)
    assert found[0] == found[1] and found[0][:2] == (True, 0.003)


def test_nothing_is_kept_that_nobody_reads(tmp_path: Path) -> None:
    m = craft(tmp_path, connections=[{"from": "channels.baro.valid", "to": "nav.valid"}])
    assert not [p for p in m.fields if p.endswith(KEPT)]
    m = craft(tmp_path / "fresh", connections=[{"from": "channels.baro.fresh", "to": "nav.fresh"}])
    kept = [p for p in m.fields if p.endswith(KEPT)]
    assert kept == ["nav.counters.last_run", "channels.baro.last_sample"]
    m = craft(tmp_path / "resumed", connections=[{"from": "machine.resumed", "to": "nav.resumed"}])
    assert [p for p in m.fields if p.endswith(KEPT)] == ["nav.counters.completed"]


def test_the_field_table_gives_the_source(tmp_path: Path) -> None:
    m = craft(tmp_path)
    paths = list(m.fields)
    found = {p.removeprefix("nav.inputs."): m.fields[p].connected_from for p in paths if p.startswith("nav.inputs.")}
    named = {n: paths[at] for n, at in found.items() if at >= 0}
    assert named == {
        "ticks": "machine.ticks_in_state",
        "valid": "channels.baro.valid",
        "age": "channels.baro.age_ticks",
    }
    assert {n for n, at in found.items() if at == -2} == {"elapsed", "period", "resumed", "fresh", "also_fresh"}


# ---- the compiler --------------------------------------------------------------------------------------------------


def checked(folder: Path, instances: list[str] | None = None, **more: Any) -> Checked:
    path = write_machine(folder, "craft", {**CONFIG, **more}, {"hearer": HEARER, "sensors": SENSORS})
    return compile_machine(path, "", until="schedule", instances=instances).checked


def test_they_order_nothing(tmp_path: Path) -> None:
    """`nav` reads a channel of `sensors`, which reads `nav`: no cycle, and `nav` runs first as in the JSON."""
    sensors = SENSORS.replace("outputs =", 'inputs = {"runs": "i32"}\n    outputs =')
    back = [*CONFIG["connections"], {"from": "nav.runs", "to": "sensors.runs"}]
    config = {**CONFIG, "connections": back}
    path = write_machine(tmp_path, "craft", config, {"hearer": HEARER, "sensors": sensors})
    m = compile_machine(path, "", until="schedule").checked
    assert [m.instances[e.instance].name for e in m.states[0].entries] == ["nav", "sensors"]


@pytest.mark.parametrize("instances", [["nav"], ["nav", "sensors"]], ids=len)
def test_a_subset_without_the_sensor_gets_host_inputs(tmp_path: Path, instances: list[str]) -> None:
    m = checked(tmp_path, instances)
    fed = {c.target.field for c in m.connections}
    own = {"elapsed", "period", "resumed", "ticks"}
    heard = {"valid", "age", "fresh", "also_fresh"}
    assert fed == own | (heard if "sensors" in instances else set())
    opened = {"valid": "valid", "age": "age_ticks", "fresh": "fresh", "also_fresh": "valid.fresh"}
    left_out = {f"nav.inputs.{n}": f"channels.baro.{what}" for n, what in opened.items()}
    assert m.left_out == ({} if "sensors" in instances else left_out)


def test_a_picture_names_them(tmp_path: Path) -> None:
    rows = [row for box in dataflow(checked(tmp_path)).boxes for row in box.rows]
    tags = {row.left: row.tag for row in rows if row.tag_kind == "machine"}
    assert tags["elapsed"] == "machine.elapsed" and tags["also_fresh"] == "channels.baro.valid.fresh"
