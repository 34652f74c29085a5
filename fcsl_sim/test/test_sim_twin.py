# SPDX-License-Identifier: Apache-2.0
"""SimTwin: values, traces and conditions of machine and models; plants without a controller; checkpoints."""

from __future__ import annotations

import copy
import hashlib
import json
import shutil
import struct
import subprocess
import sys
import time
import warnings
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fcsl_compiler.parse.parts import MAX_TICK_HZ
from fcsl_sim import SimError, Simulation, plant_only
from fcsl_sim.cli import main
from fcsl_sim.sim_twin import SimTwin
from simclient import AlgTwin, OverwrittenWarning, TwinError, diff
from simclient.bag import Bag, columns
from simclient.replay import replay

TEST = Path(__file__).resolve().parent
LANDER = TEST.parents[1] / "examples/lander"
FLIGHT = LANDER / "sim/lander.sim.json"
SENSOR = "package://fcsl_sim/models/noisy_sensor.c"
KEPLER = 1
#: A ramp, a sensor of it, a ball: no controller.
PLANT: dict[str, Any] = {
    "tick_hz": 100,
    "seed": 7,
    "duration": 1000.0,
    "integrator": {"method": "rk4", "hz": 1000},
    "models": {"ramp": {"source": "ramp.c"}, "sensor": {"source": SENSOR}, "ball": {"source": "ball.c"}},
    "instances": {
        "ramp": {"model": "ramp"},
        "gauge": {"model": "sensor", "parameters": {"bias": 0.25, "sigma": 0.5, "dropout": False}},
        "ball": {
            "model": "ball",
            "parameters": {"gravity": 9.81, "restitution": 0.8, "rest_speed": 0.1, "height": 2.0},
        },
    },
    "connections": [{"from": "ramp.x", "to": "gauge.truth"}],
    "rates": {"gauge": 100},
}
METHODS = ("euler", "rk2", "rk4", "ab4", "verlet", "rk45")


def write(folder: Path, config: dict[str, Any], name: str = "plant.sim.json") -> Path:
    for model in ("ramp.c", "ball.c"):
        shutil.copy(TEST / "models" / model, folder)
    problem = (TEST / "models/problem.c").read_text()
    (folder / "problem.c").write_text(f"#define PROBLEM {KEPLER}\n{problem}")
    path = folder / name
    path.write_text(json.dumps(config, indent=2))
    return path


@pytest.fixture
def plant(tmp_path: Path) -> Iterator[SimTwin]:
    with SimTwin.from_config(write(tmp_path, PLANT)) as twin:
        yield twin


@pytest.fixture
def lander() -> Iterator[SimTwin]:
    with SimTwin.from_config(FLIGHT) as twin:
        yield twin


# ---- a plant alone ---------------------------------------------------------------------------------------------------


def test_the_noise_of_a_sensor_has_its_mean_and_deviation_and_no_memory(plant: SimTwin) -> None:
    ticks = 40_000
    with plant.trace("gauge.outputs.value") as trace:
        plant.tick(ticks)
    error = (trace["gauge.outputs.value"] - 0.25) / 0.5
    assert abs(error.mean()) < 4.0 / np.sqrt(ticks)
    assert abs(error.std() - 1.0) < 4.0 / np.sqrt(2 * ticks)
    assert abs((error**3).mean()) < 4.0 * np.sqrt(6.0 / ticks)
    assert abs((error**4).mean() - 3.0) < 4.0 * np.sqrt(24.0 / ticks)
    for lag in (1, 2, 10):
        assert abs((error[lag:] * error[:-lag]).mean()) < 4.0 / np.sqrt(ticks), lag


def test_a_seed_chooses_the_noise_and_sets_and_events_the_rest(tmp_path: Path) -> None:
    path = write(tmp_path, PLANT)

    def values(**options: Any) -> Any:
        with SimTwin.from_config(path, **options) as twin, twin.trace("gauge.outputs.value") as trace:
            twin.tick(100)
            return trace["gauge.outputs.value"]

    assert np.array_equal(values(), values(seed=7)) and not np.array_equal(values(), values(seed=8))
    quiet = values(sets=["gauge.parameters.sigma=0.0"], events=["0.5 gauge.parameters.bias=1.0"])
    assert quiet.tolist() == [0.25] * 50 + [1.0] * 50


def test_its_machine_does_nothing_at_its_rate(tmp_path: Path) -> None:
    with SimTwin.from_config(write(tmp_path, PLANT | {"tick_hz": 50, "rates": {"gauge": 50}})) as twin:
        assert (twin.machine.name, twin.machine.tick_hz, twin.machine.instances) == ("plant_only", 50, ())
        assert twin.tick(3) == 3 and twin.get("ramp.outputs.time_ns") == 40_000_000


