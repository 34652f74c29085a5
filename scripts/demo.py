# SPDX-License-Identifier: Apache-2.0
"""`make demo`: the lander from source to replayed flight, and a real robot's bag through the attitude filter.

Every step is a command a user could type, and is printed as such. Exit status 0 only if all of it held.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from fcsl_bridge.domain import own_domain
from fcsl_compiler.base.packages import package_prefix
from simclient import bag as bags

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "out" / "demo"
SIM = "examples/lander/sim/lander.sim.json"
SERIAL_SIM = "examples/lander/sim/lander_serial.sim.json"
CONFIG = "examples/lander/fc/lander_control.json"
SEED = "7"
#: A bag of a real robot is data, not part of the project: FCSL_JACKAL_BAG, or the folder where this project's data lies.
JACKAL = Path(os.environ.get("FCSL_JACKAL_BAG", ROOT.parent / "shared" / "data" / "jackal"))
STEP_TIMEOUT_S = 120


class DemoError(Exception):
    """A step did not do what it must; str() says which and how."""


def say(text: str = "") -> None:
    print(text, flush=True)


def headline(text: str) -> None:
    say(f"\n── {text} " + "─" * max(0, 88 - len(text)))


def shown(path: Path) -> str:
    return str(path.relative_to(ROOT))


def command(*words: str | Path) -> list[str]:
    return [str(w.relative_to(ROOT)) if isinstance(w, Path) and w.is_relative_to(ROOT) else str(w) for w in words]


def run(*words: str | Path, quiet: bool = False) -> str:
    """Runs a command to its end and returns what it printed. Raises DemoError unless it exits with 0."""
    line = command(*words)
    say("$ " + " ".join(line))
    try:
        done = subprocess.run(line, cwd=ROOT, stdout=subprocess.PIPE, text=True, timeout=STEP_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        raise DemoError(f"`{line[0]}` took longer than {STEP_TIMEOUT_S} s") from None
    except OSError as error:
        raise DemoError(f"`{line[0]}` does not start: {error.strerror}") from None
    if not quiet:
        say(done.stdout.rstrip())
    if done.returncode != 0:
        raise DemoError(f"`{' '.join(line)}` exited with {done.returncode}")
    return done.stdout


class Background:
    """A process that runs beside the others and is ended with the block."""

    def __init__(self, *words: str | Path, env: dict[str, str] | None = None):
        self.line = command(*words)
        self.env = {**os.environ, **(env or {})}

    def __enter__(self) -> Background:
        say("$ " + " ".join(self.line) + " &")
        try:
            self.process = subprocess.Popen(self.line, cwd=ROOT, env=self.env, stdout=subprocess.PIPE, text=True)
        except OSError as error:
            raise DemoError(f"`{self.line[0]}` does not start: {error.strerror}") from None
        return self

    def finish(self) -> str:
        """Waits for its end; returns what it printed. Raises DemoError unless it exits with 0."""
        try:
            out, _ = self.process.communicate(timeout=STEP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            raise DemoError(f"`{self.line[0]}` took longer than {STEP_TIMEOUT_S} s") from None
        if self.process.returncode != 0:
            raise DemoError(f"`{' '.join(self.line)}` exited with {self.process.returncode}:\n{out}")
        return out

    def stop(self) -> str:
        self.process.send_signal(signal.SIGTERM)
        return self.finish()

    def __exit__(self, *exception: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


# ---- the steps -----------------------------------------------------------------------------------------------------


def compile_step() -> None:
    headline("1. compile: JSON and Python to native code")
    run("fcsl", "check", CONFIG)
    run("fcsl", "build", CONFIG, "-o", OUT / "build")


def fly_in_process() -> dict[str, Any]:
    headline("2. fly: the compiled machine in the simulator, one process")
    begun = time.monotonic()
    summary: dict[str, Any] = json.loads(
        run("fcsl", "sim", SIM, "--seed", SEED, "--record", OUT / "in_process", "--json", quiet=True)
    )
    for change in summary["transitions"]:
        say(f"  {change['time_s']:8.2f} s  {change['from_state']} → {change['to_state']}")
    speed = summary["truth"]["lander.outputs.touchdown_speed"]
    say(f"  touchdown at {speed:.2f} m/s; {summary['time_s']:.2f} s in all, the last three on the ground")
    say(f"  {summary['ticks']} ticks in {summary['wall_s']:.2f} s: {summary['real_time_factor']:.0f} × real time")
    if not (summary["truth"]["lander.outputs.landed"] and speed < 2.0):
        raise DemoError(f"the lander did not land softly (touchdown at {speed} m/s)")
    say(f"  ({time.monotonic() - begun:.1f} s with start-up)")
    return summary


def fly_as_process(library: Path, sim_file: str, bag: Path) -> str:
    """The flight program in a process of its own; what the simulator printed."""
    with tempfile.TemporaryDirectory(prefix="fcsl-") as folder:
        socket = Path(folder) / "wire"
        with Background("fcsl", "sim", sim_file, "--seed", SEED, "--external", f"wire:unix:{socket}") as sim:
            wait_for(socket, sim)
            with Background("fcsl-fc", library, "--hal", f"wire:unix:{socket}", "--record", bag) as fc:
                printed = sim.finish()
                say(fc.finish().rstrip())
    return printed


def fly_own_process(library: Path) -> None:
    headline("3. fly: the same library as a flight program of its own")
    fly_as_process(library, SIM, OUT / "own_process")


def fly_over_lossy_line(library: Path) -> None:
    headline("4. fly: virtual HIL over a serial line that loses 10 % of the frames and damages 5 %")
    printed = fly_as_process(library, SERIAL_SIM, OUT / "serial_line")
    for text in printed.splitlines():
        if text.strip().startswith("line.outputs."):
            say(text)


def wait_for(path: Path, process: Background) -> None:
    limit = time.monotonic() + 30
    while not path.exists():
        if process.process.poll() is not None or time.monotonic() > limit:
            raise DemoError(f"`{process.line[0]}` did not open {path}")
        time.sleep(0.02)


def fly_over_ros(ticks: int) -> None:
    headline("5. fly: two ROS 2 nodes in lock-step on simulated time, a third process listening")
    with own_domain() as domain:  # so that no other node of this machine joins in
        counts = nodes_in_lockstep({"ROS_DOMAIN_ID": str(domain)})
    for topic, count in sorted(counts.items()):
        say(f"  {count:7d}  {topic}")
    heard = {t: c for t, c in counts.items() if t == "/clock" or t.startswith("/lander_control/")}
    # The flight does not wait for subscribers: on a busy computer one misses some. The bag misses none, see below.
    if min(heard.get("/clock", 0), heard.get("/lander_control/engine", 0)) < ticks // 2:
        raise DemoError(f"the subscriber heard too little: {heard}")


def nodes_in_lockstep(env: dict[str, str]) -> dict[str, int]:
    """Flies; messages by topic, as the third process counted them."""
    nodes = package_prefix("fcsl_bridge") / "lib" / "fcsl_bridge"
    listen = (nodes / "topic_count", "--ros-args", "-p", "machine:=lander_control")
    with Background(*listen, env=env) as listener:
        controller: list[str | Path] = [nodes / "controller_node", "--ros-args", "-p", "machine:=lander/lander_control"]
        controller += ["-p", f"record:={OUT / 'ros'}", "-p", "wait_for_subscribers:=1"]
        with Background(*controller, env=env) as node:
            sim: list[str | Path] = [
                nodes / "sim_node",
                "--ros-args",
                "-p",
                f"sim:={ROOT / SIM}",
                "-p",
                f"seed:={SEED}",
            ]
            sim += ["-p", "wait_for_subscribers:=1"]
            with Background(*sim, env=env) as plant:
                say(plant.finish().rstrip())
                say(node.finish().rstrip())
        counts: dict[str, int] = json.loads(listener.stop())
    return counts


def compare_bits() -> None:
    headline("6. compare: every output, state and health of every tick, bit for bit")
    digests = {}
    for name in ("in_process", "own_process", "serial_line", "ros"):
        digests[name] = run("fcsl", "bag", "digest", OUT / name, quiet=True).split()[0]
        say(f"  {digests[name]}")
    if len(set(digests.values())) != 1:
        raise DemoError(f"the flights differ: {digests}")
    say("  the four flights are the same")


def replay_and_look() -> None:
    headline("7. replay the ROS flight into AlgTwin, and look at it")
    run("fcsl", "replay", OUT / "ros", "--config", CONFIG)
    run("fcsl", "rerun", OUT / "in_process", "-o", OUT / "lander.rrd")
    run("fcsl", "plot", OUT / "in_process", "-o", OUT / "lander.png")


def real_robot() -> bool:
    headline("8. a real robot's bag through the attitude filter")
    if not JACKAL.is_dir():
        say(
            "left out: the bag of a robot is not part of the project; name one with sensor_msgs/Imu on /imu/data:  "
            "FCSL_JACKAL_BAG=BAG make demo"
        )
        return False
    bag, config = OUT / "ahrs", "examples/ahrs/ahrs.json"
    map_file = "examples/ahrs/map.yaml"
    run("fcsl", "replay", JACKAL, "--config", config, "--map", map_file, "-o", bag)
    run("fcsl", "replay", bag, "--config", config)
    tilt = float(bags.columns(bags.Bag(bag), "comparison.outputs.tilt_error_rms")[1][-1])
    say(f"  tilt against the orientation that the robot recorded: {math.degrees(tilt):.2f}° RMS")
    if tilt > math.radians(1.0):
        raise DemoError("the filter disagrees with the robot's own orientation")
    run("fcsl", "plot", bag, "-o", OUT / "ahrs.png")
    run("fcsl", "rerun", bag, "-o", OUT / "ahrs.rrd")
    return True


def summarise(flight: dict[str, Any], robot: bool) -> None:
    headline("done")
    bags = ["in_process", "own_process", "serial_line", "ros", *(["ahrs"] if robot else [])]
    for name in bags:
        size = sum(f.stat().st_size for f in (OUT / name).iterdir())
        say(f"  bag      {shown(OUT / name)}  ({size / 1e6:.1f} MB)")
    pictures = ["lander", *(["ahrs"] if robot else [])]
    for name in pictures:
        say(f"  picture  {shown(OUT / (name + '.png'))}")
        say(f"  rerun    {shown(OUT / (name + '.rrd'))}   (rerun {shown(OUT / (name + '.rrd'))})")
    if not robot:
        say("  left out: step 8, the real robot's bag")
    speed = flight["truth"]["lander.outputs.touchdown_speed"]
    say(
        f"  touchdown {speed:.2f} m/s, {flight['ticks']} ticks identical in one process, in two, over a lossy serial line and in "
        "two ROS 2 nodes"
    )


def main() -> int:
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    begun = time.monotonic()
    try:
        compile_step()
        flight = fly_in_process()
        library = OUT / "build" / "liblander_control.so"
        fly_own_process(library)
        fly_over_lossy_line(library)
        fly_over_ros(flight["ticks"])
        compare_bits()
        replay_and_look()
        robot = real_robot()
        summarise(flight, robot)
    except DemoError as error:
        print(f"\ndemo: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ndemo: interrupted", file=sys.stderr)
        return 130
    say(f"  {time.monotonic() - begun:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
