# SPDX-License-Identifier: Apache-2.0
"""Events of models, against closed forms: when they happen, in which order, and what ends them."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import open_models

from fcsl_sim import SimError, Simulation, load

Open = Callable[..., Simulation]
INTEGRATORS: list[dict[str, Any]] = [
    *({"method": method, "hz": 1000} for method in ("rk2", "rk4", "ab4")),
    {"method": "rk4", "hz": 100},
    {"method": "rk45", "rtol": 1e-10, "atol": 1e-12},
]


def ball(**parameters: float) -> dict[str, Any]:
    values = {"gravity": 9.81, "restitution": 0.7, "rest_speed": 0.5, "height": 2.0} | parameters
    return {"model": "ball", "parameters": values}


def bounces(height: float, gravity: float, restitution: float, count: int) -> list[float]:
    """Times of the first bounces of a ball that is dropped, in s."""
    at = math.sqrt(2 * height / gravity)
    flight = 2 * at * restitution
    times = [at]
    for _ in range(count - 1):
        times.append(times[-1] + flight)
        flight *= restitution
    return times


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_ball_bounces_to_the_nanosecond_and_comes_to_rest(integrator: dict[str, Any], open_sim: Open) -> None:
    """Each bounce is at most 1 ns late, and a late one makes the next ones later: by some ns after twelve."""
    expected = bounces(2.0, 9.81, 0.7, 12)
    with open_models(open_sim, {"ball": ball()}, integrator=integrator, duration=5.0) as sim:
        seen = []
        while sim.status == "running":
            sim.run(1)
            if sim.get("ball.outputs.bounces") > len(seen):
                seen.append(sim.get("ball.outputs.last_bounce_ns"))
        assert sim.get("ball.outputs.z") == 0.0 and sim.get("ball.outputs.v") == 0.0
    for ns, time_s in zip(seen, expected, strict=False):
        assert -1e-9 < ns / 1e9 - time_s < 20e-9
    # rest: the first bounce that would leave with less than 0.5 m/s
    speed = math.sqrt(2 * 9.81 * 2.0)
    assert len(seen) == math.ceil(math.log(0.5 / speed) / math.log(0.7))


def test_what_follows_an_event_is_exact(open_sim: Open) -> None:
    """Between two bounces the ball is on its parabola, wherever the steps of the integrator are."""
    with open_models(open_sim, {"ball": ball(restitution=1.0)}, duration=1.0) as sim:
        first = math.sqrt(2 * 2.0 / 9.81)
        while sim.status == "running":
            sim.run(1)
            t = (sim.tick - 1) / 100 - first
            if t > 0:
                speed = 9.81 * first
                assert sim.get("ball.outputs.z") == pytest.approx(speed * t - 9.81 / 2 * t * t, abs=1e-7)


def test_a_zeno_ball_is_chattering_and_named(open_sim: Open) -> None:
    with (
        open_models(open_sim, {"ball": ball(rest_speed=-1.0)}, duration=10.0) as sim,
        pytest.raises(
            SimError, match=r"^chattering at 3\.6\d+ s: event `bounce` of `ball` is the last of 100 in a row"
        ),
    ):
        while sim.status == "running":
            sim.run(1)


def test_events_of_one_instant_are_handled_in_dataflow_order(open_sim: Open) -> None:
    """Two balls that touch at once bounce at once: neither hides the other."""
    balls = {name: ball() for name in ("one", "two")} | {"low": ball(height=1.0)}
    with open_models(open_sim, balls, duration=1.0) as sim:
        sim.run(100)
        assert sim.get("one.outputs.last_bounce_ns") == sim.get("two.outputs.last_bounce_ns")
        assert sim.get("one.outputs.last_bounce_ns") > sim.get("low.outputs.last_bounce_ns") > 0
        assert {sim.get(f"{name}.outputs.bounces") for name in balls} == {1}


def test_an_instance_beside_it_changes_nothing(open_sim: Open) -> None:
    """Neither its noise nor the events of another group."""

    def flown(instances: dict[str, Any]) -> list[float]:
        values = []
        with open_models(open_sim, instances, duration=2.0) as sim:
            while sim.status == "running":
                sim.run(1)
                values += [sim.get("ball.state.z"), sim.get("ball.state.v"), sim.get("altimeter.outputs.value")]
        return values

    alone = flown({"ball": ball()})
    assert alone == flown({"ball": ball(), "beside": ball(height=0.3), "another": ball(height=7.0)})


def test_a_jump_of_an_input_may_be_the_event(lander: Path) -> None:
    """The engine's thrust exceeds the weight when the tick opens the throttle: the event is at this tick."""
    config = load(lander)
    with Simulation(config.plan, config.tables) as sim:
        assert sim.get("lander.state.on_ground") is True
        while sim.machine_value("engine.outputs.throttle") == 0.0:
            sim.run(1)
        assert sim.get("lander.state.on_ground") is True  # at the tick itself it stands
        thrust = 2000.0 * sim.machine_value("engine.outputs.throttle")
        sim.run(1)
        assert sim.get("lander.state.on_ground") is False
        assert sim.get("lander.outputs.vel_z") == pytest.approx(0.01 * (thrust / 500.0 - 1.62), rel=1e-3)


