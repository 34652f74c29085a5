# SPDX-License-Identifier: Apache-2.0
"""A serial line between plant and controller: what it loses, how long it takes, and that it repeats bit for bit."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from test_determinism import digest, noisy

from fcsl_sim import SimError, Simulation

Open = Callable[..., Simulation]

#: A line that changes nothing.
CLEAN = {
    "reliable": True,
    "halts": True,
    "drop_percent": 0.0,
    "corrupt_percent": 0.0,
    "bit_error_percent": 0.0,
    "delay_s": 0.0,
    "baud": 0.0,
    "retransmit_ticks": 3,
}


def line(**parameters: float | bool) -> Callable[[dict[str, Any]], None]:
    def change(config: dict[str, Any]) -> None:
        noisy(config)
        config["controller"]["link"] = "line"
        config["models"]["serial_link"] = {"source": "package://fcsl_sim/models/serial_link.c"}
        config["instances"]["line"] = {"model": "serial_link", "parameters": {**CLEAN, **parameters}}
        config["rates"]["line"] = 1000

    return change


def flown(sim: Simulation) -> list[float]:
    """The ramp and the command, tick by tick; the line's own counters are left out."""
    values = []
    with sim:
        while sim.status == "running":
            sim.run(1)
            values += [sim.get("ramp.outputs.x"), sim.machine_value("pilot.outputs.pos_z")]
    return values


def counted(sim: Simulation) -> dict[str, int]:
    with sim:
        sim.run(10_000)
        names = ("frames", "dropped", "corrupted", "repeated", "sensors", "commands", "lost", "refused")
        return {name: int(sim.get(f"line.outputs.{name}")) for name in names}


@pytest.mark.parametrize(
    "loss",
    [{}, {"drop_percent": 10.0, "corrupt_percent": 5.0}, {"drop_percent": 60.0}, {"bit_error_percent": 0.05}],
)
def test_while_time_halts_a_reliable_port_hides_all_losses(loss: dict[str, float], open_sim: Open) -> None:
    assert flown(open_sim(line(**loss))) == flown(open_sim(noisy))


def test_what_is_lost_is_what_was_said(open_sim: Open) -> None:
    """Within five deviations of a binomial number."""
    found = counted(open_sim(line(drop_percent=10.0, corrupt_percent=5.0)))
    frames = found["frames"]
    for name, share in (("dropped", 0.1), ("corrupted", 0.9 * 0.05)):
        assert abs(found[name] - share * frames) < 5 * math.sqrt(share * (1 - share) * frames)
    assert found["dropped"] // 2 <= found["repeated"] <= frames - 200  # acknowledgements are lost, too
    assert (found["sensors"], found["commands"], found["lost"], found["refused"]) == (100, 100, 0, 0)


@pytest.mark.parametrize(
    "parameters",
    [
        {"reliable": False, "halts": False, "drop_percent": 10.0},
        {"halts": False, "delay_s": 0.02, "retransmit_ticks": 60},
        {"halts": False, "reliable": False, "baud": 57600.0, "bit_error_percent": 0.02},
    ],
)
def test_where_time_passes_the_run_differs_and_repeats(parameters: dict[str, float | bool], open_sim: Open) -> None:
    change = line(**parameters)
    assert digest(open_sim(change)) == digest(open_sim(change))
    assert flown(open_sim(change)) != flown(open_sim(noisy))


def test_bits_flip_below_a_percent_of_them(open_sim: Open) -> None:
    """Damaged frames are sent again, and nothing is lost. A frame of n bits is damaged with 1 - (1 - p)^n; n is 200 to 450."""
    found = counted(open_sim(line(bit_error_percent=0.05)))
    low, high = (found["frames"] * (1 - (1 - 0.0005) ** bits) for bits in (200, 450))
    assert low < found["corrupted"] < high and found["repeated"] > 0
    assert (found["sensors"], found["commands"], found["lost"]) == (100, 100, 0)


