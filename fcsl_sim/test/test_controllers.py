# SPDX-License-Identifier: Apache-2.0
"""Several controllers in one simulation, their delays, and connections with any field of a machine."""

from __future__ import annotations

import json
import re
import subprocess
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimConfig, SimError, Simulation, load
from fcsl_sim.cli import main
from fcsl_sim.runner import run
from fcsl_sim.sim_run import SimRun
from fcsl_sim.sim_twin import SimTwin
from simclient import AlgTwin
from simclient.bag import Bag, columns

TEST = Path(__file__).resolve().parent
Load = Callable[..., SimConfig]

#: u = gain * (target - x), clamped; `noted` is a host input that nothing else writes.
HOLD = """
class Hold:
    inputs = {"x": "f64 m", "noted": "f64"}
    outputs = {"u": "f64 m/s", "seen": "f64"}
    parameters = {"gain": "f64 1/s", "target": "f64 m"}
    state = {"ticks": "i64"}

    def execute(self):
        self.ticks = self.ticks + 1
        self.u = self.gain * (self.target - self.x)
        self.seen = self.noted
        if self.ticks % 25 == 0:
            event("more ticks", self.ticks)
"""
SENSE = """
class Sense:
    inputs = {}
    outputs = {"x": "f64 m"}
    parameters = {}
    state = {}

    def execute(self):
        pass
"""


def machine(hz: int) -> dict[str, Any]:
    return {
        "tick_hz": hz,
        "initial_state": "RUN",
        "algorithms": {"Sense": {"source": "sense.py"}, "Hold": {"source": "hold.py"}},
        "instances": {
            "sense": {"algorithm": "Sense", "parameters": {}},
            "hold": {"algorithm": "Hold", "parameters": {"gain": 2.0, "target": 1.0}},
        },
        "connections": [{"from": "sense.x", "to": "hold.x"}],
        "states": {"RUN": {"schedule": {"sense": hz, "hold": hz}}},
        "channels": [
            {"name": "x", "id": 1, "field": "sense.outputs.x", "direction": "sensor"},
            {"name": "u", "id": 2, "field": "hold.outputs.u", "direction": "actuator"},
        ],
    }


@pytest.fixture
def load_two(tmp_path: Path) -> Load:
    """Two carts x' = u, each with a controller; the second one at `hz`."""

    def load_changed(change: Callable[[dict[str, Any]], object] = lambda config: None, hz: int = 50) -> SimConfig:
        (tmp_path / "sense.py").write_text(SENSE)
        (tmp_path / "hold.py").write_text(HOLD)
        (tmp_path / "fast.json").write_text(json.dumps(machine(100)))
        (tmp_path / "slow.json").write_text(json.dumps(machine(hz)))
        (tmp_path / "chain.c").write_text((TEST / "models/chain.c").read_text())
        cart = {"model": "chain", "parameters": {"gain": 0.0, "rate": 1.0, "x": 0.0}}
        config = {
            "controllers": {"one": {"machine": "fast.json"}, "two": {"machine": "slow.json"}},
            "seed": 1,
            "duration": 2.0,
            "integrator": {"method": "rk4", "hz": 3000},
            "models": {"chain": {"source": "chain.c"}},
            "instances": {"a": cart, "b": cart},
            "connections": [
                {"from": "a.free", "to": "one.x"},
                {"from": "b.free", "to": "two.x"},
                {"from": "one.u", "to": "a.u"},
                {"from": "two.u", "to": "b.u"},
            ],
        }
        change(config)
        path = tmp_path / "two.sim.json"
        path.write_text(json.dumps(config))
        return load(path)

    return load_changed


def flown(config: SimConfig, path: str) -> list[Any]:
    values = []
    with Simulation(config.plan, config.tables) as sim:
        while sim.status == "running":
            sim.run(1)
            values.append(sim.get(path))
    return values


def expected(hz: int, delay: int, ticks: int) -> list[float]:
    """x at each tick of the controller: u of tick k holds from tick k + delay on."""
    x, commands, found = 0.0, [], []
    for k in range(ticks):
        found.append(x)
        commands.append(2.0 * (1.0 - x))
        x += (commands[k - delay] if k >= delay else 0.0) / hz
    return found


