# SPDX-License-Identifier: Apache-2.0
"""The order of events at t_k."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_sim import SimConfig, SimError, Simulation
from fcsl_sim.runner import run
from simclient.link.message import Channel, Kind, Message, encode
from simclient.run import open_run

Open = Callable[..., Simulation]


def near(value: Any, wanted: float) -> bool:
    return bool(abs(value - wanted) < 1e-12)


def test_sensors_see_the_plant_at_t_k_and_actuators_hold_from_t_k(open_sim: Open) -> None:
    with open_sim() as sim:
        for tick in range(100):
            assert sim.run(1) == 1
            assert near(sim.machine_value("pilot.outputs.pos_z"), tick / 100)
            assert sim.get("ramp.outputs.time_ns") == tick * 10_000_000
            # the command of tick 0 holds from t_0 on: the update at t_0 does not use it, that at t_1 does
            assert sim.machine_value("pilot.outputs.vel_z") == (0.0 if tick == 0 else 1.0)
        assert sim.status == "duration"
        with pytest.raises(SimError, match="the simulation is over"):
            sim.sense()


def test_a_slow_sensor_is_sampled_at_its_rate(open_sim: Open) -> None:
    def change(config: dict[str, Any]) -> None:
        config["rates"]["altimeter"] = 20

    with open_sim(change) as sim:
        for tick in range(100):
            sim.run(1)
            assert sim.machine_value("pilot.outputs.samples") == 1 + tick // 5
            assert near(sim.machine_value("pilot.outputs.pos_z"), (tick // 5) * 5 / 100)


def test_a_fast_sensor_gives_its_newest_sample(open_sim: Open) -> None:
    def change(config: dict[str, Any]) -> None:
        config["rates"]["altimeter"] = 500

    with open_sim(change) as sim:
        sim.run(50)
        assert sim.machine_value("pilot.outputs.samples") == 50
        assert near(sim.machine_value("pilot.outputs.pos_z"), 0.49)


def test_a_dropout_leaves_the_channel_out_of_the_message(open_sim: Open) -> None:
    def change(config: dict[str, Any]) -> None:
        config["events"] = [
            {"at_s": 0.3, "set": "altimeter.parameters.dropout", "value": True},
            {"at_s": 0.6, "set": "altimeter.parameters.dropout", "value": False},
        ]

    with open_sim(change) as sim:
        health = []
        for _ in range(100):
            sim.run(1)
            health.append(sim.machine_value("pilot.outputs.health"))
        assert sim.machine_value("pilot.outputs.samples") == 70
        # an event at t_k comes before the samples of t_k; the channel is valid for 5 more ticks
        assert health == ["nominal"] * 35 + ["failed"] * 25 + ["nominal"] * 40


@pytest.mark.parametrize(("first_s", "first_tick"), [(0.0, 0), (0.25, 25), (0.251, 26), (60.0, 100)])
def test_a_channel_gets_its_first_sample_late(first_s: float, first_tick: int, open_sim: Open) -> None:
    """What the sensor took before is lost: the first sample is a new one."""

    def change(config: dict[str, Any]) -> None:
        config["connections"][2]["first_sample_s"] = first_s
        config["rates"]["altimeter"] = 50

    with open_sim(change) as sim:
        seen = []
        for _ in range(100):
            sim.run(1)
            seen.append(sim.machine_value("pilot.outputs.samples"))
    first_even = first_tick + first_tick % 2
    assert seen == [max(0, (tick - first_even) // 2 + 1) for tick in range(100)]


def test_events_at_one_time_apply_in_the_order_of_the_file(open_sim: Open) -> None:
    def change(config: dict[str, Any]) -> None:
        set_bias = {"at_s": 0.5, "set": "altimeter.parameters.bias"}
        config["events"] = [set_bias | {"value": 5.0}, set_bias | {"value": 7.0}]

    with open_sim(change) as sim:
        sim.run(51)
        assert near(sim.machine_value("pilot.outputs.pos_z"), 7.5)


def test_until_counts_ticks_in_a_row(load_sim: Callable[..., SimConfig]) -> None:
    def change(config: dict[str, Any]) -> None:
        config["until"] = {"condition": "ramp.outputs.x > 0.2", "for_s": 0.1}

    summary = run(load_sim(change))
    assert summary.end == "until"
    # above 0.2 from tick 21 on (20 gives 0.2 itself, or a rounding error more); 0.1 s later the condition has held
    assert summary.ticks in (31, 32)


@pytest.mark.parametrize(
    ("condition", "end", "ticks"),
    [("> -1", "until", 1), ("< -1", "duration", 100), ("== 10000000", "until", 2), ("// 0 == 1", "duration", 100)],
)
def test_until_compares_integers_with_their_sign_and_holds_nowhere_without_a_value(
    load_sim: Callable[..., SimConfig], condition: str, end: str, ticks: int
) -> None:
    until = {"condition": f"ramp.outputs.time_ns {condition}"}
    summary = run(load_sim(lambda config: config.update(until=until)))
    assert (summary.end, summary.ticks) == (end, ticks)


def test_the_caller_may_be_the_controller(open_sim: Open, hopper: tuple[Path, str]) -> None:
    """Message by message, the same bits as with the machine hosted by the simulator."""
    with open_sim() as hosted, open_sim() as stepped:
        messages = []
        while stepped.status == "running":
            messages.append(stepped.sense())
            if len(messages) == 1:
                with pytest.raises(SimError, match="tick 0 was sensed and waits for its actuator message"):
                    stepped.sense()
            hosted.run(1)
            stepped.actuate(actuator_message(stepped, hosted))
            assert stepped.get("ramp.state.x") == hosted.get("ramp.state.x")
        run_ = open_run(*hopper)
        run_.attach()
        for message in messages:
            run_.sense(message)
            run_.step(1)
        field = run_.machine.fields["pilot.outputs.samples"]
        assert run_.read(field.offset, field.size) == (100).to_bytes(8, "little")
        run_.close()


def actuator_message(stepped: Simulation, hosted: Simulation) -> bytes:
    """The hosted machine's actuator message, encoded by the Python implementation."""
    f64 = 6
    table = [Channel(1, False, f64), Channel(2, False, f64), Channel(16, True, f64)]
    values = {16: [hosted.machine_value("pilot.outputs.throttle")]}
    return encode(Message(Kind.ACTUATORS, stepped.tick, values, armed=True), table)


def test_actuator_messages_are_checked(open_sim: Open) -> None:
    with open_sim() as sim, open_sim() as hosted:
        hosted.run(1)
        good = actuator_message(sim, hosted)
        with pytest.raises(SimError, match="tick 0, which was not sensed yet"):
            sim.actuate(good)
        sim.sense()
        for size in range(len(good)):
            with pytest.raises(SimError, match="actuator message of tick 0 refused"):
                sim.actuate(good[:size])
        with pytest.raises(SimError, match="refused: checksum mismatch"):
            sim.actuate(good[:30] + bytes([good[30] ^ 1]) + good[31:])
        sim.actuate(good)
        sim.sense()
        with pytest.raises(SimError, match="actuator message of tick 0 where that of tick 1 is due"):
            sim.actuate(good)
