# SPDX-License-Identifier: Apache-2.0
"""The tick as tables, derived by hand from the rules and not from program output.

Every table holds for compiled machines and for CPython's.
"""

from pathlib import Path

import pytest
from fcsl_test_abi import Machine, write_machine
from fcsl_test_tables import COUNTER, PUPPET, kind, machine, puppet_machine, run_table

__all__ = ["kind"]  # runs all tests here on both kinds of machine


def test_initial(tmp_path: Path) -> None:
    m = puppet_machine(tmp_path)
    assert m.init_result == 0
    assert (m.get("machine.tick"), m.state, m.get("machine.next_state")) == (0, "A", "A")
    assert m.get("one.outputs.health") == "stale" and m.get("one.outputs.transition_request") == ""
    assert m.get("one.inputs.divisor") == 1 and m.get("one.outputs.runs") == 0


def test_request_is_latched_at_the_end_and_takes_force_in_the_next_tick(tmp_path: Path) -> None:
    m = puppet_machine(tmp_path)
    columns = ["machine.tick", "machine.state", "machine.next_state", "one.outputs.transition_request"]
    run_table(
        m,
        columns,
        [
            ({}, [1, "A", "A", ""]),
            ({"one.inputs.ask": 1}, [2, "A", "B", "GO"]),
            ({"one.inputs.ask": 0}, [3, "B", "B", ""]),  # the pulse is cleared before each execute
            ({"one.inputs.ask": 1}, [4, "B", "B", "GO"]),  # B has no edge for GO
        ],
    )


def test_larger_priority_is_taken_for_any_requester(tmp_path: Path) -> None:
    """HALT (5) has precedence over GO (1), for both orders of the instances."""
    for first, second in ((1, 2), (2, 1)):
        m = puppet_machine(tmp_path)
        m.set("one.inputs.ask", first)
        m.set("two.inputs.ask", second)
        m.step()
        assert (m.state, m.get("machine.next_state")) == ("A", "C")
        m.step()
        assert m.state == "C"


def test_what_both_states_schedule_goes_on_and_the_rest_is_stale(tmp_path: Path) -> None:
    """A and B run both puppets, C runs only `two`, in every third tick."""
    m = puppet_machine(tmp_path)
    columns = ["machine.state", "one.outputs.health", "one.outputs.runs", "two.outputs.health", "two.outputs.runs"]
    run_table(
        m,
        columns,
        [
            ({}, ["A", "nominal", 1, "nominal", 1]),  # tick 0
            ({"one.inputs.ask": 2}, ["A", "nominal", 2, "nominal", 2]),  # tick 1
            ({"two.inputs.ask": 0}, ["C", "stale", 2, "nominal", 2]),  # tick 2: C runs `two` at 3, 6, …
            ({}, ["C", "stale", 2, "nominal", 3]),  # tick 3
            ({"two.inputs.ask": 1}, ["C", "stale", 2, "nominal", 3]),  # tick 4: it keeps the health of its last run
            ({}, ["C", "stale", 2, "nominal", 3]),
            ({}, ["C", "stale", 2, "nominal", 4]),  # tick 6: `two` asks for A …
            ({}, ["A", "nominal", 3, "nominal", 5]),  # … where `one` runs again
        ],
    )


def test_one_that_only_the_new_state_schedules_is_stale_until_it_runs(tmp_path: Path) -> None:
    """It enters at tick 1 and is due at tick 4. Instances that run in both states are not affected."""
    config = {
        "instances": {n: {"algorithm": "Counter"} for n in ("fast", "slow")},
        "states": {
            "A": {"schedule": {"fast": 1000}},
            "B": {"schedule": {"fast": 1000, "slow": {"every": 4}}},
        },
    }
    m = machine(tmp_path, config, counter=COUNTER)
    m.step()
    m.force_state("B")
    seen = []
    for _ in range(4):
        m.step()
        seen.append([m.get(f"{n}.outputs.health") for n in ("fast", "slow")])
    assert seen == [["nominal", "stale"]] * 3 + [["nominal", "nominal"]]


def test_a_state_that_is_in_force_is_not_entered_anew(tmp_path: Path) -> None:
    m = puppet_machine(tmp_path)
    m.set("one.inputs.ask", 1)
    m.step()
    assert m.get("machine.next_state") == "B"
    m.force_state("A")  # cancels the latched transition without other effects
    assert (m.state, m.get("machine.next_state"), m.get("one.outputs.health")) == ("A", "A", "nominal")