def test_its_rate_has_the_limit_of_machines() -> None:
    assert plant_only.MAX_TICK_HZ == MAX_TICK_HZ


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"tick_hz": None}, "E202"),
        ({"tick_hz": 0}, "E204"),
        ({"tick_hz": 100.0}, "E208"),
        ({"controller": {"machine": "x.json"}}, "`tick_hz` is that of the controller"),
        ({"connections": [{"from": "ramp.x", "to": "controller.x"}]}, "E206"),
        ({"integrator": {"method": "rk4", "hz": 150}}, "E805"),
    ],
)
def test_wrong_files_are_refused(tmp_path: Path, change: dict[str, Any], expected: str) -> None:
    config = {key: value for key, value in (PLANT | change).items() if value is not None}
    with pytest.raises(TwinError, match=expected):
        SimTwin.from_config(write(tmp_path, config))


def test_fcsl_sim_runs_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, bag = write(tmp_path, PLANT), tmp_path / "bag"
    assert main(["check", str(path)]) == 0 and "plant_only" in capsys.readouterr().out
    assert main(["run", str(path), "--duration", "2", "--record", str(bag), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    with SimTwin.from_config(path) as twin:
        twin.tick(200)
        assert summary["truth"]["ball.outputs.z"] == twin.get("ball.outputs.z")
        heights = columns(Bag(bag), "/sim/ball:z")[1]
        assert len(heights) == 200 and heights[-1] == twin.get("ball.outputs.z")


def test_inject_drives_an_input_of_a_model(plant: SimTwin) -> None:
    rate = np.sin(np.arange(300) * 0.05)
    with plant.trace("ramp.outputs") as trace:
        assert plant.inject({"ramp.inputs.rate": rate}) == 300
    # The value before tick k holds from t_(k-1) to t_k; before tick 0 no time passes.
    np.testing.assert_allclose(trace["ramp.outputs.x"], np.cumsum(rate)[0:] * 0.01 - rate[0] * 0.01, atol=1e-12)
    masked = np.ma.masked_array(np.full(100, 5.0), mask=np.arange(100) > 0)
    plant.inject({"ramp.inputs.rate": masked})
    assert plant.get("ramp.inputs.rate") == 5.0


# ---- closed loop -----------------------------------------------------------------------------------------------------


def test_the_lander_lands_softly(lander: SimTwin) -> None:
    with lander.trace("machine.state", "lander.outputs", "filter.outputs.pos_z") as trace:
        lander.run_until("lander.outputs.landed and machine.state == 'DESCENT'", timeout_ticks=5000)
    assert lander.get("lander.outputs.touchdown_speed") < 1.5
    assert list(dict.fromkeys(trace["machine.state"].tolist())) == ["ASCENT", "COAST", "DESCENT"]
    np.testing.assert_allclose(trace["filter.outputs.pos_z"][100:], trace["lander.outputs.pos_z"][100:], atol=1.5)


def test_it_is_the_flight_of_fcsl_sim(lander: SimTwin, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(FLIGHT), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    lander.tick(summary["ticks"])
    for path, value in summary["truth"].items():
        assert lander.get(path) == value
    with pytest.raises(TwinError, match=rf"has ended after {summary['ticks']} ticks.*`until` held.*\"until\": null"):
        lander.tick()


def test_it_ends_with_its_duration() -> None:
    with SimTwin.from_config(FLIGHT, duration=0.1) as twin:
        with pytest.raises(TwinError, match="ended after 10 ticks, at 0.1 s: its duration is over"):
            twin.tick(11)
        assert twin.get("machine.tick") == 10


# ---- values ----------------------------------------------------------------------------------------------------------


def test_parameters_and_states_of_models_are_set_and_read(plant: SimTwin) -> None:
    plant.set_many({"ramp.state.x": 3.0, "ramp.inputs.rate": 2.0, "ball.state.z": 1.0, "ball.parameters.gravity": 0.0})
    assert plant.get_many(["ramp.state.x", "ball.state.z"]) == {"ramp.state.x": 3.0, "ball.state.z": 1.0}
    plant.tick()
    assert plant.get_many(["ramp.outputs.x", "ramp.outputs.seen_rate"]) == {
        "ramp.outputs.x": 3.0,
        "ramp.outputs.seen_rate": 2.0,
    }
    plant.tick(50)
    plant.assert_close("ramp.outputs.x", 4.0, atol=1e-12)
    assert plant.get_value("ball.outputs.z") == 1.0
    plant.set("ball.state.v", -1.0)
    plant.run_until("ball.outputs.bounces == 1", timeout_ticks=200)
    plant.assert_close("ball.outputs.v", 0.8, atol=1e-12)


def test_a_state_that_is_set_restarts_each_integrator(tmp_path: Path) -> None:
    """Also those that remember earlier steps: the motion after it is that of a fresh twin with this state."""
    for method in ("ab4", "rk45"):
        integrator = {"method": method} | ({"hz": 1000} if method == "ab4" else {})
        path = write(tmp_path, PLANT | {"integrator": integrator})
        with SimTwin.from_config(path) as twin, SimTwin.from_config(path) as fresh:
            twin.tick(31)
            for one in (twin, fresh):
                one.set_many({"ball.state.z": 100.0, "ball.state.v": 2.0})
                one.tick(0 if one is twin else 1)
            for tick in range(1, 50):
                twin.tick()
                fresh.tick()
                t = tick * 0.01
                twin.assert_close("ball.outputs.z", 100.0 + 2.0 * t - 4.905 * t * t, rtol=1e-9)
                twin.assert_close("ball.outputs.z", fresh.get("ball.outputs.z"), rtol=1e-9)
            z, v = twin.get("ball.state.z"), twin.get("ball.state.v")
            twin.set("ball.parameters.gravity", 1.0)  # their slopes jump, the states do not
            for tick in range(1, 50):
                twin.tick()
                t = tick * 0.01
                twin.assert_close("ball.outputs.z", z + v * t - 0.5 * t * t, rtol=1e-12)


def test_fields_of_the_machine_are_set_read_and_recorded(lander: SimTwin, tmp_path: Path) -> None:
    lander.record(tmp_path / "bag")
    lander.set("ascent.parameters.target_altitude", 20.0)
    lander.tick(100)
    lander.set_state("DESCENT")
    lander.fault("monitor")
    lander.tick(10)
    assert lander.state() == "SAFE"
    lander.stop_recording()
    result = replay(tmp_path / "bag", str(LANDER / "fc/lander_control.json"))
    assert result.identical and lander.get("ascent.parameters.target_altitude") == 20.0
    truth = columns(Bag(tmp_path / "bag"), "/sim/lander:pos_z")[1]
    assert len(truth) == 110 and truth[-1] == lander.get("lander.outputs.pos_z")


def test_what_cannot_be_set_is_refused_and_nothing_is_written(plant: SimTwin) -> None:
    before = plant.snapshot()
    for values, expected in (
        ({"ramp.outputs.x": 1.0}, "read-only: instance `ramp` computes it"),
        ({"ramp.state.x": 1.0, "machine.tick": 3}, "read-only"),
        ({"ramp.state.x": 1.0, "ramp.inputs.rat": 3}, "no such field; did you mean `ramp.inputs.rate`"),
        ({"ramp.state.x": "a"}, "f64 wanted"),
        ({"ball.state.at_rest": 1}, "bool wanted"),
    ):
        with pytest.raises(TwinError, match=expected):
            plant.set_many(values)
    assert not diff(before, plant.snapshot())


def test_a_value_on_what_the_simulation_feeds_is_warned_of(plant: SimTwin, lander: SimTwin) -> None:
    for twin, path in ((plant, "gauge.inputs.truth"), (lander, "sensors.outputs.pos_z")):
        with pytest.warns(OverwrittenWarning, match=f"{path} .*the simulation feeds it") as told:
            twin.set(path, 5.0)
        assert told[0].filename == __file__
    assert lander.describe("lander.inputs.throttle").connected_from == "controller.throttle"
    assert lander.describe("sensors.outputs.pos_z").connected_from == "altimeter.outputs.value"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plant.set("ramp.inputs.rate", 5.0)


def test_samples_of_a_channel_come_from_the_plant_or_from_the_test(lander: SimTwin, tmp_path: Path) -> None:
    for give in (lambda: lander.sample("altitude", 1.0), lambda: lander.silence("altitude")):
        with pytest.raises(TwinError, match="gets its samples from `altimeter.outputs.value`; set a parameter"):
            give()
    config = {"extends": "package://lander/sim/lander.sim.json"}
    shutil.copytree(LANDER / "fc", tmp_path / "fc")
    connections = [c for c in json.loads(FLIGHT.read_text())["connections"] if c["to"] != "controller.altitude"]
    path = tmp_path / "cut.sim.json"
    path.write_text(json.dumps(config | {"connections": connections}))
    with SimTwin.from_config(path) as twin:
        for tick in range(20):
            twin.sample("altitude", 8.0 * tick / 100)
            twin.tick()
            assert twin.get("sensors.outputs.pos_z") == 8.0 * tick / 100
        assert twin.get("sensors.outputs.health") == "nominal"
        twin.tick(8)
        assert twin.get("channels.altitude.valid") is False and twin.get("channels.velocity.valid") is True


def test_what_is_not_for_simulations_says_what_to_do() -> None:
    for refused, expected in (
        (lambda: SimTwin.from_instances(FLIGHT, ["filter"]), "tick_hz"),
        (lambda: SimTwin.from_library("libx.so"), "simulation file"),
        (lambda: SimTwin.from_config(FLIGHT, "board"), "for `simulation` alone"),
        (lambda: SimTwin.from_config(FLIGHT, backend="ada"), "one of c, nim wanted"),
        (lambda: SimTwin.from_config(FLIGHT, sets="a=1"), "a list of texts"),
        (lambda: SimTwin.from_config(FLIGHT, seed=-1), r"0 to 2\*\*64 - 1"),
        (lambda: SimTwin.from_config(FLIGHT, duration="soon"), "a number of seconds"),
        (lambda: SimTwin.from_config(FLIGHT, duration=float("nan")), "a number of seconds"),
        (lambda: SimTwin.from_config(FLIGHT, sets=["lander.parameters.x=1"]), "E210"),
        (lambda: SimTwin.from_config("nowhere.sim.json"), "no such simulation"),
        (lambda: SimTwin.from_config(LANDER / "fc/lander_control.json"), "a machine, not a simulation"),
    ):
        with pytest.raises(TwinError, match=expected):
            refused()


def test_a_closed_twin_says_so(tmp_path: Path) -> None:
    twin = SimTwin.from_config(write(tmp_path, PLANT))
    twin.close()
    twin.close()
    for use in (
        twin.tick,
        twin.save,
        twin.snapshot,
        lambda: twin.get("ramp.state.x"),
        lambda: twin.set("ramp.state.x", 1.0),
    ):
        with pytest.raises(TwinError, match="closed"):
            use()


def test_it_runs_in_real_time_until_paused(plant: SimTwin) -> None:
    plant.resume()
    end = time.monotonic() + 10.0
    while plant.get("machine.tick") < 10 and time.monotonic() < end:
        time.sleep(0.01)
    plant.pause()
    tick = plant.get("machine.tick")
    assert tick >= 10 and plant.get("ball.outputs.z") < 2.0
    assert plant.step() == tick + 1


def test_a_trace_has_both_and_every_tick_once(lander: SimTwin) -> None:
    paths = ("lander.outputs.pos_z", "sensors.outputs.pos_z", "altimeter.outputs.value", "machine.state")
    with lander.trace(*paths) as some, lander.trace() as everything:
        lander.tick(3)
        rows = []
        for _ in range(700):
            lander.tick()
            rows.append(lander.get_many(paths))
    assert some.tick.tolist() == list(range(703))
    for path in paths:
        assert some[path][3:].tolist() == [row[path] for row in rows]
        assert everything[path].tolist() == some[path].tolist()
    assert np.array_equal(some["sensors.outputs.pos_z"], some["altimeter.outputs.value"])


def test_a_long_trace_outgrows_its_ring(plant: SimTwin) -> None:
    with plant.trace() as trace:
        plant.tick(30_000)
    assert len(trace) > trace._tap.capacity and trace.tick.tolist() == list(range(30_000))
    assert trace["ramp.outputs.time_ns"].tolist() == [tick * 10_000_000 for tick in range(30_000)]


def test_snapshots_show_what_changed(plant: SimTwin) -> None:
    plant.tick()
    before = plant.snapshot()
    plant.set("ramp.inputs.rate", 1.0)
    plant.tick()
    changed = {change.path for change in diff(before, plant.snapshot(), ignore=["machine", "ball", "gauge"]).changes}
    assert changed == {
        "ramp.inputs.rate",
        "ramp.state.x",
        "ramp.outputs.x",
        "ramp.outputs.seen_rate",
        "ramp.outputs.time_ns",
    }
    assert before["ball.parameters.restitution"] == 0.8 and before.values["ramp"]["state"]["x"] == 0.0


def test_further_controllers_have_their_fields_below_their_names(tmp_path: Path) -> None:
    machine = "package://lander/fc/lander_control.json"
    connections = json.loads(FLIGHT.read_text())["connections"]
    measured = [c | {"to": c["to"].replace("controller", "spare")} for c in connections if "controller." in c["to"]]
    lead = json.loads(json.dumps(connections).replace("controller.", "main."))
    config = {
        "extends": "package://lander/sim/lander.sim.json",
        "controller": None,
        "controllers": {"main": {"machine": machine}, "spare": {"machine": machine}},
        "connections": lead + measured,
        "views": None,
    }
    path = write(tmp_path, config)
    with SimTwin.from_config(path) as twin, SimTwin.from_config(path) as other:
        twin.set("spare.ascent.parameters.target_altitude", 10.0)
        assert twin.get("ascent.parameters.target_altitude") == 40.0
        twin.tick(50)
        saved = twin.save()
        other.restore(saved)
        with twin.trace("machine.state", "spare.machine.state", "spare.sensors.outputs.pos_z") as trace:
            twin.run_until("spare.machine.state == 'COAST' and machine.state == 'ASCENT'", timeout_ticks=500)
            twin.run_until("machine.state == 'COAST'", timeout_ticks=500)
        assert trace["spare.machine.state"].tolist().index("COAST") < trace["machine.state"].tolist().index("COAST")
        other.tick(len(trace))
        assert twin.save() == other.save() and not diff(twin.snapshot(), other.snapshot())
        with pytest.raises(TwinError, match="read-only"):
            twin.set("spare.machine.tick", 0)
        assert twin.describe("spare.sensors.outputs.pos_z").connected_from == "altimeter.outputs.value"
        assert twin.describe("lander.inputs.throttle").connected_from == "main.throttle"


# ---- checkpoints -----------------------------------------------------------------------------------------------------


def everything(method: str) -> dict[str, Any]:
    """The lander beside an orbit and a ball that bounces, its sensors at odd instants, with events to come."""
    own = {"method": method} | ({} if method == "rk45" else {"hz": 1000})
    free = own if method != "verlet" else {"method": "rk4", "hz": 1000}
    tight = own | ({"rtol": 1e-13, "atol": 1e-13} if method == "rk45" else {})  # several steps in a tick
    ball = {"gravity": 1.62, "restitution": 0.95, "rest_speed": 0.001, "height": 3.0}
    return {
        "extends": "package://lander/sim/lander.sim.json",
        "integrator": {"hz": None} | own,
        "models": {"problem": {"source": "problem.c"}, "ball": {"source": "ball.c"}},
        "instances": {
            "lander": {"integrator": free},
            "orbit": {
                "model": "problem",
                "integrator": tight,
                "parameters": {"p": [0.0], "x": [0.5, 0.0, 0.0, 3.0**0.5]},
            },
            "ball": {"model": "ball", "integrator": free, "parameters": ball},
        },
        "rates": {"altimeter": {"hz": 50, "phase_s": 0.003}, "velocimeter": {"hz": 40, "phase_s": 0.012}},
        "events": [
            {"at_s": 0.0, "set": "altimeter.parameters.bias", "value": 0.05},
            {"at_s": 4.3701, "set": "altimeter.parameters.sigma", "value": 0.4},
            {"at_s": 7.0, "set": "ball.inputs.push", "value": 0.1},
            {"at_s": 11.0, "set": "velocimeter.parameters.bias", "value": 0.02},
        ],
    }


def rest_of(twin: SimTwin, ticks: int) -> list[bytes]:
    """Every value after every tick, and all else that a checkpoint holds, after the last one."""
    with twin.trace() as trace:
        twin.tick(ticks)
    return [*(trace.numbers(field.path).tobytes() for field in trace.fields), twin.save()]


REST = """
import sys
sys.path.insert(0, {folder!r})
from test_sim_twin import SimTwin, rest_of, hashlib

with SimTwin.from_config({path!r}) as twin:
    twin.restore_file({file!r})
    print(hashlib.sha256(b"".join(rest_of(twin, {ticks}))).hexdigest())
"""


@pytest.mark.parametrize("method", METHODS)
def test_the_rest_of_a_flight_is_the_same_bits(tmp_path: Path, method: str) -> None:
    path, end = write(tmp_path, everything(method)), 1300
    with SimTwin.from_config(path) as twin, SimTwin.from_config(path, seed=99) as other:
        for tick in (0, 1, 2, 437, 700, 1101):
            twin.run_until(lambda t, tick=tick: t.get("machine.tick") == tick, timeout_ticks=end)
            saved = twin.save()
            whole = rest_of(twin, end - tick)
            assert twin.get("ball.outputs.bounces") > 3
            for again in (twin, other):
                again.restore(saved)
                assert again.get("machine.tick") == tick and again.save() == saved
                assert rest_of(again, end - tick) == whole, (method, tick)
            twin.restore(saved)
        file = tmp_path / "file"
        twin.save_file(file)
        script = REST.format(folder=str(TEST), path=str(path), file=str(file), ticks=end - 1101)
        told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=120)
        assert told.stdout.strip() == hashlib.sha256(b"".join(whole)).hexdigest()


def test_a_flight_that_is_written_into_continues_alike(tmp_path: Path) -> None:
    """What a test has set, injected and forced waits for the next tick in the restored twin, too."""
    path = write(tmp_path, everything("ab4"))
    with SimTwin.from_config(path) as twin, SimTwin.from_config(path) as other:
        twin.tick(500)
        twin.set_many(
            {"lander.state.vel_z": 5.0, "orbit.state.x": [1.0, 0.0, 0.0, 1.0], "ball.parameters.gravity": 2.0}
        )
        twin.fault("filter")
        twin.hardware.gpio[3] = True
        saved = twin.save()
        whole = rest_of(twin, 300)
        other.restore(saved)
        assert other.hardware.gpio[3] and rest_of(other, 300) == whole


def test_a_checkpoint_goes_on_into_other_events(tmp_path: Path) -> None:
    path = write(tmp_path, PLANT)
    with SimTwin.from_config(path, events=["2.0 gauge.parameters.bias=9.0"]) as twin:
        twin.tick(100)
        saved = twin.save()
    for at_s, bias in (("0.5", 0.25), ("0.99", 0.25), ("1.0", 3.0), ("1.5", 3.0)):
        with SimTwin.from_config(
            path, events=[f"{at_s} gauge.parameters.bias=3.0", "9.0 ball.inputs.push=1.0"]
        ) as other:
            other.restore(saved)
            other.tick(100)
            assert other.get("gauge.parameters.bias") == bias, at_s


def test_other_simulations_and_other_checkpoints_are_refused(tmp_path: Path) -> None:
    slow = copy.deepcopy(PLANT) | {"integrator": {"method": "rk4", "hz": 2000}}
    named = copy.deepcopy(PLANT)
    named["instances"]["bell"] = named["instances"].pop("ball")
    path = write(tmp_path, PLANT)
    with SimTwin.from_config(path) as twin, AlgTwin.from_config(LANDER / "fc/lander_control.json") as machine:
        twin.tick(500)
        saved, before = twin.save(), twin.snapshot()
        for bytes_, expected in (
            (b"", "begin"),
            (machine.save(), "FCSLSIMC"),
            (saved[:-1], "cut short"),
            (saved + b"0", "cut short"),
        ):
            with pytest.raises(TwinError, match=expected):
                twin.restore(bytes_)
        with pytest.raises(TwinError, match="ignore_source_hash is for AlgTwin"):
            twin.restore(saved, ignore_source_hash=True)
        with pytest.raises(TwinError, match="FCSLCKPT"):
            machine.restore(saved)
        assert not diff(before, twin.snapshot())
    for config, options, expected in (
        (slow, {}, "of another simulation"),
        (named, {}, "of another simulation"),
        (PLANT | {"tick_hz": 50}, {}, "rates|of other sources|of another"),
        (PLANT, {"duration": 2.0}, "of tick 500, and this simulation ends at tick 200"),
    ):
        with SimTwin.from_config(write(tmp_path, config, "other.sim.json"), **options) as other:
            with pytest.raises(TwinError, match=expected):
                other.restore(saved)
            assert other.get("machine.tick") == 0


RK45 = {"method": "rk45", "rtol": 1e-6, "atol": 1e-9, "min_step_s": 1e-6, "max_step_s": 0.01}


@pytest.mark.parametrize(
    ("keys", "value", "goes_on"),
    [
        (("integrator", "hz"), 2000, False),
        (("integrator", "method"), "rk2", False),
        (("integrator",), RK45, False),
        (("rates", "gauge"), 50, False),
        (("rates", "gauge"), {"hz": 100, "phase_s": 0.002}, False),  # on a grid of 500 Hz
        (("rates", "gauge"), {"hz": 500}, False),
        (("connections", 0, "from"), "ramp.seen_rate", False),
        (("connections", 0, "from"), "ball.z", False),
        (("connections",), [], False),
        (("instances", "ramp", "integrator"), {"method": "rk4", "hz": 500}, False),
        # Values come with the checkpoint.
        (("instances", "gauge", "parameters", "bias"), 1.0, True),
        (("seed",), 8, True),
        (("duration",), 900.0, True),
    ],
)
def test_what_makes_a_simulation_another_one(
    keys: tuple[str | int, ...], value: object, goes_on: bool, tmp_path: Path
) -> None:
    _compare_layouts(PLANT, keys, value, goes_on, tmp_path)


@pytest.mark.parametrize(
    ("name", "value"), [("rtol", 1e-5), ("atol", 1e-8), ("min_step_s", 1e-5), ("max_step_s", 0.005)]
)
def test_another_tolerance_or_step_makes_another_simulation(name: str, value: float, tmp_path: Path) -> None:
    _compare_layouts(PLANT | {"integrator": RK45}, ("integrator", name), value, False, tmp_path)


@pytest.mark.parametrize(("end", "port"), [("from", "other_ramp.x"), ("to", "other_gauge.truth")])
def test_another_end_of_the_same_model_makes_another_simulation(end: str, port: str, tmp_path: Path) -> None:
    instances = {**PLANT["instances"], "other_ramp": {"model": "ramp"}}
    instances["other_gauge"] = instances["gauge"]
    config = PLANT | {"instances": instances, "rates": {"gauge": 100, "other_gauge": 100}}
    _compare_layouts(config, ("connections", 0, end), port, False, tmp_path)


def test_swapped_sensors_make_another_simulation(open_sim: Callable[..., Simulation]) -> None:
    def swapped(config: dict[str, Any]) -> None:
        altitude, velocity = config["connections"][2:4]
        altitude["to"], velocity["to"] = velocity["to"], altitude["to"]

    with open_sim() as one, open_sim(swapped) as other:
        one.run(10)
        with pytest.raises(SimError, match="of another simulation"):
            other.restore_checkpoint(one.checkpoint())


def test_another_rate_on_the_same_grid_makes_another_simulation(tmp_path: Path) -> None:
    """A phase of 2 ms puts 100 Hz on a grid of 500 Hz."""
    config = PLANT | {"rates": {"gauge": {"hz": 100, "phase_s": 0.002}}}
    _compare_layouts(config, ("rates", "gauge"), 500, False, tmp_path)


@pytest.mark.parametrize(
    ("text", "instead"),
    [
        ("seen_rate", "rate_seen"),  # a name
        ("int64_t time_ns", "uint64_t time_ns"),  # a type
        ("        double x;\n        double seen_rate;", "        double seen_rate;\n        double x;"),  # offsets
        ("        int64_t time_ns;", "        int64_t time_ns;\n        double more;"),  # the size
        (".continuous_offset = offsetof(ramp_t, state.x)", ".continuous_offset = offsetof(ramp_t, state.y)"),
    ],
)
def test_another_layout_of_a_model_makes_another_simulation(text: str, instead: str, tmp_path: Path) -> None:
    path = write(tmp_path, PLANT)
    source = (TEST / "models/ramp.c").read_text().replace("double x;\n    } state", "double x, y;\n    } state")
    assert text in source
    saved = []
    for content in (source, source.replace(text, instead)):
        (tmp_path / "ramp.c").write_text(content)
        with SimTwin.from_config(path) as twin:
            for before in saved:
                with pytest.raises(TwinError, match="of another simulation: its models, their fields"):
                    twin.restore(before)
            twin.tick(10)
            saved.append(twin.save())


def _compare_layouts(
    config: dict[str, Any], keys: tuple[str | int, ...], value: object, goes_on: bool, folder: Path
) -> None:
    """Whether a checkpoint goes on in a simulation with another value."""
    changed = copy.deepcopy(config)
    node: Any = changed
    for key in keys[:-1]:
        node = node[key]
    node[keys[-1]] = value
    with SimTwin.from_config(write(folder, config)) as one, warnings.catch_warnings():
        one.tick(10)
        with SimTwin.from_config(write(folder, changed, "other.sim.json")) as other:
            if goes_on:
                other.restore(one.save())
                assert other.get("machine.tick") == 10
            else:
                with pytest.raises(TwinError, match="of another simulation: its models, their fields, rates or integ"):
                    other.restore(one.save())


@pytest.fixture(scope="module")
def damaged(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[SimTwin, bytes]]:
    """A twin with an adaptive integrator, and a checkpoint of it."""
    with SimTwin.from_config(write(tmp_path_factory.mktemp("damaged"), everything("rk45"))) as twin:
        twin.tick(300)
        saved = twin.save()
        twin.tick(50)
        yield twin, saved


SOME = settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])


