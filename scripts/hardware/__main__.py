# SPDX-License-Identifier: Apache-2.0
"""`python3 scripts/hardware` tries every device that guest/ offers, and flies on them; `python3 scripts/hardware run COMMAND…` runs a
command in the guest."""

import argparse
import os
import signal
import subprocess
import sys
from pathlib import Path

# The modules here are those of the package `hardware`, which is found from the folder that holds it.
sys.path[0] = str(Path(__file__).resolve().parents[1])
from hardware.flight.craft import Craft  # noqa: E402
from hardware.machine import HERE, Machine  # noqa: E402

_LIMIT_S = 300.0


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="hardware", description=__doc__)
    commands = parser.add_subparsers(dest="what")
    run = commands.add_parser("run", help="run a command in the guest")
    run.add_argument("--limit", type=float, default=120.0, metavar="S", help="time limit (%(default)s s)")
    run.add_argument("--write", type=Path, action="append", default=[], metavar="FOLDER", help="may be written")
    run.add_argument("command", nargs=argparse.REMAINDER)
    return parser.parse_args()


def kernel() -> Path:
    """Builds it where it is missing."""
    build = subprocess.run([HERE / "build.sh"], stdout=subprocess.PIPE, text=True, check=True)
    return Path(build.stdout.strip())


def main() -> int:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # the kernel ends with us
    args = arguments()
    if args.what == "run":
        return Machine(kernel(), args.write).run(args.command, os.environ, args.limit)
    craft = Craft(HERE.parents[1] / "out/hardware")
    craft.build()
    smoke, flights = ([sys.executable, "-m", f"hardware.{module}"] for module in ("smoke", "flights"))
    # One after the other, each with a bus of its own: a boot has one.
    machine = Machine(kernel())
    statuses = [machine.run(line, os.environ, _LIMIT_S) for line in (smoke, [*flights, str(craft.folder)])]
    return max(statuses)


sys.exit(main())