RECEIVER = """
class Receiver:
    inputs = {"period": "f64 s", "resumed": "bool"}
    outputs = {"periods": "f64 s", "starts": "i32"}

    def execute(self):
        self.periods = self.period
        if self.resumed:
            self.starts += 1
"""


def test_a_receiver_knows_its_period_and_that_it_has_been_out(tmp_path: Path) -> None:
    config = {
        "instances": {"one": {"algorithm": "Receiver"}},
        "connections": [
            {"from": "machine.period", "to": "one.period"},
            {"from": "machine.resumed", "to": "one.resumed"},
        ],
        "states": {
            "A": {"schedule": {"one": 1000}},
            "B": {"schedule": {"one": {"every": 3}}},
            "C": {"schedule": {}},
        },
    }
    m = machine(tmp_path, config, receiver=RECEIVER)
    seen = []
    for state, ticks in (("A", 2), ("B", 4), ("C", 1), ("B", 3)):
        m.force_state(state)
        m.step(ticks)
        seen.append((m.get("one.outputs.periods"), m.get("one.outputs.starts")))
    assert seen == [(0.001, 1), (0.003, 1), (0.003, 1), (0.003, 2)]


def test_a_request_counts_only_on_the_tick_when_its_instance_ran(tmp_path: Path) -> None:
    """In C `two` is due at ticks 3 and 6. Its request of tick 3 is latched then; the remaining pulse is not evaluated
    again."""
    m = puppet_machine(tmp_path)
    m.step()
    m.force_state("C")
    columns = ["machine.tick", "machine.state", "machine.next_state", "two.outputs.transition_request"]
    run_table(
        m,
        columns,
        [
            ({"two.inputs.ask": 2}, [2, "C", "C", ""]),
            ({}, [3, "C", "C", ""]),
            ({}, [4, "C", "C", "HALT"]),  # tick 3; C has no edge for HALT
            ({"two.inputs.ask": 1}, [5, "C", "C", "HALT"]),  # not run: the pulse can be read but has no effect
            ({}, [6, "C", "C", "HALT"]),
            ({}, [7, "C", "A", "GO"]),  # tick 6
            ({"two.inputs.ask": 0}, [8, "A", "A", ""]),
        ],
    )


def test_a_left_over_pulse_of_an_unscheduled_instance_has_no_effect(tmp_path: Path) -> None:
    m = puppet_machine(tmp_path)
    m.set("one.inputs.ask", 1)
    m.step()
    m.force_state("C")  # `one` does not run in C; its pulse GO is still in the record, and C has an edge for GO
    assert m.get("one.outputs.transition_request") == "GO"
    m.step(5)
    assert m.state == "C" and m.get("machine.next_state") == "C"


def test_a_left_over_pulse_of_an_instance_that_is_not_due_has_no_effect(tmp_path: Path) -> None:
    m = puppet_machine(tmp_path)
    m.set("two.inputs.ask", 1)
    m.step()
    m.force_state("C")  # `two` runs in C at tick 3; its pulse of tick 0 must not count at ticks 1 and 2
    m.set("two.inputs.ask", 0)
    for _ in range(2):
        m.step()
        assert m.get("two.outputs.transition_request") == "GO" and m.get("machine.next_state") == "C"


@pytest.mark.parametrize(
    ("words", "ill", "taken"),
    [
        (["failed"], 2, True),
        (["failed"], 1, False),
        (["degraded", "failed"], 1, True),
        (["nominal"], 0, True),
        (["nominal"], 1, False),
        (["stale"], 2, False),
    ],
)
def test_health_guard(tmp_path: Path, words: list[str], ill: int, taken: bool) -> None:
    edges = [{"from": "A", "to": "B", "health": {"instance": "one", "in": words}, "priority": 1}]
    m = puppet_machine(tmp_path, transitions=edges, requests=["GO", "HALT"])
    m.set("one.inputs.ill", ill)
    m.step()
    assert m.get("machine.next_state") == ("B" if taken else "A")


def test_health_guard_with_a_request_needs_both(tmp_path: Path) -> None:
    edges = [{"from": "A", "to": "B", "request": "GO", "health": {"instance": "two", "in": ["failed"]}}]
    m = puppet_machine(tmp_path, transitions=edges, requests=["HALT"])
    run_table(
        m,
        ["machine.state", "machine.next_state"],
        [
            ({"one.inputs.ask": 1}, ["A", "A"]),
            ({"one.inputs.ask": 0, "two.inputs.ill": 2}, ["A", "A"]),
            ({"one.inputs.ask": 1}, ["A", "B"]),
        ],
    )


