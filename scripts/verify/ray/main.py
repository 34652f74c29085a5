# SPDX-License-Identifier: Apache-2.0
"""A campaign on a real Ray cluster, one of whose workers is killed on the way, leaves the table of one process, byte for byte.

`fcsl campaign --engine ray` starts a cluster with three workers on this computer. When some cases are flown, SIGKILL ends one
of the workers. Its cases.parquet is compared with that of `--jobs 1`. Ray (pyproject.toml) is installed on first use into
a folder of its own, out/verify/ray/packages: 70 MB to download, 190 MB on disk.

The control: an engine that gives lost cases up instead of flying them again (forgetful.py) leaves another table.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from ..shared.cases import OUT, ROOT, CheckFailed, run, write_facts

FOLDER = Path(__file__).resolve().parent
STUDY = ROOT / "examples/lander/sim/touchdown.study.json"
WORKERS = 3
#: Flown before the kill: then every worker has flown some.
BEFORE_KILL = 200
#: How Ray calls a process with the engine's actor.
_TITLE = b"ray::_Actor"
_LIMIT_S = 600.0


def installed(folder: Path) -> Path:
    """The folder of Ray and of what it needs: uv runs only where versions have changed."""
    wanted = (ROOT / "constraints.txt").read_text()
    done = folder / "installed.txt"
    if not done.is_file() or done.read_text() != wanted:
        print("ray: installing it, 70 MB to download", flush=True)
        shutil.rmtree(folder, ignore_errors=True)
        what = ("-c", ROOT / "constraints.txt", "--group", f"{ROOT}/pyproject.toml:ray")
        run(
            [
                Path(sys.executable).with_name("uv"),
                "pip",
                "install",
                "--python",
                sys.executable,
                "--quiet",
                "--target",
                folder,
                *what,
            ],
            timeout_s=_LIMIT_S,
        )
        done.write_text(wanted)
    return folder


def environment(packages: Path) -> dict[str, str]:
    """Ray beside what is there, and no cluster but its own; it tells nobody of its use."""
    found = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    path = os.pathsep.join([*filter(None, [found.get("PYTHONPATH")]), str(packages)])
    return found | {"PYTHONPATH": path, "RAY_USAGE_STATS_ENABLED": "0"}


def command(program: list[str | Path], cases: int, results: Path, *options: str) -> list[str]:
    return [*map(str, program), "campaign", str(STUDY), "--cases", str(cases), "-o", str(results), *options]


# ---- processes -------------------------------------------------------------------------------------------------------


def children(pid: int) -> list[int]:
    """Of all its threads."""
    found: list[int] = []
    with suppress(OSError):  # it has ended, or one of its threads has
        for task in os.listdir(f"/proc/{pid}/task"):
            found += map(int, Path(f"/proc/{pid}/task/{task}/children").read_text().split())
    return found


def workers(pid: int) -> set[int]:
    """Of the cluster that this process has started. What a worker forks is none."""
    found: set[int] = set()
    for child in children(pid):
        found |= {child} if title(child).startswith(_TITLE) else workers(child)
    return found


def title(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def flown(results: Path, cases: int) -> int:
    """How many cases have a verdict, the first byte of their places in cases.bin."""
    try:
        data = (results / "cases.bin").read_bytes()
    except FileNotFoundError:
        return 0
    size = len(data) // cases
    return sum(data[i * size] != 0 for i in range(cases)) if size else 0


# ---- campaigns -------------------------------------------------------------------------------------------------------


def table(results: Path) -> bytes:
    return (results / "cases.parquet").read_bytes()


def with_a_kill(program: list[str | Path], cases: int, results: Path, variables: dict[str, str]) -> dict[str, Any]:
    """Flies on Ray and kills a worker when BEFORE_KILL cases are flown. `status` is the campaign's, `words` what it printed."""
    line = command(program, cases, results, "--engine", "ray", "--jobs", str(WORKERS))
    log = results.with_suffix(".txt")
    begun = time.monotonic()
    seen: set[int] = set()
    killed_at = 0
    with log.open("wb") as output:
        campaign = subprocess.Popen(line, env=variables, stdout=output, stderr=output)
        try:
            while campaign.poll() is None:
                now = workers(campaign.pid)
                seen |= now
                if not killed_at and len(now) == WORKERS and flown(results, cases) >= BEFORE_KILL:
                    os.kill(min(now), signal.SIGKILL)
                    killed_at = flown(results, cases)
                    print(f"ray: killed one of {WORKERS} workers with {killed_at} of {cases} cases flown", flush=True)
                if time.monotonic() > begun + _LIMIT_S:
                    raise CheckFailed(f"a campaign on Ray is not over after {_LIMIT_S:.0f} s")
                time.sleep(0.05)
        finally:
            if campaign.poll() is None:
                campaign.kill()
                campaign.wait()
    words = log.read_text(errors="replace")
    if not killed_at:
        raise CheckFailed(f"no {WORKERS} workers were there to kill one of them:\n{words}")
    if killed_at == cases:
        raise CheckFailed("the campaign was over before the kill")
    facts = {"status": campaign.returncode, "killed_at": killed_at, "workers_seen": len(seen)}
    return facts | {"wall_s": round(time.monotonic() - begun, 1), "words": words}


def compare(cases: int, folder: Path, packages: Path) -> dict[str, Any]:
    """Raises CheckFailed where a table is not as it should be."""
    alone = folder / "one_process"
    run(command(["fcsl-sim"], cases, alone, "--jobs", "1"))
    variables = environment(packages)
    facts = with_a_kill(["fcsl-sim"], cases, folder / "ray", variables)
    words = facts.pop("words")
    if facts["status"] != 0:
        raise CheckFailed(f"the campaign on Ray ended with {facts['status']}:\n{words}")
    if facts["workers_seen"] <= WORKERS:
        raise CheckFailed("no worker came in place of the one that was killed")
    if table(folder / "ray") != table(alone):
        raise CheckFailed(f"with a killed worker the table is another: {folder}/ray, {alone}")
    print(f"ray: the table of {cases} cases is the same file", flush=True)
    with_a_kill([sys.executable, FOLDER / "forgetful.py"], cases, folder / "forgetful", variables)
    lost = (
        pq.read_table(folder / "forgetful" / "cases.parquet", columns=["verdict"])["verdict"].to_pylist().count("error")
    )
    if not lost or table(folder / "forgetful") == table(alone):
        raise CheckFailed("the comparison does not notice an engine that gives lost cases up")
    print(f"ray: control: an engine that gives lost cases up is noticed, {lost} of them are errors", flush=True)
    return facts | {"cases": cases, "table_bytes": len(table(alone)), "lost_by_the_control": lost}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=2000, help=f"more than {BEFORE_KILL} (default 2000)")
    options = parser.parse_args()
    folder = OUT / "ray"
    try:
        packages = installed(folder / "packages")
        (folder / "COLCON_IGNORE").touch()  # what is installed here is no package of the workspace
        shutil.rmtree(folder / "campaigns", ignore_errors=True)
        (folder / "campaigns").mkdir()
        facts = compare(options.cases, folder / "campaigns", packages)
        version = next(packages.glob("ray-*.dist-info")).name.split("-")[1].removesuffix(".dist")
        write_facts("ray", facts | {"ray": version})
    except CheckFailed as error:
        print(f"ray: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