def test_burnout_is_at_its_instant(lander: Path) -> None:
    """Fuel for 0.0213 s of full thrust: mass, and speed by the rocket equation."""
    isp, g0, thrust, dry = 220.0, 9.80665, 2000.0, 400.0
    fuel = 0.0213 * thrust / (isp * g0)
    sets = [f"lander.parameters.fuel_mass={fuel!r}", "lander.parameters.gravity=0.0"]
    config = load(lander, sets=[*sets, "lander.parameters.min_thrust=2000.0"])
    with Simulation(config.plan, config.tables) as sim:
        sim.run(20)
        assert sim.get("lander.state.empty") is True and sim.get("lander.outputs.mass") == dry
        speed = isp * g0 * math.log((dry + fuel) / dry)
        assert sim.get("lander.outputs.vel_z") == pytest.approx(speed, rel=1e-8)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_touchdown_speed(integrator: dict[str, Any], lander: Path, open_sim: Open) -> None:
    """Dropped without an engine: v^2 = 2 g h."""
    with open_models(
        open_sim, {"ball": ball(gravity=1.62, height=100.0, restitution=0.0)}, integrator=integrator, duration=12.0
    ) as sim:
        sim.run(1200)
        assert sim.get("ball.outputs.last_bounce_ns") / 1e9 == pytest.approx(math.sqrt(200 / 1.62), abs=2e-9)


def alarm(first: float, period: float, kind: int = 0) -> dict[str, Any]:
    return {"model": "alarm", "parameters": {"first": first, "period": period, "kind": kind}}


@pytest.mark.parametrize("integrator", [{"method": "rk4", "hz": hz} for hz in (100, 1000, 3000)] + INTEGRATORS[-1:])
@pytest.mark.parametrize(("first", "period"), [(0.001, 0.001), (0.01, 0.01), (0.0107, 0.0123)])
def test_an_event_of_time_happens_once(first: float, period: float, integrator: dict[str, Any], open_sim: Open) -> None:
    """Also where it is exactly at a step of the grid, at a tick, or between them."""
    with open_models(open_sim, {"clock": alarm(first, period)}, integrator=integrator, duration=1.0) as sim:
        for tick in range(100):
            sim.run(1)
            seen = sim.get("clock.outputs.count")
            assert seen == sum(first + k * period < tick / 100 - 1e-9 for k in range(1001)) or seen == sum(
                first + k * period <= tick / 100 + 1e-9 for k in range(1001)
            )
        last = first + (seen - 1) * period
        assert 0 <= sim.get("clock.outputs.last_ns") - last * 1e9 < 2


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_function_that_only_touches_zero_is_no_event(integrator: dict[str, Any], open_sim: Open) -> None:
    with open_models(open_sim, {"clock": alarm(0.5, 1.0, kind=1)}, integrator=integrator) as sim:
        sim.run(100)
        assert sim.get("clock.outputs.count") == 0


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_function_that_is_no_number_ends_the_run(integrator: dict[str, Any], open_sim: Open) -> None:
    with (
        open_models(open_sim, {"clock": alarm(0.5, 1.0, kind=2)}, integrator=integrator) as sim,
        pytest.raises(SimError, match=r"^the function of event `alarm` of `clock` is no number at 0\.5"),
    ):
        sim.run(100)


def test_a_hundred_at_once_are_no_chattering(open_sim: Open) -> None:
    """One group of 100 balls, pushed by the same ramp."""

    def change(config: dict[str, Any]) -> None:
        config["models"]["ball"] = {"source": "ball.c"}
        for i in range(100):
            config["instances"][f"b{i}"] = ball()
            config["connections"].append({"from": "ramp.seen_rate", "to": f"b{i}.push"})

    with open_sim(change) as sim:
        sim.run(100)
        assert {sim.get(f"b{i}.outputs.bounces") for i in range(100)} == {1}


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_staging(integrator: dict[str, Any], open_sim: Open) -> None:
    """Burnouts at fuel / flow, and the speed by Tsiolkovsky's equation for each stage."""
    dry, fuel, thrust, flow = [100.0, 20.0], [50.0, 30.0], [9000.0, 3000.0], [40.0, 31.0]
    parameters = {"dry": dry, "fuel": fuel, "thrust": thrust, "flow": flow}
    stages = {"rocket": {"model": "stages", "parameters": parameters}}
    with open_models(open_sim, stages, integrator=integrator, duration=3.0) as sim:
        sim.run(300)
        ends = [fuel[0] / flow[0], fuel[0] / flow[0] + fuel[1] / flow[1]]
        for ns, time_s in zip(sim.get("rocket.outputs.burnout_ns"), ends, strict=True):
            assert -1e-9 < ns / 1e9 - time_s < 4e-9
        first = thrust[0] / flow[0] * math.log(200.0 / 150.0)
        second = thrust[1] / flow[1] * math.log(50.0 / 20.0)
        assert sim.get("rocket.outputs.v") == pytest.approx(
            first + second, rel=1e-4 if integrator == INTEGRATORS[0] else 1e-7
        )
        assert sim.get("rocket.outputs.stage") == 2
        assert sim.get("rocket.outputs.mass") == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_saturation(integrator: dict[str, Any], open_sim: Open) -> None:
    """x(t) by hand: up to the end, held there, down from the instant at which the input turns, held again."""
    piston = {"piston": {"model": "piston", "parameters": {"travel": 0.3, "start": 0.1}}}
    turns = [(0.1, 1.7), (0.4503, -0.9), (0.9, 2.0)]
    events = [{"at_s": at, "set": "piston.inputs.u", "value": u} for at, u in turns]

    def exact(t: float) -> float:
        x, before, u = 0.1, 0.0, 0.0
        for at, following in [*turns, (t, 0.0)]:
            until = min(at, t)
            x = min(max(x + u * max(until - before, 0.0), 0.0), 0.3)
            before, u = until, following
        return x

    with open_models(open_sim, piston, integrator=integrator, events=events) as sim:
        ends = set()
        for tick in range(100):
            sim.run(1)
            assert sim.get("piston.outputs.x") == pytest.approx(exact(tick / 100), abs=1e-8), tick
            ends.add(sim.get("piston.outputs.at"))
        assert ends == {0, 1, 2}