def test_a_guard_sees_only_the_health_of_this_tick(tmp_path: Path) -> None:
    """In C `two` runs at 0, 3, …: its failure of tick 0 must not cause a transition at tick 1. `stale` is true until it
    has run."""
    edges = [{"from": "C", "to": "A", "health": {"instance": "two", "in": ["failed"]}}]
    m = puppet_machine(tmp_path, transitions=edges, requests=["GO", "HALT"], initial_state="C")
    m.set("two.inputs.ill", 1)
    m.step()  # tick 0 runs it: degraded
    m.set("two.inputs.ill", 2)
    m.step(2)  # ticks 1 and 2 do not run it
    assert m.get("machine.next_state") == "C" and m.get("two.outputs.health") == "degraded"
    m.step()  # tick 3: failed
    assert m.get("machine.next_state") == "A"


def test_a_failure_left_over_takes_no_edge(tmp_path: Path) -> None:
    edges = [{"from": "C", "to": "B", "request": "GO", "health": {"instance": "two", "in": ["failed"]}}]
    asks = {"one": 1000, "two": {"every": 3}}
    states = {"A": {"schedule": {}}, "B": {"schedule": {}}, "C": {"schedule": asks}}
    m = puppet_machine(tmp_path, transitions=edges, states=states, requests=["HALT"], initial_state="C")
    run_table(
        m,
        ["two.outputs.health", "machine.next_state"],
        [
            ({"two.inputs.ill": 2}, ["failed", "C"]),  # failed, but without a request
            ({"one.inputs.ask": 1}, ["failed", "C"]),  # requested, but the failure is from tick 0
            ({}, ["failed", "C"]),
            ({}, ["failed", "B"]),  # tick 3: it ran and failed
        ],
    )


def test_stale_guard_holds_until_the_first_run(tmp_path: Path) -> None:
    states = {"A": {"schedule": {"one": {"every": 4, "phase": 2}}}, "B": {"schedule": {}}}
    edges = [{"from": "A", "to": "B", "request": "GO", "health": {"instance": "one", "in": ["stale"]}, "priority": 1}]
    edges += [{"from": "A", "to": "B", "health": {"instance": "two", "in": ["stale"]}, "priority": 2}]
    m = puppet_machine(tmp_path, states=states, transitions=edges, requests=["HALT"])
    m.step()
    assert m.get("machine.next_state") == "B"  # `two` is not scheduled at all: stale
    m = puppet_machine(tmp_path / "one", states=states, transitions=edges[:1], requests=["HALT"])
    m.set("one.inputs.ask", 1)
    m.step(8)  # when it makes the request it has run, so it is not stale
    assert m.state == "A" and m.get("one.outputs.runs") == 2


def test_star_is_every_state_but_the_target(tmp_path: Path) -> None:
    edges = [{"from": "*", "to": "C", "request": "HALT", "priority": 1}]
    for state in "AB":
        m = puppet_machine(tmp_path, transitions=edges, requests=["GO"], initial_state=state)
        m.set("two.inputs.ask", 2)
        m.step(2)
        assert m.state == "C"
    assert m.d.transition_count == 2


def test_fault_leaves_outputs_and_state_and_counts(tmp_path: Path) -> None:
    m = puppet_machine(tmp_path)
    columns = [
        f"one.{n}" for n in ("outputs.health", "outputs.runs", "outputs.quotient", "state.mark", "counters.faults")
    ]
    columns += ["one.outputs.transition_request", "two.outputs.runs", "machine.next_state"]
    run_table(
        m,
        columns,
        [
            ({"one.inputs.divisor": 7}, ["nominal", 1, 14, 1, 0, "", 1, "A"]),
            # Runs, mark and request were written before the division by zero. All are restored.
            ({"one.inputs.divisor": 0, "one.inputs.ask": 1}, ["failed", 1, 14, 1, 1, "", 2, "A"]),
            ({}, ["failed", 1, 14, 1, 2, "", 3, "A"]),
            ({"one.inputs.divisor": -7}, ["nominal", 2, -15, 2, 2, "GO", 4, "B"]),
        ],
    )


