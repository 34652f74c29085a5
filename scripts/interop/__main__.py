# SPDX-License-Identifier: Apache-2.0
"""`make interop`: FCSL's programs and rclpy nodes in one ROS 2 graph, by a bridge with the published zenoh-plugin-ros2dds.

    fcsl sim … --ros ─────────┐                       ┌── listener.py, on use_sim_time
                              ├── Zenoh ── bridge ── DDS
    fcsl-fc … --hal ros: ─────┘     (127.0.0.1)       └── talker.py, which ends halfway and is started again

`python3 scripts/interop [SECONDS]` prints what both sides saw, and fails when a message was lost or came twice.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from fcsl_bridge.domain import own_domain
from fcsl_bridge.loopback import loopback_environment
from simclient import VarClient
from simclient.bus.endpoint import zenoh_locator
from simclient.bus.free_port import free_endpoint

HERE = Path(__file__).resolve().parent
BRIDGE = HERE.parents[1] / "build/interop/target/release/interop_bridge"
DURATION_S = 600
#: For routes (the plugin takes up to 4 s), late subscriptions and the last messages.
START_S, END_S = 12.0, 4.0
TALK_HZ = 100
#: Cyclone DDS on 127.0.0.1 alone, where it meets Fast DDS of the profile of fcsl_bridge by multicast.
CYCLONE = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces>'
    "<AllowMulticast>true</AllowMulticast></General></Domain></CycloneDDS>"
)
STREAMS = ("clock", "descent", "sensors")


@contextlib.contextmanager
def started(*line: str | Path, env: dict[str, str], quiet: bool = False) -> Iterator[subprocess.Popen[str]]:
    pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
    process = subprocess.Popen(
        [str(w) for w in line], env=env, text=True, stdout=pipe, stderr=nothing if quiet else None
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def end(process: subprocess.Popen[str]) -> str:
    """Ends a process and returns what it printed."""
    process.send_signal(signal.SIGTERM)
    return process.communicate(timeout=30)[0]


def bridge_config(folder: Path, domain: int, endpoints: list[str]) -> Path:
    """It connects, for ever, and listens nowhere; it looks for nobody."""
    path = folder / "bridge.json5"
    config = {
        "mode": "router",
        "connect": {
            "endpoints": endpoints,
            "timeout_ms": -1,
            "exit_on_failure": False,
            "retry": {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 2},
        },
        "listen": {"endpoints": []},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "plugins": {"ros2dds": {"domain": domain, "ros_automatic_discovery_range": "SYSTEM_DEFAULT"}},
    }
    path.write_text(json.dumps(config, indent=2))
    return path


def talk(first: int, count: int, environment: dict[str, str]) -> None:
    subprocess.run([sys.executable, HERE / "talker.py", str(first), str(count)], env=environment, check=True)


def fly(duration_s: float, folder: Path, domain: int) -> tuple[dict[str, dict[str, int]], dict[str, int], int]:
    """What the listener saw, what the flight computer's HAL counted, and how many messages the talkers sent."""
    environment = {**os.environ, **loopback_environment(os.environ), "ROS_DOMAIN_ID": str(domain)}
    of_bridge = {**environment, "ROS_DISTRO": "jazzy", "CYCLONEDDS_URI": CYCLONE}
    simulated, flown = free_endpoint(), free_endpoint()
    summary = folder / "summary.json"
    subprocess.run(["fcslc", "build", HERE / "machine/echo.json", "-o", folder], check=True, stdout=subprocess.DEVNULL)
    fc_options = ["--hal", f"ros:{flown}", "--summary", str(summary)]
    served = folder / "sim.sock"
    half = int(duration_s * TALK_HZ / 2)
    with (
        started(
            "fcsl-sim",
            "run",
            HERE / "machine/lander.sim.json",
            "--speed",
            "1",
            "--ros",
            simulated,
            "--socket",
            served,
            env=environment,
            quiet=True,
        ) as sim,
        started("fcsl-fc", folder / "libecho.so", *fc_options, env=environment) as fc,
        started(
            BRIDGE, bridge_config(folder, domain, [zenoh_locator(simulated), zenoh_locator(flown)]), env=of_bridge
        ) as bridge,
        started(sys.executable, HERE / "listener.py", env=environment) as listener,
    ):
        if not listener.stdout or listener.stdout.readline() != "listening\n":
            sys.exit("interop: the listener does not start")
        time.sleep(START_S)
        for first in (1, half + 1):
            talk(first, half, environment)
        time.sleep(END_S)
        with VarClient(str(served)) as client:
            put = client.stats()["ros"]
        heard = json.loads(end(listener))
        end(fc)
        end(sim)
        if bridge.poll() is not None:
            sys.exit(f"interop: the bridge ended by itself, with {bridge.returncode}")
    heard["simulation"] = put
    return heard, json.loads(summary.read_text())["hal"], 2 * half


def complaints(heard: dict[str, dict[str, int]], counted: dict[str, int], sent: int, duration_s: float) -> list[str]:
    found = []
    for name in STREAMS:
        of = heard[name]
        if of["missing"] or of["twice"] or of["messages"] < duration_s * 100:
            found.append(f"{name}: {of}")
    if heard["commands"]["twice"] or heard["commands"]["last"] != sent:
        found.append(f"commands: {heard['commands']}, the last measurement was {sent}")
    if heard["late state"]["messages"] == 0 or heard["late state"]["twice"]:
        found.append(f"late state: {heard['late state']}")
    if counted["messages"] + counted["superseded"] != sent or counted["refused.repeated"]:
        found.append(f"of {sent} messages of the talkers the flight computer counted {counted}")
    return found


def main() -> None:
    duration_s = float(sys.argv[1]) if len(sys.argv) > 1 else DURATION_S
    with own_domain() as domain, tempfile.TemporaryDirectory() as folder:
        heard, counted, sent = fly(duration_s, Path(folder), domain)
    print(json.dumps({"listener": heard, "flight computer": counted, "talkers sent": sent}, indent=2))
    wrong = complaints(heard, counted, sent, duration_s)
    if wrong:
        sys.exit("interop: error: lost or doubled messages:\n  " + "\n  ".join(wrong))
    print("interop: no message was lost, none came twice")


if __name__ == "__main__":
    main()