@SOME
@given(data=st.data())
def test_a_damaged_byte_is_refused_and_changes_nothing(damaged: tuple[SimTwin, bytes], data: st.DataObject) -> None:
    twin, saved = damaged
    at, change = data.draw(st.integers(0, len(saved) - 1)), data.draw(st.integers(1, 255))
    before = twin.save()
    with pytest.raises(TwinError):
        twin.restore(saved[:at] + bytes([saved[at] ^ change]) + saved[at + 1 :])
    assert twin.save() == before


@SOME
@given(data=st.binary(max_size=4000), head=st.integers(0, 64))
def test_other_bytes_are_refused(damaged: tuple[SimTwin, bytes], data: bytes, head: int) -> None:
    twin, saved = damaged
    before = twin.save()
    with pytest.raises(TwinError):
        twin.restore(saved[:head] + data)
    assert twin.save() == before


@SOME
@given(data=st.data())
def test_wrong_contents_behind_a_right_crc_neither_crash_nor_hang(
    damaged: tuple[SimTwin, bytes], data: st.DataObject
) -> None:
    twin, saved = damaged
    wrong = bytearray(saved)
    for _ in range(data.draw(st.integers(1, 4))):
        size = data.draw(st.sampled_from((1, 8)))
        at = data.draw(st.integers(48, len(saved) - 4 - size))
        number = data.draw(
            st.one_of(st.binary(min_size=size, max_size=size), st.sampled_from((0.0, 1e308, float("nan"))))
        )
        wrong[at : at + size] = number if isinstance(number, bytes) else struct.pack("<d", number)[-size:]
    wrong[-4:] = zlib.crc32(wrong[:-4]).to_bytes(4, "little")
    before = twin.save()
    try:
        twin.restore(bytes(wrong))
    except TwinError:
        assert twin.save() == before
        return
    try:
        twin.tick(3)
    except TwinError as error:
        assert str(error)
    twin.restore(before)
    assert twin.save() == before