def test_rates_and_phases_follow_the_global_tick(tmp_path: Path) -> None:
    schedule = {"a": 1000, "b": 250, "c": {"hz": 500, "phase": 1}, "d": {"every": 5, "phase": 3}}
    instances = {n: {"algorithm": "Counter"} for n in schedule}
    m = machine(tmp_path, {"instances": instances, "states": {"A": {"schedule": schedule}}}, counter=COUNTER)
    rows = [
        [1, 1, 0, 0],  # tick 0
        [2, 1, 1, 0],
        [3, 1, 1, 0],
        [4, 1, 2, 1],
        [5, 2, 2, 1],
        [6, 2, 3, 1],
        [7, 2, 3, 1],
        [8, 2, 4, 1],
        [9, 3, 4, 2],  # tick 8
        [10, 3, 5, 2],
    ]
    for tick, row in enumerate(rows):
        m.step()
        assert [m.get(f"{n}.outputs.runs") for n in "abcd"] == row, f"tick {tick}"


def test_the_phase_does_not_restart_on_state_entry(tmp_path: Path) -> None:
    m = puppet_machine(tmp_path)
    m.step(4)
    m.force_state("C")
    runs = []
    for _ in range(4):  # ticks 4, 5, 6, 7: C runs `two` at 6
        m.step()
        runs.append(m.get("two.outputs.runs"))
    assert runs == [4, 4, 5, 5]


def test_delayed_edges_carry_the_value_of_the_tick_before(tmp_path: Path) -> None:
    """a → b direct, b → a delayed: a gets the initial value in tick 0, then the output of b from the previous tick."""
    follow = """
class Follow:
    inputs = {"before": "i32"}
    outputs = {"value": "i32"}

    def execute(self):
        self.value = self.before + 1
"""
    config = {
        "instances": {n: {"algorithm": "Follow"} for n in "ab"},
        "connections": [
            {"from": "a.value", "to": "b.before"},
            {"from": "b.value", "to": "a.before", "delayed": True, "initial": 40},
        ],
        "states": {"A": {"schedule": {"b": 1000, "a": 1000}}},
    }
    m = machine(tmp_path, config, follow=follow)
    rows = [(40, 41, 42), (42, 43, 44), (44, 45, 46)]
    for tick, row in enumerate(rows):
        m.step()
        found = (m.get("a.inputs.before"), m.get("a.outputs.value"), m.get("b.outputs.value"))
        assert found == row, f"tick {tick}"


def test_delayed_edges_do_not_depend_on_the_order_of_instances(tmp_path: Path) -> None:
    """A delayed edge in execution order also delays."""
    config = {
        "instances": {n: {"algorithm": "Counter"} for n in "ab"},
        "connections": [{"from": "a.runs", "to": "b.value", "delayed": True, "initial": -1}],
        "states": {"A": {"schedule": {"a": 1000, "b": {"every": 2}}}},
    }
    m = machine(tmp_path, config, counter=COUNTER)
    seen = []
    for _ in range(5):
        m.step()
        seen.append(m.get("b.outputs.seen"))
    assert seen == [-1, -1, 2, 2, 4]


def test_connections_copy_before_execute_in_dataflow_order(tmp_path: Path) -> None:
    """c → b → a against the JSON order: the value passes within one tick."""
    config = {
        "instances": {n: {"algorithm": "Counter"} for n in "abc"},
        "connections": [
            {"from": "b.runs", "to": "a.value"},
            {"from": "c.runs", "to": "b.value"},
        ],
        "states": {"A": {"schedule": {n: 1000 for n in "abc"}}},
    }
    m = machine(tmp_path, config, counter=COUNTER)
    m.step()
    assert [m.get(f"{n}.outputs.seen") for n in "abc"] == [1, 1, 0]


def test_force_state_acts_at_once(tmp_path: Path) -> None:
    m = puppet_machine(tmp_path)
    m.set("one.inputs.ask", 1)
    m.step()
    assert m.get("machine.next_state") == "B"
    m.force_state("C")  # the latched transition is gone
    assert (m.state, m.get("machine.next_state"), m.get("one.outputs.health")) == ("C", "C", "stale")
    assert m.get("one.outputs.runs") == 1 and m.get("machine.tick") == 1
    m.step()
    assert m.state == "C"


STARTING = """
class Starting:
    outputs = {"first": "i32"}
    parameters = {"scale": "i32"}
    state = {"kept": "i32"}

    def start(self):
        self.kept = 100 // self.scale
        self.first = self.kept + 1

    def execute(self):
        self.first = self.kept
"""


