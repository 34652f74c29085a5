# SPDX-License-Identifier: Apache-2.0
"""Commands that `make test` and `make verify` run several at a time. What one prints is in log/; of one that fails, everything is
shown, and its end once more after all others."""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

ROOT = Path(__file__).resolve().parents[1]
LOGS = ROOT / "log"
#: Between two lines that say where a job is, seconds.
TOLD_EVERY_S = 10.0
#: Lines of a failed job that are shown once more at the end, for whoever sees only the end of a long output.
LAST_LINES = 20
#: Exit status of a check that this computer cannot make; its last line says why.
LEFT_OUT = 77


@dataclass(frozen=True)
class Job:
    """`label` for people; `command` and what its environment has besides."""

    label: str
    command: tuple[str, ...]
    environment: dict[str, str] = field(default_factory=dict)

    @property
    def log(self) -> Path:
        return LOGS / f"{re.sub('[^A-Za-z0-9]+', '-', self.label)}.txt"

    def last_lines(self, count: int) -> list[str]:
        """Of what it printed so far, without empty lines."""
        return [line for line in self.log.read_text(errors="replace").split("\n") if line.strip()][-count:]


@dataclass
class Running:
    """A job under way."""

    job: Job
    output: IO[bytes]
    process: subprocess.Popen[bytes]
    started: float
    core_s: float = 0.0

    def seconds(self) -> float:
        return time.monotonic() - self.started

    def over(self) -> bool:
        """Whether it has ended; if so, `core_s` is the processor time that it and what it waited for took, seconds."""
        before = _core_s_of_ended()
        if self.process.poll() is None:
            return False
        self.core_s = _core_s_of_ended() - before
        return True

    def end(self) -> None:
        """Like Ctrl-C, upon which a job ends what it has started."""
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(timeout=30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def _core_s_of_ended() -> float:
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def say(text: str) -> None:
    print(f"fcsl: {text}", flush=True)


def start(job: Job) -> Running:
    LOGS.mkdir(exist_ok=True)
    say(f"{job.label} ...")
    output = job.log.open("wb")
    process = subprocess.Popen(
        job.command,
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": "1", **job.environment},
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=subprocess.STDOUT,
    )
    return Running(job, output, process, time.monotonic())


def ended(one: Running) -> bool:
    """Says how a job ended; whether it succeeded."""
    one.output.close()
    if one.process.returncode == 0:
        say(f"{one.job.label}: done in {one.seconds():.0f} s ({one.core_s:.0f} s of a core)")
        return True
    if one.process.returncode == LEFT_OUT:
        say(f"{one.job.label}: left out: {''.join(one.job.last_lines(1))}")
        return True
    print(one.job.log.read_text(errors="replace"), flush=True)
    say(f"{one.job.label}: exit status {one.process.returncode}; all that it printed is above and in {one.job.log}")
    return False


def run_all(jobs: Sequence[Job], at_once: int, limit_s: float) -> list[Job]:
    """Those that failed, or were not over after `limit_s` and were ended. A failure does not keep the others from running."""
    waiting, running, failed = list(jobs), list[Running](), list[Job]()
    told = time.monotonic()
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
                running.append(start(waiting.pop(0)))
            time.sleep(0.2)
            for one in [r for r in running if r.seconds() > limit_s]:
                say(f"{one.job.label}: not over after {limit_s:.0f} s, ended")
                one.end()
            for one in [r for r in running if r.over()]:
                running.remove(one)
                if not ended(one):
                    failed.append(one.job)
            if time.monotonic() - told > TOLD_EVERY_S:
                told = time.monotonic()
                for one in running:
                    doing = "".join(one.job.last_lines(1))
                    print(f"{one.seconds():9.0f} s  {one.job.label.split(':')[0]}: {doing:.90}", flush=True)
    finally:
        for one in running:  # after Ctrl-C, which they got, too
            one.end()
    return failed


def repeat_failures(failed: Sequence[Job]) -> None:
    for job in failed:
        say(f"failed: {job.label}, {job.log}; its end:")
        print("".join(f"    {line:.200}\n" for line in job.last_lines(LAST_LINES)), end="", flush=True)
