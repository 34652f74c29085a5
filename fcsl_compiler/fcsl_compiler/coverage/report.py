# SPDX-License-Identifier: Apache-2.0
"""Output of `fcsl cover` and pytest's --fcsl-cover: a table of figures, then every uncovered item with its place."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..base.diagnostics import excerpt
from ..base.json_file import read_json
from .counts import Counts, added, read_folder
from .figures import KINDS, NAMES, FileFigures, Miss, Share, figures
from .probe_map import CoverError

_KIND = "fcsl cover"


@dataclass(frozen=True)
class MachineFigures:
    """One machine of a report."""

    machine: str
    config: str
    files: list[FileFigures]

    def total(self, kind: str) -> Share:
        """Sum over all files."""
        return sum((f.shares[kind] for f in self.files), Share(0, 0))


@dataclass(frozen=True)
class Report:
    """The machines that ran, and requested machines that did not."""

    machines: list[MachineFigures]
    absent: list[Path]
    others: list[str]  # configs of machines that ran but were not requested

    def text(self) -> str:
        """Text for a terminal: figures, followed by uncovered items."""
        why = f"they ran {', '.join(self.others)}" if self.others else "PyTwin and libraries built before do not count"
        lines = [f"coverage: {path}: no test ran this machine ({why})" for path in self.absent]
        if not self.machines and not self.absent:
            lines.append("coverage: no test ran a machine that was compiled for it")
        for machine in self.machines:
            lines += [*_table(machine), *_misses(machine)]
        return "\n".join(lines) + "\n"

    def to_json(self) -> str:
        """The same content as JSON."""
        absent = [str(path) for path in self.absent]
        machines = [_machine_json(m) for m in self.machines]
        return json.dumps({"kind": _KIND, "version": 1, "machines": machines, "absent": absent}, indent=1) + "\n"

    def below(self, limits: dict[str, float]) -> list[str]:
        """Lists what is below these percentages, by kind. A machine that did not run is below every limit."""
        wanted = ", ".join(f"{NAMES[kind]} {limit:g} %" for kind, limit in limits.items())
        found = [f"{path}: it did not run, wanted {wanted}" for path in self.absent] if limits else []
        if limits and not self.machines and not self.absent:
            found.append("no test ran a machine that was compiled for it")
        for machine in self.machines:
            for kind, limit in limits.items():
                share = machine.total(kind)
                if share.percent < limit:
                    found.append(f"{machine.machine}: {NAMES[kind]} {_percent(share)}, wanted {limit:g} %")
        return found


def make_report(folder: Path, configs: Sequence[Path] = ()) -> Report:
    """Report on the machines with coverage files in `folder`, or on the requested ones. Raises CoverError, OSError."""
    wanted = [os.path.realpath(path) for path in configs]
    every = read_folder(folder)
    found = added([c for c in every if not wanted or c.map.config in wanted])
    made = [MachineFigures(c.map.machine, c.map.config, figures(c)) for c in _latest(found)]
    ran = {m.config for m in made}
    absent = [path for path, real in zip(configs, wanted, strict=True) if real not in ran]
    return Report(made, absent, sorted({c.map.config for c in every} - ran))


def refuse_foreign(path: Path) -> None:
    """Raises CoverError if `path` exists and is not a JSON report, so that the report cannot overwrite a machine."""
    if not path.exists():
        return
    try:
        is_ours = read_json(path).get("kind") == _KIND
    except (OSError, ValueError, AttributeError):
        is_ours = False
    if not is_ours:
        raise CoverError(f"`{path}` exists and is not a coverage report; name another file")


def _latest(found: list[Counts]) -> list[Counts]:
    """Orders the builds of a machine that was edited while its tests ran: the build of the current sources comes
    last."""
    return sorted(found, key=lambda c: (c.map.config, all(f.changed for f in figures(c))))


def parse_limits(words: Sequence[str]) -> dict[str, float]:
    """Parses `line=90` and similar arguments of --fail-under. Raises CoverError."""
    limits: dict[str, float] = {}
    for word in words:
        kind, _, number = word.partition("=")
        try:
            limit = float(number)
        except ValueError:
            limit = -1.0
        if kind not in KINDS or not 0.0 <= limit <= 100.0:
            kinds = ", ".join(f"{k}=PERCENT" for k in KINDS)
            raise CoverError(f"`{word}` is not a coverage limit; write {kinds}, with a percentage from 0 to 100")
        limits[kind] = limit
    return limits


# ---- text ------------------------------------------------------------------------------------------------------------


def _percent(share: Share) -> str:
    """Rounded down, so that 100 % means complete."""
    return f"{int(share.percent * 10) / 10:.1f} %" if share.total else "-"


def _cell(share: Share) -> str:
    return f"{_percent(share)} ({share.met}/{share.total})" if share.total else "-"


def _table(machine: MachineFigures) -> list[str]:
    rows = [("algorithm", *NAMES.values())]
    for f in machine.files:
        rows.append((", ".join(f.file.algorithms) or f.file.name, *(_cell(f.shares[kind]) for kind in KINDS)))
    rows.append(("all", *(_cell(machine.total(kind)) for kind in KINDS)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [f"coverage of {machine.machine} ({machine.config})"]
    for first, *rest in rows:
        cells = [cell.rjust(width) for cell, width in zip(rest, widths[1:], strict=True)]
        lines.append("  ".join(["", first.ljust(widths[0]), *cells]))
    return lines


def _misses(machine: MachineFigures) -> list[str]:
    lines: list[str] = []
    for f in machine.files:
        if f.changed:
            lines.append(f"{f.file.path}: changed since it ran; run again to show its lines")
        for miss in (*f.misses, *f.constants):
            lines += _miss(miss)
    return ["", *lines, ""] if lines else [""]


def _miss(miss: Miss) -> list[str]:
    lines = [f"{miss.span}: {miss.kind}: {miss.message}", *excerpt(miss.span)]
    return [*lines, *(f"  = pair: {part}" for part in miss.detail.split("; ") if part)]


# ---- JSON ------------------------------------------------------------------------------------------------------------


def _machine_json(machine: MachineFigures) -> dict[str, Any]:
    return {
        "machine": machine.machine,
        "config": machine.config,
        "total": {kind: _share_json(machine.total(kind)) for kind in KINDS},
        "files": [
            {
                "file": f.file.path,
                "algorithms": f.file.algorithms,
                "changed": f.changed,
                **{kind: _share_json(f.shares[kind]) for kind in KINDS},
                "misses": [_miss_json(m) for m in f.misses],
                "constants": [_miss_json(m) for m in f.constants],
            }
            for f in machine.files
        ],
    }


def _share_json(share: Share) -> dict[str, Any]:
    return {"met": share.met, "total": share.total, "percent": round(share.percent, 3)}


def _miss_json(miss: Miss) -> dict[str, Any]:
    at = miss.span
    span = {"line": at.line, "column": at.column, "end_line": at.end_line, "end_column": at.end_column}
    return {"kind": miss.kind, **span, "message": miss.message, "pair": miss.detail}
