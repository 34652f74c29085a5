#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The link layer's state machine: every reachable state of two small ends, and seeded defects that the search must find.

test_link_states.c says what holds in each state: on a reliable port nothing is lost, repeated or out of order, and no state
is a dead end, under the losses, repetitions, reorderings and restarts of a budget.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from ..shared.cases import ROOT, CheckFailed, write_facts
from ..shared.effort import scaled

HAL = ROOT / "fcsl_hal"
PROGRAM = "test_link_states.c"
#: Losses, repetitions, reorderings, restarts, messages, frames on a wire.
Budget = tuple[int, int, int, int, int, int]
CI: tuple[Budget, ...] = ((1, 1, 1, 0, 2, 3), (1, 0, 0, 1, 2, 2), (0, 1, 0, 1, 2, 1))
FULL: tuple[Budget, ...] = (*CI, (2, 2, 1, 0, 2, 4), (1, 1, 1, 1, 2, 2), (0, 2, 0, 2, 2, 1), (1, 1, 0, 2, 2, 1))


@dataclass(frozen=True)
class Defect:
    """`old` of a source becomes `new`; the search with `budget` must find it."""

    what: str
    file: str
    old: str
    new: str
    budget: Budget


LINK, OUT, IN = "link/link.c", "link/link_outgoing.c", "link/link_incoming.c"
DEFECTS = (
    Defect("frames out of order are taken", IN, "header->sequence != in->sequence", "0", (1, 0, 0, 0, 2, 3)),
    Defect("an acknowledgement of nothing counts", OUT, "more > out->sent_max - out->confirmed", "0", (0, 1, 0, 1, 2, 2)),
    Defect("half a message is released", OUT, "!= 0 ? i + 1u : done", ">= 0 ? i + 1u : done", (1, 0, 0, 1, 2, 2)),
    Defect("a repeat leaves one frame out", OUT, "        out->sent = out->confirmed;",
           "        out->sent = out->confirmed + 1u;", (1, 0, 0, 0, 2, 3)),
    Defect("a new peer does not get what the old one had", OUT, "    out->sent = 0;\n", "", (0, 0, 0, 1, 2, 2)),
    Defect("half a message outlives its sender", IN, "    in->bytes.size = in->whole;\n    in->sequence = 0;",
           "    in->sequence = 0;", (1, 0, 0, 1, 2, 2)),
    Defect("numbers go on with a new peer", IN, "    in->sequence = 0;\n", "", (0, 0, 0, 1, 2, 2)),
    Defect("any hello is believed", LINK, "header->acknowledge == session->challenge", "1", (0, 1, 0, 1, 2, 1)),
    Defect("a challenge is used twice", LINK, "(uint16_t)(session->challenge + 1u)", "session->challenge",
           (0, 1, 0, 1, 2, 1)),
    Defect("frames for an earlier session are taken", LINK, "header->session == session->peer && header->to ==",
           "header->session == session->peer || header->to ==", (0, 1, 0, 1, 2, 2)),
    Defect("a peer of an earlier session is not told", LINK,
           "    if (header->session == session->peer) {\n        session->answer = 1;\n",
           "    if (header->session == session->peer) {\n", (1, 0, 0, 1, 1, 2)),
)  # fmt: skip


def build(hal: Path, program: Path) -> None:
    include = [flag for folder in (hal / "include", hal / "src", hal / "test/support") for flag in ("-I", str(folder))]
    subprocess.run(["cc", "-std=c11", "-O2", *include, hal / "test" / PROGRAM, "-o", program], check=True)


def search(program: Path, budget: Budget) -> subprocess.CompletedProcess[str]:
    return subprocess.run([program, *map(str, budget)], capture_output=True, text=True)


def states(folder: Path) -> dict[str, int]:
    """The number of states of each budget. Raises CheckFailed."""
    build(HAL, folder / "states")
    found = {}
    for budget in scaled(CI, FULL):
        done = search(folder / "states", budget)
        if done.returncode != 0:
            raise CheckFailed(f"budget {budget}: {done.stderr.strip()}")
        found[" ".join(map(str, budget))] = int(done.stdout.split()[0])
        print(f"budget {budget}: {done.stdout.strip()}, all hold", flush=True)
    return found


def find(defect: Defect, folder: Path) -> None:
    """Raises CheckFailed if the search does not find the defect."""
    for part in ("include", "src", "test"):
        (folder / part).mkdir(parents=True, exist_ok=True)
        for file in (HAL / part).rglob("*.[ch]"):
            copy = folder / part / file.relative_to(HAL / part)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_text(file.read_text())
    source = folder / "src" / defect.file
    text = source.read_text()
    if text.count(defect.old) != 1:
        raise CheckFailed(f"`{defect.old}` stands {text.count(defect.old)} times in {defect.file}; change this defect")
    source.write_text(text.replace(defect.old, defect.new))
    build(folder, folder / "states")
    done = search(folder / "states", defect.budget)
    if done.returncode == 0:
        raise CheckFailed(f"not found: {defect.what} ({done.stdout.strip()})")
    print(f"found: {defect.what}", flush=True)


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        try:
            found = states(Path(folder))
            for number, defect in enumerate(DEFECTS):
                find(defect, Path(folder) / str(number))
        except CheckFailed as error:
            print(f"link: {error}", file=sys.stderr)
            return 1
    write_facts("link", {"states": found, "defects found": len(DEFECTS)})
    return 0


if __name__ == "__main__":
    sys.exit(main())