def test_a_clean_line_repeats_and_loses_nothing(open_sim: Open) -> None:
    found = counted(open_sim(line()))
    assert found == found | dict.fromkeys(("dropped", "corrupted", "repeated", "lost", "refused"), 0)
    assert found["frames"] >= found["sensors"] + found["commands"] == 200


def test_what_an_unreliable_line_loses_is_counted(open_sim: Open) -> None:
    """Each message is one frame. Of the loss of the last one, each way, the other end does not know."""
    found = counted(open_sim(line(reliable=False, halts=False, drop_percent=10.0)))
    assert found["repeated"] == 0 and 198 <= found["frames"] <= 200 and found["dropped"] > 5
    assert 0 <= found["dropped"] - found["lost"] <= 2
    assert 0 <= found["frames"] - found["sensors"] - found["commands"] - found["dropped"] <= 2  # under way


def test_the_seed_chooses_what_is_lost(open_sim: Open) -> None:
    change = line(drop_percent=10.0)
    assert counted(open_sim(change)) != counted(open_sim(change, seed=2))


def test_delay_and_speed_are_those_of_the_line(open_sim: Open) -> None:
    """A sample of tick 0 is there after the delay, the time of its bytes, and the link tick that follows."""
    for delay_s, baud in ((0.05, 0.0), (0.0, 9600.0)):
        with open_sim(line(reliable=False, halts=False, delay_s=delay_s, baud=baud)) as sim:
            ticks = 0
            while sim.get("line.outputs.sensors") == 0:
                sim.run(1)
                ticks += 1
        wire_s = 0.0 if baud == 0.0 else (25 + 2 * 12 + 8 + 2) * 10 / baud  # two f64 channels, header, CRC, COBS
        assert ticks == math.ceil((0.001 + delay_s + wire_s) * 100) + 1


def test_an_outage_is_an_event(open_sim: Open) -> None:
    """The controller gets nothing while it lasts."""

    def change(config: dict[str, Any]) -> None:
        line(reliable=False, halts=False)(config)
        config["events"] = [
            {"at_s": 0.3, "set": "line.parameters.drop_percent", "value": 100.0},
            {"at_s": 0.6, "set": "line.parameters.drop_percent", "value": 0.0},
        ]

    with open_sim(change) as sim:
        sensors = [int(sim.get("line.outputs.sensors")) for _ in range(100) if sim.run(1)]
    assert sensors[30] - sensors[5] == 25 and sensors[60] == sensors[31] and sensors[99] - sensors[62] == 37


def test_a_line_that_loses_all_is_told(open_sim: Open) -> None:
    with open_sim(line(drop_percent=100.0)) as sim, pytest.raises(SimError, match="tick 0: serial_link has delivered"):
        sim.run(1)


@pytest.mark.parametrize("value", [-1e300, 1e300, 1e-300])
@pytest.mark.parametrize("name", ["delay_s", "baud", "drop_percent", "bit_error_percent"])
def test_events_may_set_any_number(name: str, value: float, open_sim: Open) -> None:
    """What means nothing does nothing, or stops the line; nothing worse."""

    def change(config: dict[str, Any]) -> None:
        line(halts=False, reliable=False)(config)
        config["events"] = [{"at_s": 0.2, "set": f"line.parameters.{name}", "value": value}]

    with open_sim(change) as sim:
        assert sum(sim.run(1) for _ in range(70)) == 70


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"drop_percent": 101.0}, "must be from 0 to 100"),
        ({"delay_s": -1.0}, "delay_s must be"),
        ({"baud": 0.5}, "baud must be"),
        ({"retransmit_ticks": 0}, "retransmit_ticks must be"),
        ({"reliable": False}, "halts needs parameters.reliable"),
        ({"delay_s": 0.1}, "no time passes"),
    ],
)
def test_parameters_that_mean_nothing(parameters: dict[str, float], text: str, open_sim: Open) -> None:
    with pytest.raises(SimError, match=text):
        open_sim(line(**parameters))
