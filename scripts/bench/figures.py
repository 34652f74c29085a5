# SPDX-License-Identifier: Apache-2.0
"""`make bench`: figures, measured side by side in one run. Each section is printed when it is measured, and out/bench.json
grows with it. A section that fails is reported, and the others go on; then the exit status is 1. Each subject is a file or a
folder of subjects/. `make verify` runs all in its smallest size (harness/size.py), for its errors and not for its figures."""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .harness.size import SUFFIX
from .subjects.backends import backend_rows, backend_times
from .subjects.board import board_rows, board_times
from .subjects.bus.main import bus_figures, bus_rows
from .subjects.campaign.main import campaign_figures, campaign_rows
from .subjects.chain import chain_summary, chain_times
from .subjects.checkpoint import checkpoint_rows, checkpoint_times
from .subjects.edit_loop import edit_to_test
from .subjects.guard import guard_rows, guard_times
from .subjects.lander import ROOT, real_time_factor, step_times
from .subjects.lateness import lateness, lateness_rows
from .subjects.linear.main import linear_rows, linear_times
from .subjects.link.main import link_figures, link_rows
from .subjects.process import process_rows, process_times
from .subjects.record import record_rows, record_times
from .subjects.replay_map import RATES_HZ, replay_map
from .subjects.requirements import requirement_rows, requirement_times
from .subjects.ros.main import AXES, DECIMATE, LOCKSTEP_DECIMATES, LOCKSTEP_PLACES, PICTURE, lockstep, realtime
from .subjects.set_up import set_up_rows, set_up_times
from .subjects.simulator.main import simulator_figures, simulator_rows
from .subjects.start import start_rows, start_times
from .subjects.telemetry import telemetry_figures, telemetry_rows
from .subjects.times import instance_time_costs, instance_time_rows
from .subjects.twin import twin_rows, twin_times
from .subjects.vars.main import vars_figures, vars_rows
from .subjects.whole.main import WHOLES, whole_rows, whole_times
from .subjects.wire.main import wire_figures, wire_rows

Rows = list[tuple[str, str]]
OUT = ROOT / "out" / f"bench{SUFFIX}.json"


@dataclass(frozen=True)
class Section:
    """`measure` gets a folder of its own and returns what goes into the JSON under `name`; `rows` shows it."""

    name: str
    doing: str
    measure: Callable[[Path], Any]
    rows: Callable[[Any], Rows]


def step_rows(step: dict[str, float]) -> Rows:
    return [
        ("lander step, compiled by fcslc", f"{step['compiled_ns']:.1f} ns"),
        ("lander step, by hand in C", f"{step['by_hand_ns']:.1f} ns"),
        ("ratio", f"{step['ratio']:.2f} ({step['ratio_low']:.2f} to {step['ratio_high']:.2f})"),
    ]


def factor_rows(factor: dict[str, float]) -> Rows:
    return [
        ("simulator, in process", f"{factor['plain']:.0f} × real time"),
        ("simulator, recording every output", f"{factor['recorded']:.0f} × real time"),
    ]


def edit_rows(build: dict[str, float]) -> Rows:
    return [
        ("fcslc check of the lander", f"{build['check_s'] * 1e3:.0f} ms (goal 100)"),
        ("edit to tested, cold", f"{build['cold_s']:.2f} s (goal 0.5)"),
        ("unchanged to ticking, warm", f"{build['warm_s'] * 1e3:.0f} ms (goal 15)"),
    ]


def replay_rows(replayed: dict[str, Any]) -> Rows:
    rows = []
    for rate in RATES_HZ:
        figure = replayed[f"imu_{rate}_hz"]
        rows += [
            (f"replay --map, 1 kHz, IMU at {rate} Hz", f"{figure['plain']:.0f} × real time (goal 2000)"),
            ("    with -o: recorded, and its digest taken", f"{figure['recorded']:.0f} × real time (goal 1000)"),
        ]
    return rows


def lockstep_rows(ticks_per_s: dict[str, float]) -> Rows:
    rows = list[tuple[str, str]]()
    for place in LOCKSTEP_PLACES:
        rows.append((f"lock-step, {place}, native programs", f"{ticks_per_s[f'{place} native']:.0f} ticks/s"))
        for n in LOCKSTEP_DECIMATES:
            what = "all published" if n == 1 else f"1 of {n} published"
            rows.append((f"    nodes, {what}", f"{ticks_per_s[f'{place} decimate_{n}']:.0f} ticks/s (goal 6000)"))
        rows.append(
            (
                "    with a subscriber that is waited for",
                f"{ticks_per_s[f'{place} subscribed']:.0f} ticks/s (goal 6000)",
            )
        )
    return rows