def test_start_runs_at_init_only(tmp_path: Path) -> None:
    config = {
        "instances": {"one": {"algorithm": "Starting", "parameters": {"scale": 5}}},
        "states": {"A": {"schedule": {"one": 1000}}},
    }
    m = machine(tmp_path, config, starting=STARTING)
    assert (m.get("one.state.kept"), m.get("one.outputs.first"), m.get("one.outputs.health")) == (20, 21, "stale")
    m.set("one.state.kept", 3)
    m.step()
    m.force_state("A")
    m.step()
    assert m.get("one.outputs.first") == 3


def test_fault_in_start_makes_init_fail(tmp_path: Path) -> None:
    config = {
        "instances": {n: {"algorithm": "Starting", "parameters": {"scale": s}} for n, s in (("good", 1), ("bad", 0))},
        "states": {"A": {"schedule": {"good": 1000}}},
    }
    m = machine(tmp_path, config, starting=STARTING)
    assert m.init_result == 1 + list(m.instances).index("bad") == 2


def test_machine_sources(tmp_path: Path) -> None:
    """time_ns = floor(tick * 1e9 / tick_hz), never accumulated. tick counts the ticks before this one."""
    inputs = {"dt": "period", "time_ns": "now_ns", "tick": "tick"}
    config = {
        "tick_hz": 300,
        "instances": {"one": {"algorithm": "Counter"}},
        "connections": [{"from": f"machine.{source}", "to": f"one.{name}"} for source, name in inputs.items()],
        "states": {"A": {"schedule": {"one": 300}}},
    }
    m = machine(tmp_path, config, counter=COUNTER)
    for tick in range(1000):
        m.step()
        expected = [1 / 300, tick * 10**9 // 300, tick]
        assert [m.get(f"one.outputs.{n}") for n in ("dt", "time_ns", "number")] == expected
    m.set("machine.tick", 9_000_000_000 * 300 + 7)  # 285 years
    m.step()
    assert m.get("one.outputs.time_ns") == (9_000_000_000 * 300 + 7) * 10**9 // 300


def test_save_and_restore_are_copies(tmp_path: Path) -> None:
    m = puppet_machine(tmp_path)
    m.set("one.inputs.ask", 1)
    m.step(2)
    saved = m.save()
    m.step(3)
    after = m.save()
    assert saved != after
    m.restore(saved)
    assert m.get("machine.tick") == 2
    m.step(3)
    assert m.save() == after
    other = puppet_machine(tmp_path)  # another struct of the same library: nothing is global
    other.restore(saved)
    other.step(3)
    assert other.save() == after and m.save() == after


def test_health_as_an_input_can_be_stale_but_not_reported(tmp_path: Path) -> None:
    """An algorithm that copies a health input is never stale itself: stale becomes failed."""
    relay = """
class Relay:
    inputs = {"word": "Health"}

    def execute(self):
        self.health = self.word
"""
    config = {
        "instances": {"one": {"algorithm": "Puppet", "inputs": {"divisor": 1}}, "relay": {"algorithm": "Relay"}},
        "connections": [{"from": "one.health", "to": "relay.word"}],
        "states": {"A": {"schedule": {"one": {"every": 4, "phase": 1}, "relay": 1000}}},
        "requests": ["GO", "HALT"],
    }
    m = machine(tmp_path, config, puppet=PUPPET, relay=relay)
    columns = ["one.outputs.health", "relay.inputs.word", "relay.outputs.health"]
    run_table(
        m,
        columns,
        [
            ({}, ["stale", "stale", "failed"]),
            ({"one.inputs.ill": 1}, ["degraded", "degraded", "degraded"]),
            ({}, ["degraded", "degraded", "degraded"]),
        ],
    )


def test_two_machines_in_one_library(tmp_path: Path) -> None:
    from fcsl_compiler.driver.library import build_library

    configs = []
    for name, hz in (("first", 10), ("second", 20)):
        config = {
            "tick_hz": hz,
            "initial_state": "A",
            "instances": {"one": {"algorithm": "Counter"}},
            "states": {"A": {"schedule": {"one": hz}}},
        }
        configs.append(write_machine(tmp_path / name, name, config, {"counter": COUNTER}))
    build_library(configs, tmp_path / "out" / "libboth.so")
    m = Machine(tmp_path / "out" / "libboth.so", "second")
    assert m.names == ["first", "second"] and m.d.tick_hz == 20
