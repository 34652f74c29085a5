# SPDX-License-Identifier: Apache-2.0
"""The messages exist in Python, agree with the ABI's numbers and survive serialisation."""

import re
from pathlib import Path

from rclpy.serialization import deserialize_message, serialize_message

from fcsl_msgs.msg import (
    Checkpoint,
    Event,
    FaultCounters,
    HostWrite,
    InstanceHealth,
    MachineState,
    RequirementVerdicts,
    TransitionEvent,
)


def test_health_constants_are_those_of_the_abi() -> None:
    header = Path(__file__).parents[2] / "fcsl_compiler/include/fcsl/fcsl_machine.h"
    values = dict(re.findall(r"FCSL_(NOMINAL|DEGRADED|FAILED|STALE) = (\d)", header.read_text(encoding="utf-8")))
    assert {name: int(value) for name, value in values.items()} == {
        name: getattr(InstanceHealth, name) for name in ("NOMINAL", "DEGRADED", "FAILED", "STALE")
    }


def test_host_write_kinds() -> None:
    kinds = (
        HostWrite.SET,
        HostWrite.SET_STATE,
        HostWrite.RESTORE,
        HostWrite.CHANNEL,
        HostWrite.OVERRUN,
        HostWrite.ATTACH,
        HostWrite.IMPURE,
        HostWrite.FAULT,
        HostWrite.HEALTH,
        HostWrite.EVENTS,
    )
    assert kinds == tuple(range(10))


def test_round_trip() -> None:
    messages = [
        MachineState(tick=7, state="ASCENT", next_state="COAST"),
        InstanceHealth(tick=7, instance=["nav", "pilot"], health=[InstanceHealth.FAILED, InstanceHealth.STALE]),
        TransitionEvent(tick=7, from_state="ASCENT", to_state="COAST", request="START_COAST", instance="ascent"),
        FaultCounters(tick=7, instance=["nav"], faults=[2**63], overruns=[1], fault_place=["nav.py:3:9: …"]),
        Checkpoint(tick=7, machine="lander_control", data=[1, 2, 3]),
        RequirementVerdicts(tick=7, requirement=["LND-7"], verdict=[1], holds=[False], values=["…"], violations=[3]),
        Event(tick=7, severity=Event.WARNING, instance="nav", text="gate passed", values=["3", "0.5"], line=12),
        HostWrite(tick=7, kind=HostWrite.SET, path="sensors.outputs.pos_z", element=1, data=[0] * 8),
    ]
    for message in messages:
        assert deserialize_message(serialize_message(message), type(message)) == message
