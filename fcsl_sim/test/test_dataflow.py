# SPDX-License-Identifier: Apache-2.0
"""Groups of models that integrate together, direct feed-through, and what models must not do."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimConfig, SimError, Simulation

Open = Callable[..., Simulation]
Load = Callable[..., SimConfig]


def link(gain: float = 0.0, rate: float = 1.0, x: float = 0.0) -> dict[str, Any]:
    return {"model": "chain", "parameters": {"gain": gain, "rate": rate, "x": x}}


def chained(instances: dict[str, Any], *connections: tuple[str, str], **keys: Any) -> Callable[[dict[str, Any]], None]:
    """A change of RAMP: instances of `chain`, and connections between them."""

    def change(config: dict[str, Any]) -> None:
        config.update(keys)
        config["models"]["chain"] = {"source": "chain.c"}
        config["instances"].update(instances)
        config["connections"] += [{"from": source, "to": target} for source, target in connections]

    return change


def heads(error: DiagnosticError) -> list[str]:
    return [f"{d.code}: {d.message}" for d in error.diagnostics]


def test_connected_states_are_one_vector(open_sim: Open) -> None:
    """An oscillator of two models, x' = v and v' = -x: RK4 over both keeps its order across the connection."""
    errors = []
    for hz in (100, 200):
        two = {"x": link(x=1.0), "v": link(rate=-1.0)}
        change = chained(
            two, ("v.free", "x.u"), ("x.free", "v.u"), integrator={"method": "rk4", "hz": hz}, duration=2.0
        )
        with open_sim(change) as sim:
            sim.run(200)
            errors.append(abs(sim.get("x.outputs.free") - math.cos(1.99)))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, rel=0.05)


def test_an_input_of_the_group_is_new_at_every_stage_beside_a_sampled_one(open_sim: Open) -> None:
    """x' = -(x + offset), where `curve` adds the two: in its struct the sampled offset is behind x."""
    level = {"model": "sensor", "parameters": {"bias": 0.5, "sigma": 0.0, "dropout": False}, "inputs": {"truth": 0.0}}
    curve = {"model": "curve", "parameters": {"values": [0.0]}}
    instances = {"level": level, "curve": curve, "body": link(rate=-1.0, x=1.0)}
    connections = (("body.free", "curve.x"), ("level.value", "curve.offset"), ("curve.y", "body.u"))

    def change(config: dict[str, Any]) -> None:
        chained(instances, *connections)(config)
        config["models"]["curve"] = {"source": "curve.c"}
        config["rates"]["level"] = 100

    with open_sim(change) as sim:
        sim.run(100)
        assert sim.get("body.outputs.free") == pytest.approx(1.5 * math.exp(-0.99) - 0.5, rel=1e-10)


def test_feedthrough_is_evaluated_in_order_at_every_stage(open_sim: Open) -> None:
    """a -> b -> c by gains: x' of c is the product, within the same instant; names are against the order."""
    three = {"c": link(gain=2.0, rate=0.0), "b": link(gain=3.0, rate=0.0), "a": link(x=1.0, rate=0.0), "d": link()}
    connections = (("a.through", "b.u"), ("b.through", "c.u"), ("c.through", "d.u"))
    with open_sim(chained(three, *connections)) as sim:
        sim.run(100)
        assert sim.get("c.outputs.through") == 6.0
        assert sim.get("d.outputs.free") == pytest.approx(6.0 * 0.99, rel=1e-12)


def test_a_loop_closed_by_a_state_is_no_algebraic_loop(open_sim: Open) -> None:
    """a.through depends on b.through, which depends on a.free: `a` is evaluated twice."""
    two = {"a": link(gain=1.0, rate=0.0, x=5.0), "b": link(gain=2.0, rate=0.0)}
    with open_sim(chained(two, ("a.free", "b.u"), ("b.through", "a.u"))) as sim:
        sim.run(1)
        assert (sim.get("b.outputs.through"), sim.get("a.outputs.through")) == (10.0, 15.0)


def test_an_algebraic_loop_is_refused_with_its_edges(load_sim: Load) -> None:
    three = {name: link() for name in "abc"}
    change = chained(three, ("a.through", "b.u"), ("b.through", "c.u"), ("c.through", "a.u"))
    with pytest.raises(DiagnosticError) as error:
        load_sim(change)
    assert heads(error.value) == ["E803: an algebraic loop: a -> b -> c -> a"]
    notes = [note.text for note in error.value.diagnostics[0].notes]
    assert notes == ["a.through -> b.u", "b.through -> c.u", "c.through -> a.u"]


