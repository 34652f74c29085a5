# SPDX-License-Identifier: Apache-2.0
"""`make bench`: figures, measured side by side in one run; prints a table and writes out/bench.json. Nothing here can fail a
test. Each subject is a file or a folder of subjects/."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from .subjects.chain import chain_summary, chain_times
from .subjects.checkpoint import checkpoint_rows, checkpoint_times
from .subjects.edit_loop import edit_to_test
from .subjects.lander import ROOT, real_time_factor, step_times
from .subjects.lateness import lateness, lateness_rows
from .subjects.linear.main import linear_rows, linear_times
from .subjects.process import process_rows, process_times
from .subjects.record import record_rows, record_times
from .subjects.replay_map import RATES_HZ, replay_map
from .subjects.ros.main import DECIMATE, LOCKSTEP_DECIMATES, lockstep, realtime
from .subjects.telemetry import telemetry_figures, telemetry_rows
from .subjects.twin import twin_rows, twin_times
from .subjects.vars.main import vars_figures, vars_rows
from .subjects.whole.main import WHOLES, whole_rows, whole_times

Rows = list[tuple[str, str]]


def measure() -> dict[str, Any]:
    facts: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        say("flying the lander and timing its step…")
        facts["step"] = step_times(folder)
        say("timing chains of trivial instances (the longest takes a minute to build)…")
        facts["chains"] = chain_times(folder)
        say("timing whole machines against the same by hand…")
        facts["wholes"] = {name: whole_times(folder / name, whole) for name, whole in WHOLES.items()}
        facts["linear"] = linear_times(folder / "linear")
        say("timing the simulator…")
        facts["real_time_factor"] = real_time_factor(folder)
        say("recording…")
        facts["record"] = record_times(folder / "record")
        say("ticking twins from Python…")
        facts["twin"] = twin_times()
        say("saving and restoring…")
        facts["checkpoint"] = checkpoint_times(folder / "checkpoint")
        say("ticking a twin in a process of its own…")
        facts["process"] = process_times()
        say("asking the variable server, and counting what that costs the step thread…")
        facts["vars"] = vars_figures(folder)
        say("sending telemetry, and receiving it…")
        facts["telemetry"] = telemetry_figures(folder)
        say("timing the edit loop…")
        facts["build"] = edit_to_test()
        say("replaying bags of other makers…")
        facts["replay_map"] = replay_map(folder)
        say("flying at 1 kHz under load, beside cyclictest (two minutes)…")
        facts["lateness"] = lateness(folder)
    say("flying the lander over ROS 2…")
    facts["lockstep_ticks_per_s"] = lockstep()
    say("listening to twenty topics (the first time their package is built, which takes a minute)…")
    facts["realtime"] = realtime()
    return facts


def rows_of(facts: dict[str, Any]) -> Rows:
    step, factor, build, replayed = (facts[k] for k in ("step", "real_time_factor", "build", "replay_map"))
    rows = [
        ("lander step, compiled by fcslc", f"{step['compiled_ns']:.1f} ns"),
        ("lander step, by hand in C", f"{step['by_hand_ns']:.1f} ns"),
        ("ratio", f"{step['ratio']:.2f} ({step['ratio_low']:.2f} to {step['ratio_high']:.2f})"),
        ("simulator, in process", f"{factor['plain']:.0f} × real time"),
        ("simulator, recording every output", f"{factor['recorded']:.0f} × real time"),
        ("fcslc check of the lander", f"{build['check_s'] * 1e3:.0f} ms (goal 100)"),
        ("edit to tested, cold", f"{build['cold_s']:.2f} s (goal 1.5)"),
        ("unchanged to ticking, warm", f"{build['warm_s'] * 1e3:.0f} ms (goal 60)"),
    ]
    for rate in RATES_HZ:
        figure = replayed[f"imu_{rate}_hz"]
        rows += [
            (f"replay --map, 1 kHz, IMU at {rate} Hz", f"{figure['plain']:.0f} × real time (goal 500)"),
            ("    with -o: recorded, and its digest taken", f"{figure['recorded']:.0f} × real time"),
        ]
    rows += record_rows(facts["record"])
    rows += twin_rows(facts["twin"])
    rows += checkpoint_rows(facts["checkpoint"])
    rows += process_rows(facts["process"])
    rows += vars_rows(facts["vars"])
    rows += telemetry_rows(facts["telemetry"])
    peers = linear_rows(facts["linear"])
    return (
        chain_summary(facts["chains"])
        + whole_rows(facts["wholes"])
        + peers
        + rows
        + lateness_rows(facts["lateness"])
        + ros_rows(facts)
    )


def ros_rows(facts: dict[str, Any]) -> Rows:
    rows = []
    for n in LOCKSTEP_DECIMATES:
        what = "all published" if n == 1 else f"1 of {n} published"
        rows.append((f"lock-step, {what}", f"{facts['lockstep_ticks_per_s'][f'decimate_{n}']:.0f} ticks/s (goal 3000)"))
    for name, title, goals in (
        ("machine", "1 kHz machine", (" (goal 25)", " (goal 0)")),
        ("plain", "rclpy node", ("", "")),
    ):
        side = facts["realtime"][name]
        latency, deadlines = side["latency"], side["ticks"] + side["missed"]
        rows += [
            (
                f"{title}, 20 topics, 1 of {DECIMATE} published",
                f"{side['processor_percent']:.0f} % of a core{goals[0]}",
            ),
            ("    ticks missed", f"{side['missed']} of {deadlines}{goals[1]}"),
            ("    deadline to subscriber, median", f"{latency['p50_us']:.0f} µs"),
            ("    99 %, worst", f"{latency['p99_us']:.0f} µs, {latency['max_us']:.0f} µs"),
        ]
    return rows


def say(text: str) -> None:
    print(text, file=sys.stderr)


def main() -> int:
    facts = measure()
    for what, figure in rows_of(facts):
        print(f"{what:<44}{figure:>34}")
    out = ROOT / "out" / "bench.json"
    out.parent.mkdir(exist_ok=True)
    out.write_text(json.dumps(facts, indent=2) + "\n")
    print(f"written: {out.relative_to(ROOT)}, out/bench_ros.png")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (RuntimeError, subprocess.SubprocessError) as error:
        sys.exit(f"bench: {error}")
    except KeyboardInterrupt:
        print("bench: interrupted", file=sys.stderr)
        sys.exit(130)