# ---- recording, files ------------------------------------------------------------------------------------------------


def test_a_bag_of_the_rest_of_a_flight_replays(lander: SimTwin, tmp_path: Path) -> None:
    lander.tick(700)
    saved = lander.save()
    lander.tick(100)
    lander.restore(saved)
    lander.record(tmp_path / "bag", "ns")
    lander.tick(400)
    with pytest.raises(TwinError, match="before it records"):
        lander.restore(saved)
    lander.stop_recording()
    result = replay(tmp_path / "bag", str(LANDER / "fc/lander_control.json"))
    assert result.identical
    assert len(columns(Bag(tmp_path / "bag"), "/ns/sim/lander:pos_z")[1]) == 400


def test_fcsl_sim_saves_and_restores_the_same_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut, end, own, bag = (tmp_path / name for name in ("cut", "end", "own", "bag"))
    assert main(["run", str(FLIGHT), "--duration", "10", "--save", str(cut)]) == 1  # before `until` has held
    assert main(["run", str(FLIGHT), "--restore", str(cut), "--record", str(bag), "--save", str(end)]) == 0
    assert replay(bag, str(LANDER / "fc/lander_control.json")).identical
    with SimTwin.from_config(FLIGHT) as twin:
        twin.tick(1000)
        assert twin.save() == cut.read_bytes()
        twin.restore_file(cut)
        twin.tick(1981)
        assert twin.save() == end.read_bytes()
        twin.save_file(own)
    capsys.readouterr()
    assert main(["run", str(FLIGHT), "--restore", str(own), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["from_tick"], summary["end"]) == (2981, "until")
    own.write_bytes(own.read_bytes()[:-1])
    assert main(["run", str(FLIGHT), "--restore", str(own)]) == 2 and f"{own}: cut short" in capsys.readouterr().err
    assert main(["run", str(FLIGHT), "--external", f"wire:unix:{own}", "--save", str(end)]) == 2


# ---- pytest, simclient -----------------------------------------------------------------------------------------------

FIXTURE = """
def test_passes(fcsl_sim):
    assert fcsl_sim("plant.sim.json", seed=3).tick(5) == 5


def test_fails(fcsl_sim):
    twin = fcsl_sim("plant.sim.json")
    twin.set("ramp.inputs.rate", 1.0)
    twin.run_until("ramp.outputs.x > 1.0", timeout_ticks=50)
"""


def test_the_fixture_opens_twins_and_shows_the_last_ticks(tmp_path: Path) -> None:
    write(tmp_path, PLANT)
    (tmp_path / "test_it.py").write_text(FIXTURE)
    line = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-q", "test_it.py", "--fcsl-failures=failures"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120)
    assert "1 failed, 1 passed" in done.stdout, done.stdout + done.stderr
    (table,) = (tmp_path / "failures").rglob("*.csv")
    assert table.name == "plant.csv" and str(table) in done.stdout
    rows = table.read_text().splitlines()
    assert len(rows) == 51 and "ramp.outputs.x" in rows[0] and "gauge.outputs.value" in rows[0]
    last = dict(zip(rows[0].split(","), rows[-1].split(","), strict=True))
    assert float(last["ramp.outputs.x"]) == pytest.approx(0.49) and last["machine.tick"] == "50"


def test_simclient_has_it_and_says_where_it_is_missing() -> None:
    def run(code: str) -> subprocess.CompletedProcess[str]:
        line = [sys.executable, "-c", code]
        return subprocess.run(line, capture_output=True, text=True, check=False, timeout=60)

    assert run("from simclient import SimTwin; print(SimTwin.__module__)").stdout == "fcsl_sim.sim_twin\n"
    removed = "import sys; sys.modules['fcsl_sim'] = None"
    never_there = "from simclient import simulation; simulation.entry_points = lambda **which: ()"
    for environment in (removed, never_there):
        missing = run(f"{environment}; from simclient import SimTwin")
        assert missing.returncode == 1 and "ImportError: SimTwin is in the package `fcsl_sim`" in missing.stderr