def test_groups_have_integrators_of_their_own(open_sim: Open) -> None:
    """x' = 1 is exact by any method; 2 t dt is not, by Euler."""
    euler, rk4 = {"method": "euler", "hz": 100}, {"method": "rk4", "hz": 1000}
    instances = {name: link() for name in ("slow", "slower", "fast", "faster")}
    instances["slow"]["integrator"] = euler
    connections = (("ramp.x", "fast.u"), ("fast.free", "faster.u"), ("slow.free", "slower.u"))
    change = chained(instances, *connections, integrator=rk4)

    def constant(config: dict[str, Any]) -> None:
        change(config)
        config["events"] = [{"at_s": 0.0, "set": "slow.inputs.u", "value": 1.0}]

    with open_sim(constant) as sim:
        sim.run(100)
        t = 0.99
        assert sim.get("faster.outputs.free") == pytest.approx(t**3 / 6, rel=1e-9)
        assert sim.get("slow.outputs.free") == pytest.approx(t, rel=1e-12)
        assert sim.get("slower.outputs.free") == pytest.approx(t * (t - 0.01) / 2, rel=1e-12)


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        ({"method": "euler", "hz": 100}, {"method": "rk4", "hz": 100}, "E808: `b` and `a` are directly connected, and"),
        ({"method": "verlet", "hz": 100}, None, "E808: `a` cannot be integrated by verlet"),
        ({"method": "rk45", "hz": 100}, None, "E804: `hz` with `rk45`: its steps follow from the tolerances"),
        ({"method": "rk4", "hz": 100, "rtol": 1e-3}, None, "E804: `rtol` with `rk4`: only rk45 chooses its steps"),
        ({"method": "rk4"}, None, "E202: `hz` is missing: rk4 makes steps of fixed size"),
        ({"method": "rk5", "hz": 100}, None, "E205: `method` cannot be `rk5`"),
        ({"method": "rk4", "hz": 150}, None, "E805: the integrator's 150 Hz is not a multiple of tick_hz (100)"),
        ({"method": "rk45", "atol": 0.0}, None, "E204: `atol` is 0"),
        (
            {"method": "rk45", "min_step_s": 1e-2, "max_step_s": 1e-3},
            None,
            "E804: `min_step_s` (0.01) is above `max_step_s` (0.001)",
        ),
    ],
)
def test_integrators_that_are_refused(
    first: dict[str, Any], second: dict[str, Any] | None, message: str, load_sim: Load
) -> None:
    two = {"a": link() | {"integrator": first}, "b": link() | ({"integrator": second} if second else {})}
    with pytest.raises(DiagnosticError) as error:
        load_sim(chained(two, ("a.free", "b.u")))
    assert heads(error.value)[0].startswith(message)


def test_tolerances_of_states(open_sim: Open, load_sim: Load) -> None:
    rk45 = {"method": "rk45", "rtol": 1e-12, "atol": 1.0}
    two = {"x": link(x=1.0), "v": link(rate=-1.0) | {"tolerances": {"state.x": 1e-12}}}
    change = chained(two, ("v.free", "x.u"), ("x.free", "v.u"), integrator=rk45)
    assert "tolerance v 0 " in load_sim(change).plan.text
    with open_sim(change) as sim:
        sim.run(100)
        assert sim.get("x.outputs.free") == pytest.approx(math.cos(0.99), abs=1e-11)
    two["v"]["tolerances"] = {"state.calls": 1e-12}
    with pytest.raises(DiagnosticError) as error:
        load_sim(change)
    assert heads(error.value) == ["E216: `v` has no continuous state `state.calls`"]


def test_a_phase_delays_the_updates(open_sim: Open) -> None:
    def change(config: dict[str, Any]) -> None:
        config["rates"]["altimeter"] = {"hz": 20, "phase_s": 0.013}

    with open_sim(change) as sim:
        sim.run(100)
        # samples at 0.013, 0.063, …, 0.963; ramp is at the time itself
        assert sim.machine_value("pilot.outputs.samples") == 20
        assert sim.machine_value("pilot.outputs.pos_z") == pytest.approx(0.963, abs=1e-12)


@pytest.mark.parametrize("name", ["a", "z"])
def test_what_an_update_makes_is_read_after_it_whatever_the_names(name: str, open_sim: Open) -> None:
    """Also where the model has an `output`, too."""

    def change(config: dict[str, Any]) -> None:
        config["models"]["counter"] = {"source": "counter.c"}
        config["instances"] |= {"m": {"model": "counter"}, name: config["instances"]["altimeter"]}
        config["connections"].append({"from": "m.count", "to": f"{name}.truth"})
        config["rates"] |= {"m": 100, name: 100}

    with open_sim(change) as sim:
        for ticks in range(1, 5):
            sim.run(1)
            assert sim.get(f"{name}.outputs.value") == ticks == sim.get("m.outputs.count")