def test_a_twin_has_the_events_of_all_by_time(load_two: Load, tmp_path: Path) -> None:
    load_two()
    with SimTwin.from_config(tmp_path / "two.sim.json") as twin:
        twin.tick(80)
        found = [(event.time_ns // 10**6, event.tick, event.instance, event.values) for event in twin.events]
    first = [(240, 24, "hold", (25,)), (480, 24, "two.hold", (25,)), (490, 49, "hold", (50,))]
    assert found == [*first, (740, 74, "hold", (75,))]


@pytest.mark.parametrize("hz", [50, 30, 150, 1])
def test_each_has_its_rate(hz: int, load_two: Load) -> None:
    config = load_two(hz=hz)
    assert flown(config, "a.outputs.free") == pytest.approx(expected(100, 0, 200), rel=1e-12)
    slow = expected(hz, 0, 2 * hz + 1)
    for k, x in enumerate(flown(config, "b.outputs.free")):
        at = k * hz / 100  # in ticks of the slow one; between two of them the line from one to the next
        low = int(at)
        between = slow[low] + (at - low) * (slow[low + 1] - slow[low]) if low + 1 < len(slow) else slow[low]
        assert x == pytest.approx(between, rel=1e-9)


def test_a_companion_gets_its_first_sample_late(load_two: Load) -> None:
    """Both carts begin where they shall be; the second controller sees 0 until 0.5 s, and drives away."""

    def change(config: dict[str, Any]) -> None:
        config["instances"] = {
            name: {"model": "chain", "parameters": {"gain": 0.0, "rate": 1.0, "x": 1.0}} for name in "ab"
        }
        config["connections"][1]["first_sample_s"] = 0.5

    config = load_two(change)
    assert flown(config, "a.outputs.free") == [1.0] * 200
    away = flown(config, "b.outputs.free")
    assert away[:51] == pytest.approx([1.0 + 0.02 * k for k in range(51)]) and max(away) == pytest.approx(2.0)


@pytest.mark.parametrize("delay", [1, 3, 7])
def test_commands_act_after_the_delay(delay: int, load_two: Load) -> None:
    def change(config: dict[str, Any]) -> None:
        for controller in config["controllers"].values():
            controller["delay_ticks"] = delay

    config = load_two(change, hz=100)
    for cart in ("a", "b"):
        assert flown(config, f"{cart}.outputs.free") == pytest.approx(expected(100, delay, 200), rel=1e-12)


@pytest.mark.parametrize("hz", [100, 30, 250])
@pytest.mark.parametrize(
    "integrator", [{"method": "rk4", "hz": 3000}, {"method": "ab4", "hz": 3000}, {"method": "rk45", "rtol": 1e-9}]
)
def test_another_vehicle_beside_it_changes_no_bit(integrator: dict[str, Any], hz: int, load_two: Load) -> None:
    def alone(config: dict[str, Any]) -> None:
        config["integrator"] = integrator
        config["controller"] = config.pop("controllers")["one"]
        del config["instances"]["b"]
        config["connections"] = [{"from": "a.free", "to": "controller.x"}, {"from": "controller.u", "to": "a.u"}]

    def beside(config: dict[str, Any]) -> None:
        config["integrator"] = integrator

    assert flown(load_two(alone), "a.outputs.free") == flown(load_two(beside, hz=hz), "a.outputs.free")


def replay(bag: Path, config: Path) -> str:
    line = ["fcsl", "replay", str(bag), "--config", str(config)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_bags_of_all_controllers_replay(load_two: Load, tmp_path: Path) -> None:
    config = load_two(lambda c: c["controllers"]["two"].update(delay_ticks=2))
    with Simulation(config.plan, config.tables) as sim:
        sim.record(tmp_path / "flight")
        while sim.status == "running":
            sim.run(1000)
        sim.record_stop()
        u = columns(Bag(tmp_path / "flight_two"), "hold.outputs.u")[1]
    assert "identical" in replay(tmp_path / "flight", tmp_path / "fast.json")
    assert "identical" in replay(tmp_path / "flight_two", tmp_path / "slow.json")
    assert len(u) == 100 and u[0] == 2.0


def test_a_companion_continues_from_a_checkpoint(load_two: Load) -> None:
    config = load_two(lambda c: c["controllers"]["two"].update(delay_ticks=2), hz=30)
    whole = flown(config, "b.outputs.free")
    with Simulation(config.plan, config.tables) as first, Simulation(config.plan, config.tables) as second:
        first.run(77)
        second.restore_checkpoint(first.checkpoint())
        rest = []
        while second.status == "running":
            second.run(1)
            rest.append(second.get("b.outputs.free"))
    assert rest == whole[77:]


def with_requirement(path: Path) -> int:
    """Gives a machine a requirement that remembers; returns the bytes of its struct."""
    config = json.loads(path.read_text())
    config["requirements"] = [{"id": "U", "text": "u is kept.", "then": "held(hold.outputs.u < 1.0, 0.5)"}]
    path.write_text(json.dumps(config))
    with AlgTwin.from_config(path) as twin:
        return twin.machine.size


def test_requirements_of_a_companion_continue_from_a_checkpoint(load_two: Load, tmp_path: Path) -> None:
    sizes: list[int] = []
    config = load_two(lambda c: sizes.append(with_requirement(tmp_path / "slow.json")))
    with Simulation(config.plan, config.tables) as first, Simulation(config.plan, config.tables) as second:
        first.run(77)
        saved = first.checkpoint()
        first.run(50)
        second.restore_checkpoint(saved)
        second.run(50)
        assert second.checkpoint() == first.checkpoint()
        assert second.checkpoint() != saved
        second.restore_checkpoint(as_version_1(saved, sizes[0]))
        assert second.tick == 77


def as_version_1(saved: bytes, size: int) -> bytes:
    """As an older program wrote it: no size before the struct of the companion's machine, no memory behind it."""
    plant = len(saved) - 4 - int.from_bytes(saved[32:40], "little")
    memory = re.compile(rb"[0-9a-f]{128}").search(saved, plant)
    assert memory is not None
    begin = memory.start() - size
    end = begin + int.from_bytes(saved[begin - 4 : begin], "little")
    content = bytearray(saved[: begin - 4] + saved[begin : begin + size] + saved[end:-4])
    content[8:12] = (1).to_bytes(4, "little")
    content[16:24] = (len(content) + 4).to_bytes(8, "little")
    content[32:40] = (len(content) - plant).to_bytes(8, "little")
    return bytes(content) + zlib.crc32(content).to_bytes(4, "little")


def test_a_checkpoint_of_other_delays_is_refused(load_two: Load) -> None:
    """Of each controller: what is under way has its place in the checkpoint."""
    config = load_two()
    with Simulation(config.plan, config.tables) as sim:
        sim.run(10)
        saved = sim.checkpoint()
    for name in ("one", "two"):
        other = load_two(lambda c, name=name: c["controllers"][name].update(delay_ticks=2))
        with Simulation(other.plan, other.tables) as sim, pytest.raises(SimError, match="of another simulation"):
            sim.restore_checkpoint(saved)


def test_a_checkpoint_with_impossible_registers_is_refused(load_two: Load) -> None:
    """Behind a right CRC: a register that the simulated hardware of the second controller does not count."""
    config = load_two()
    with Simulation(config.plan, config.tables) as sim:
        sim.run(10)
        good = sim.checkpoint()
        # Its hardware: 1024 pins, 1024 counts, 1024 registers of 8 bytes, their count; all zero, as is what is around.
        pins, size = 1024 + 4 * 1024, 1024 + 4 * 1024 + 8 * 1024 + 4
        at = good.index(bytes(size))
        around = len(good[at:]) - len(good[at:].lstrip(b"\0")) - size
        assert around < 4096
        wrong = bytearray(good)
        wrong[at + around + pins] = 1
        wrong[-4:] = zlib.crc32(wrong[:-4]).to_bytes(4, "little")
        with pytest.raises(SimError, match="damaged"):
            sim.restore_checkpoint(bytes(wrong))
        assert sim.checkpoint() == good
        sim.restore_checkpoint(good)


@pytest.mark.parametrize("tick", [4, 6])
def test_a_checkpoint_whose_controllers_are_at_different_times_is_refused(tick: int, load_two: Load) -> None:
    """Behind a right CRC: at 90 ms the second controller, of 50 Hz, has ticked 5 times, since 80 ms."""
    config = load_two()
    with Simulation(config.plan, config.tables) as sim:
        sim.run(10)
        good = sim.checkpoint()
        sim.run(10)
        later = sim.checkpoint()
        was, is_later, wrong = (n.to_bytes(8, "little") for n in (5, 10, tick))
        at = [i for i in range(len(good) - 8) if good[i : i + 8] == was and later[i : i + 8] == is_later]
        assert at
        changed = bytearray(good)
        for i in at:
            changed[i : i + 8] = wrong
        changed[-4:] = zlib.crc32(changed[:-4]).to_bytes(4, "little")
        with pytest.raises(SimError, match="damaged"):
            sim.restore_checkpoint(bytes(changed))
        sim.restore_checkpoint(good)


def test_sources_have_the_names_of_their_controllers(load_two: Load, tmp_path: Path) -> None:
    load_two()
    with SimTwin.from_config(tmp_path / "two.sim.json") as twin:
        assert twin.machine.fields["a.inputs.u"].connected_from == "one.u"
        assert twin.machine.fields["b.inputs.u"].connected_from == "two.u"


def wired(config: dict[str, Any]) -> None:
    config["connections"] += [
        {"from": "one.hold.outputs.seen", "to": "b.u"},
        {"from": "a.through", "to": "one.hold.inputs.noted"},
    ]
    config["connections"].remove({"from": "two.u", "to": "b.u"})
    config["instances"]["a"] = {"model": "chain", "parameters": {"gain": 0.0, "rate": 1.0, "x": 0.5}}


def test_any_field_of_a_machine_can_be_wired(load_two: Load, tmp_path: Path) -> None:
    """x of `a` goes into an input beside the channels, and its copy out again into the speed of `b`."""
    config = load_two(wired)
    with Simulation(config.plan, config.tables) as sim:
        sim.record(tmp_path / "flight")
        sim.run(1)
        assert sim.machine_value("hold.inputs.noted") == 0.5 == sim.machine_value("hold.outputs.seen")
        total = 0.0
        for _ in range(100):
            total += sim.machine_value("hold.outputs.seen") / 100
            sim.run(1)
            assert sim.get("b.outputs.free") == pytest.approx(total, rel=1e-9)
        sim.record_stop()
        with pytest.raises(SimError, match="before the first tick"):
            sim.listen("wire:unix:nowhere", 10)
    assert "identical" in replay(tmp_path / "flight", tmp_path / "fast.json")
    with (
        Simulation(config.plan, config.tables) as sim,
        pytest.raises(SimError, match="fields of the machine are connected"),
    ):
        sim.listen(f"wire:unix:{tmp_path / 'w'}", 10)


@pytest.mark.parametrize(
    ("source", "target", "message"),
    [
        ("one.u", "two.x", "E215: a controller is connected to a controller"),
        ("a.free", "one.hold.counters.faults", "E215: `one.hold.counters.faults`: read-only (counter)"),
        ("a.free", "two.hold.inputs.noted", "E215: `two.hold.inputs.noted` is no channel of `two`"),
        ("one.machine.state", "b.u", "E217: `one.machine.state` is state, which models do not have"),
        ("three.u", "b.u", "E206: no instance `three`"),
        ("one.v", "b.u", "E206: machine `fast` has no actuator channel `v`"),
    ],
)
def test_connections_that_are_refused(source: str, target: str, message: str, load_two: Load) -> None:
    def change(config: dict[str, Any]) -> None:
        config["connections"] = [{"from": source, "to": target}]

    with pytest.raises(DiagnosticError) as error:
        load_two(change)
    assert f"{error.value.diagnostics[0].code}: {error.value.diagnostics[0].message}" == message


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.update(controller={"machine": "fast.json"}), "E201: both `controller` and `controllers`"),
        (lambda c: c["controllers"]["one"].update(delay_ticks=1001), "E204: `delay_ticks` is 1001"),
        (lambda c: c["controllers"].update(a=c["controllers"].pop("two")), "E209: `a` is a controller"),
        (lambda c: c["controllers"].update(machine={"machine": "fast.json"}), "E209: `machine` is reserved"),
        (lambda c: c.update(controllers={}), "E202: `controllers` is empty"),
        (lambda c: c["integrator"].update(hz=150), "E805: the integrator's 150 Hz is not a multiple of tick_hz (100)"),
    ],
)
def test_controllers_that_are_refused(change: Callable[[dict[str, Any]], object], message: str, load_two: Load) -> None:
    with pytest.raises(DiagnosticError) as error:
        load_two(change)
    assert message in [f"{d.code}: {d.message}" for d in error.value.diagnostics]


def test_times_of_all_controllers(
    load_two: Load, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of machines built with --times: at the end of a run, and of a twin."""
    assert run(load_two()).times == {}
    monkeypatch.setenv("FCSL_TIMES", "1")
    config = load_two()
    with SimTwin(SimRun(config)) as twin:
        twin.tick(10)
        runs = {name: row.runs for name, row in twin.instance_times().items()}
    own, other = (
        {f"{prefix}{name}": n for name in ("sense", "hold", "machine")} for prefix, n in (("", 10), ("two.", 5))
    )
    assert runs == own | other
    assert main(["run", str(config.path), "--duration", "1"]) == 0
    shown = capsys.readouterr()
    table = (shown.out + shown.err).splitlines()
    assert [line.split()[:2] for line in table if line.startswith(("hold", "step"))] == [
        ["hold", "100"],
        ["step", "100"],
        ["hold", "50"],
        ["step", "50"],
    ]
    assert main(["run", str(config.path), "--duration", "1", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["times"]["hold"]["runs"] == 100 and summary["companions"]["two"]["times"]["hold"]["runs"] == 50