def realtime_rows(sides: dict[str, Any]) -> Rows:
    rows = []
    for name, title, goals in (
        ("machine", "1 kHz machine", (" (goal 25)", " (goal 0)")),
        ("plain", "rclpy node", ("", "")),
    ):
        side = sides[name]
        latency, deadlines = side["latency"], side["ticks"] + side["missed"]
        rows += [
            (
                f"{title}, {AXES} topics, 1 of {DECIMATE} published",
                f"{side['processor_percent']:.0f} % of a core{goals[0]}",
            ),
            ("    ticks missed", f"{side['missed']} of {deadlines}{goals[1]}"),
            ("    deadline to subscriber, median", f"{latency['p50_us']:.0f} µs"),
            ("    99 %, worst", f"{latency['p99_us']:.0f} µs, {latency['max_us']:.0f} µs"),
        ]
    return rows


def measure_wholes(folder: Path) -> dict[str, Any]:
    return {name: whole_times(folder / name, whole) for name, whole in WHOLES.items()}


SECTIONS = (
    Section("step", "flying the lander and timing its step", step_times, step_rows),
    Section(
        "chains", "timing chains of trivial instances (the longest takes a minute to build)", chain_times, chain_summary
    ),
    Section("wholes", "timing whole machines against the same by hand", measure_wholes, whole_rows),
    Section("linear", "timing filters beside CasADi, Numba and Eigen", linear_times, linear_rows),
    Section("real_time_factor", "timing the simulator", real_time_factor, factor_rows),
    Section(
        "simulator",
        "integrating plants beside C by hand, landing a thousand times, flying a satellite beside JSBSim and Basilisk",
        simulator_figures,
        simulator_rows,
    ),
    Section("campaign", "flying campaigns beside loops of independent processes", campaign_figures, campaign_rows),
    Section("wire", "sending messages beside MAVLink 2, and damaging them", wire_figures, wire_rows),
    Section("record", "recording", record_times, record_rows),
    Section("requirements", "judging requirements", requirement_times, requirement_rows),
    Section("times", "measuring instances", instance_time_costs, instance_time_rows),
    Section("twin", "ticking twins from Python", lambda _: twin_times(), twin_rows),
    Section("backends", "the backends C and Nim", backend_times, backend_rows),
    Section("checkpoint", "saving and restoring", checkpoint_times, checkpoint_rows),
    Section("process", "ticking a twin in a process of its own", lambda _: process_times(), process_rows),
    Section(
        "vars", "querying the variable server, and counting what it costs the step thread", vars_figures, vars_rows
    ),
    Section("telemetry", "sending telemetry, and receiving it", telemetry_figures, telemetry_rows),
    Section("start", "starting commands", start_times, start_rows),
    Section(
        "set_up", "setting a fresh clone up (some minutes), and building a package again", set_up_times, set_up_rows
    ),
    Section("build", "timing the edit loop", lambda _: edit_to_test(), edit_rows),
    Section("replay_map", "replaying bags of other makers", replay_map, replay_rows),
    Section("link", "flying in lock-step over every wire, and losing frames", link_figures, link_rows),
    Section("bus", "going round over the bus, beside sockets, Zenoh and Fast DDS", bus_figures, bus_rows),
    Section("lateness", "flying at 1 kHz under load, beside cyclictest (two minutes)", lateness, lateness_rows),
    Section("board", "sampling three devices at 1 kHz, beside cyclictest", board_times, board_rows),
    Section("guard", "killing flight programs under a guard", guard_times, guard_rows),
    Section("lockstep_ticks_per_s", "flying the lander over ROS 2", lambda _: lockstep(), lockstep_rows),
    Section(
        "realtime",
        f"listening to {AXES} topics (the first time their package is built, which can take minutes)",
        lambda _: realtime(),
        realtime_rows,
    ),
)


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def write(facts: dict[str, Any]) -> None:
    """Replaces out/bench.json as a whole: an interrupted run leaves what it has measured."""
    OUT.parent.mkdir(exist_ok=True)
    new = OUT.with_suffix(".tmp")
    new.write_text(json.dumps(facts, indent=2) + "\n")
    os.replace(new, OUT)


def measure(section: Section, folder: Path, facts: dict[str, Any]) -> bool:
    """Measures, prints and writes one section; False where it failed."""
    begun = time.monotonic()
    try:
        facts[section.name] = section.measure(folder)
        rows = section.rows(facts[section.name])
    except Exception as error:  # whatever a section runs into, the others are measured
        facts[section.name] = {"failed": f"{type(error).__name__}: {error}"}
        write(facts)
        traceback.print_exc()
        say(f"bench: {section.name} failed: {error}")
        return False
    write(facts)
    for what, figure in rows:
        print(f"{what:<44}{figure:>34}", flush=True)
    say(f"({time.monotonic() - begun:.0f} s)")
    return True


def main() -> int:
    facts: dict[str, Any] = {}
    failed = []
    with tempfile.TemporaryDirectory() as name:
        for section in SECTIONS:
            say(f"{section.doing}…")
            folder = Path(name) / section.name
            folder.mkdir()
            if not measure(section, folder, facts):
                failed.append(section.name)
    print(f"written: {OUT.relative_to(ROOT)}, {PICTURE.relative_to(ROOT)}")
    if failed:
        say(f"bench: failed: {', '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        print("bench: interrupted", file=sys.stderr)
        sys.exit(130)