@pytest.mark.parametrize(
    ("rate", "message"),
    [
        ({"hz": 20, "phase_s": 0.05}, "E804: the phase 0.05 s is not within the period of 20 Hz"),
        ({"hz": 20, "phase_s": 0.0125}, "E220: 20 Hz from 0.0125 s on is not on the grid of the integrator's 1000 Hz"),
        ({"hz": 20, "phase_s": 1e-10}, "E804: the phase 1e-10 s is finer than a nanosecond"),
        ({"hz": 20, "phase": 1}, "E201: "),
        ({}, "E202: "),
    ],
)
def test_rates_that_are_refused(rate: dict[str, Any], message: str, load_sim: Load) -> None:
    with pytest.raises(DiagnosticError) as error:
        load_sim(lambda config: config["rates"].update(altimeter=rate))
    assert heads(error.value)[0].startswith(message)


def test_rk45_samples_between_its_steps(open_sim: Open) -> None:
    """A sensor off every grid reads the interpolated state, and makes no step shorter."""
    rk45 = {"method": "rk45", "rtol": 1e-9, "atol": 1e-9}

    def flown(rate: Any) -> tuple[float, float]:
        two = {"x": link(x=1.0), "v": link(rate=-1.0)}
        change = chained(two, ("v.free", "x.u"), ("x.free", "v.u"), integrator=rk45)

        def sampled(config: dict[str, Any]) -> None:
            change(config)
            config["connections"][0]["from"] = "x.free"
            config["rates"]["altimeter"] = rate

        with open_sim(sampled) as sim:
            sim.run(100)
            return sim.get("altimeter.outputs.value"), sim.get("x.state.x")

    seen, state = flown({"hz": 7, "phase_s": 0.0123})
    last = 0.0123 + 6 / 7
    assert seen == pytest.approx(math.cos(last), abs=1e-9)
    assert state == flown(100)[1]


def test_an_event_between_two_steps_splits_one(open_sim: Open) -> None:
    """Exactly at its time, not at the next step."""

    def change(config: dict[str, Any]) -> None:
        chained({"a": link()})(config)
        config["events"] = [{"at_s": 0.5003, "set": "a.inputs.u", "value": 1.0}]

    with open_sim(change) as sim:
        sim.run(100)
        assert sim.get("a.outputs.free") == pytest.approx(0.99 - 0.5003, rel=1e-12)


@pytest.mark.parametrize(
    ("macro", "message"),
    [
        ("IMPURE", "`output` of model `chain` changes a.state.calls, which is no output; states change in `update`"),
        ("SECRET", "model `chain`: `outputs.free` depends on an input of the same instant, and is not declared so"),
        (
            "SECRET_MODE",
            "model `chain`: `outputs.free` depends on an input of the same instant, and is not declared so",
        ),
    ],
)
def test_models_that_break_the_rules(macro: str, message: str, load_sim: Load) -> None:
    config = load_sim(chained({"a": link()}), define=macro)
    with pytest.raises(SimError) as error:
        Simulation(config.plan, config.tables)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize("method", ["rk4", "rk45"])
def test_a_value_that_is_no_number_ends_the_run(method: str, open_sim: Open) -> None:
    """x' = 1 / (0.05 - t) + x: at 0.05 s there is none."""
    integrator = {"method": method} | ({"hz": 1000} if method == "rk4" else {})
    change = chained({"a": link()}, integrator=integrator)
    with open_sim(change, define="BLOWS_UP") as sim, pytest.raises(SimError) as error:
        sim.run(100)
    text = str(error.value)
    if method == "rk4":
        assert text == "a.state.x became inf at 0.050000000 s"
    else:
        assert text.startswith("the step underflows at 0.0") and "the error of a.state.x is" in text


def test_an_output_that_is_no_number_ends_the_run(open_sim: Open) -> None:
    two = {"a": link(gain=1e200, rate=0.0, x=1e200), "b": link(gain=1e200, rate=0.0)}
    with open_sim(chained(two, ("a.free", "b.u"))) as sim, pytest.raises(SimError) as error:
        sim.run(100)
    assert str(error.value) == "b.outputs.through became inf at 0.000000000 s"


