# SPDX-License-Identifier: Apache-2.0
"""Lock-step of simulator and controller over every wire beside bare sockets of the kind, and what a reliable port carries over a line
that loses frames beside the formula of go-back-N.

    python3 scripts/bench link
"""

from __future__ import annotations

import json
import os
import pty
import selectors
import socket
import subprocess
import tempfile
import threading
from pathlib import Path
from typing import Any

from fcsl_compiler.base.packages import package_prefix

from ...harness.native import BENCH, compile_program
from ...harness.size import sized

HERE = Path(__file__).resolve().parent
HAL = BENCH.parents[1] / "fcsl_hal"
TICKS = sized(
    {"unix": 100_000, "udp": 30_000, "tcp": 30_000, "uart": 3_000, "zenoh": 30_000},
    dict.fromkeys(("unix", "udp", "uart", "zenoh"), 200),
)
LOSSES = (0.0, 0.001, 0.01, 0.05, 0.1, 0.2)
LINK_TICKS = sized(1_000_000, 20_000)


def _compile(name: str, folder: Path) -> Path:
    libraries = package_prefix("fcsl_hal") / "lib"
    sources = [HERE / f"{name}.c", BENCH / "harness/timing.c", libraries / "libfcsl_hal.a", libraries / "libfcsl_io.a"]
    return compile_program(sources, folder / name, [HAL / "include", HAL / "src"], ["-lpthread", "-Wl,--gc-sections"])


def lockstep_program(folder: Path) -> Path:
    """lockstep.c, compiled."""
    return _compile("lockstep", folder)


def link_figures(folder: Path) -> dict[str, Any]:
    lockstep, goodput = lockstep_program(folder), _compile("goodput", folder)
    wires = {kind: lockstep_over(lockstep, kind, folder, ticks) for kind, ticks in TICKS.items()}
    kinds = [kind for kind in TICKS if kind not in ("uart", "zenoh")]
    bare = {kind: lockstep_over(lockstep, kind, None, TICKS[kind]) for kind in kinds}
    loss = {str(share): _run(goodput, share, LINK_TICKS, 1) for share in LOSSES}
    for share, facts in loss.items():
        facts["formula"] = go_back_n(float(share), facts["round_trip"] + facts["timeout"])
    return {"wires": wires, "bare": bare, "loss": loss}


def go_back_n(loss: float, frames: int) -> float:
    """Share of the line that new frames take, where a lost frame costs `frames` frame times until it is sent again, and what was
    sent in between is sent again, too: (1 - p) / (1 - p + p N) (Bertsekas and Gallager, Data Networks, 2.4). N is a round
    trip, after which the last frame before it is acknowledged, and the time-out that begins then.
    """
    return (1 - loss) / (1 - loss + loss * frames)


def _run(program: Path, *arguments: object) -> dict[str, Any]:
    done = subprocess.run([program, *map(str, arguments)], stdout=subprocess.PIPE, text=True, check=True, timeout=300)
    facts: dict[str, Any] = json.loads(done.stdout)
    return facts


def lockstep_over(program: Path, kind: str, folder: Path | None, ticks: int) -> dict[str, Any]:
    """Over a wire; without a folder, over two bare sockets of the kind."""
    if folder is None:
        return _run(program, "bare", kind, ticks)
    if kind == "uart":
        return _over_terminals(program, ticks)
    if kind == "unix":
        spec = f"unix:{folder / 'wire'}"
    else:
        with socket.socket(type=socket.SOCK_DGRAM if kind == "udp" else socket.SOCK_STREAM) as free:
            free.bind(("127.0.0.1", 0))
            spec = f"{'zenoh:tcp:' if kind == 'zenoh' else kind + ':'}127.0.0.1:{free.getsockname()[1]}"
    return _run(program, spec, spec, ticks)


def _over_terminals(program: Path, ticks: int) -> dict[str, Any]:
    """Two pseudo-terminals, and a thread that carries bytes: what they take is part of the figure."""
    (a, ours), (b, theirs) = pty.openpty(), pty.openpty()
    wake, over = os.pipe()
    to = {a: b, b: a}

    def carry() -> None:
        with selectors.DefaultSelector() as selector:
            for end in (a, b, wake):
                selector.register(end, selectors.EVENT_READ)
            while True:
                for key, _ in selector.select():
                    if key.fd == wake:
                        return
                    os.write(to[int(key.fd)], os.read(int(key.fd), 4096))

    thread = threading.Thread(target=carry, daemon=True)
    thread.start()
    try:
        return _run(program, *(f"uart:{os.ttyname(end)}:4000000" for end in (ours, theirs)), ticks)
    finally:
        os.write(over, b".")
        thread.join()
        for end in (a, b, ours, theirs, wake, over):
            os.close(end)


def link_rows(facts: dict[str, Any]) -> list[tuple[str, str]]:
    rows = []
    for kind, f in facts["wires"].items():
        rows.append(
            (f"lock-step over {kind}", f"{f['ticks_per_s']:,} ticks/s, {f['p50_us']:.1f} us (p99 {f['p99_us']:.1f})")
        )
        if kind in facts["bare"]:
            bare = facts["bare"][kind]
            ratio = f["p50_us"] / bare["p50_us"]
            rows.append((f"    two bare sockets, {kind}", f"{bare['p50_us']:.1f} us, ratio {ratio:.2f}"))
    for share, f in facts["loss"].items():
        rows.append(
            (f"goodput at {float(share):.1%} of frames lost", f"{f['goodput']:.3f}, go-back-N {f['formula']:.3f}")
        )
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        figures = link_figures(Path(scratch))
    print(json.dumps(figures))
    for what, figure in link_rows(figures):
        print(f"{what:<50}{figure:>50}")