METHODS: list[dict[str, Any]] = [
    *({"method": method, "hz": 100} for method in ("euler", "rk2", "rk4")),
    {"method": "ab4", "hz": 1000},
    {"method": "rk45", "rtol": 1e-9, "atol": 1e-9},
]


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("name", ["a", "z"])
def test_a_jump_of_a_sensor_is_noticed(name: str, integrator: dict[str, Any], open_sim: Open) -> None:
    """v' = u, where u holds the samples k/20 of a sensor with 20 Hz; every method is exact between two of them."""

    def change(config: dict[str, Any]) -> None:
        chained({name: link(gain=1.0)}, ("altimeter.value", f"{name}.u"), integrator=integrator)(config)
        config["rates"]["altimeter"] = 20

    with open_sim(change) as sim:
        sim.run(100)
        assert sim.get(f"{name}.outputs.free") == pytest.approx(sum(k / 400 for k in range(19)) + 0.95 * 0.04, rel=1e-9)


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("beside", [100, 1000, 7, {"hz": 30, "phase_s": 0.0123}])
def test_a_sensor_beside_it_changes_no_bit(beside: Any, integrator: dict[str, Any], open_sim: Open) -> None:
    def flown(*others: Any) -> list[Any]:
        two = {"x": link(x=1.0), "v": link(rate=-1.0)}
        change = chained(two, ("v.free", "x.u"), ("x.free", "v.u"), integrator=integrator)

        def with_others(config: dict[str, Any]) -> None:
            change(config)
            for number, rate in enumerate(others):
                config["instances"][f"other{number}"] = config["instances"]["altimeter"]
                config["rates"][f"other{number}"] = rate
            if others:
                config["instances"]["still"] = link()
                config["events"] = [{"at_s": 0.12345, "set": "still.inputs.u", "value": 1.0}]

        values = []
        with open_sim(with_others) as sim:
            while sim.status == "running":
                sim.run(1)
                values += [sim.get("x.state.x"), sim.get("v.state.x")]
        return values

    assert flown() == flown(beside)


def test_the_largest_step_is_never_exceeded(open_sim: Open) -> None:
    """Ticks are 10 ms apart: with steps of at most 9.2 ms there are two in each."""

    def error(limit: float) -> float:
        two = {"x": link(x=1.0), "v": link(rate=-1.0)}
        loose = {"method": "rk45", "rtol": 1e-1, "atol": 1e-1, "max_step_s": limit}
        with open_sim(chained(two, ("v.free", "x.u"), ("x.free", "v.u"), integrator=loose)) as sim:
            sim.run(100)
            return abs(sim.get("x.outputs.free") - math.cos(0.99))

    assert error(0.0092) == error(0.005) < error(0.01)


def test_a_derivative_that_reads_the_struct_is_refused(load_sim: Load) -> None:
    config = load_sim(chained({"a": link(), "b": link()}, ("a.free", "b.u")), define="STALE")
    with pytest.raises(SimError) as error:
        Simulation(config.plan, config.tables)
    assert str(error.value).startswith(
        "`derivative` of model `chain` reads integrated states, or outputs, in the struct"
    )


def test_settings_without_an_effect_are_refused(load_sim: Load) -> None:
    def tolerances(config: dict[str, Any]) -> None:
        chained({"a": link() | {"tolerances": {"state.x": 1.0}}})(config)

    def integrator(config: dict[str, Any]) -> None:
        config["instances"]["altimeter"]["integrator"] = {"method": "rk4", "hz": 100}

    for change, message in (
        (tolerances, "E804: `tolerances` of `a`: only rk45 chooses its steps"),
        (integrator, "E808: `altimeter` has an integrator, and nothing to integrate or to locate"),
    ):
        with pytest.raises(DiagnosticError) as error:
            load_sim(change)
        assert heads(error.value) == [message]


@pytest.mark.parametrize(
    ("macro", "message"),
    [
        ("FORGETS_DX", "`derivative` of model `chain` does not write dx[0], that of a.state.x"),
        ("FORGETS_OUTPUT", "`output` of model `chain` does not write a.outputs.free"),
        ("FORGETS_ELEMENT", "`output` of model `chain` does not write a.outputs.nested.both[1]"),
        ("WRITES_MORE", "`derivative` or `event` of model `chain` writes more values than the model has"),
    ],
)
def test_what_is_forgotten_or_too_much_is_refused(macro: str, message: str, load_sim: Load) -> None:
    config = load_sim(chained({"a": link()}), define=macro)
    with pytest.raises(SimError) as error:
        Simulation(config.plan, config.tables)
    assert str(error.value) == message
