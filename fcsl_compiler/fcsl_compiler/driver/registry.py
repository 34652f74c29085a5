# SPDX-License-Identifier: Apache-2.0
"""fcsl_machines.c: the tables of machines and monitors that a library exports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..model.c_names import c_string
from ..requirements.monitor import Monitor

_EXPORTED = '__attribute__((visibility("default")))'


def registry(names: Sequence[str], monitors: Mapping[str, Monitor]) -> str:
    """`monitors` by the machine that they watch."""
    lines = [
        "/* fcsl_machines.c: made by fcslc. Do not edit. */",
        "#include <fcsl/fcsl_machine.h>",
        *(["#include <fcsl/fcsl_monitor.h>"] if monitors else []),
        "#include <stddef.h>",
        "",
    ]
    lines += [f"extern const fcsl_machine_t {name}_machine;" for name in names]
    entries = ", ".join(f"&{name}_machine" for name in names)
    lines += ["", f"{_EXPORTED} const fcsl_machine_t *const fcsl_machines[] = {{{entries}, NULL}};"]
    for watched, monitor in monitors.items():
        lines += ["", *_monitor(watched, monitor)]
    if monitors:
        entries = ", ".join(f"&{monitor.name}_monitor" for monitor in monitors.values())
        lines += ["", f"{_EXPORTED} const fcsl_monitor_t *const fcsl_monitors[] = {{{entries}, NULL}};"]
    return "\n".join(lines) + "\n"


def _monitor(watched: str, monitor: Monitor) -> list[str]:
    name = monitor.name
    observed = [f"    {{{c_string(path)}, {c_string(target)}}}," for path, target in monitor.observed]
    rows = []
    for index, r in enumerate(monitor.requirements):
        source = c_string(r.condition.text if r.when is None else f"{r.when.text} => {r.condition.text}")
        kind = f"FCSL_REQUIRED_{r.kind.upper()}"
        rows.append(f"    {{{c_string(r.id)}, {c_string(r.text)}, {kind}, {int(r.assumed)}u, {index}u, {source}}},")
    return [
        f"extern const fcsl_machine_t {name}_machine;",
        f"static const fcsl_observed_t {name}_observed[] = {{",
        *observed,
        "};",
        f"static const fcsl_requirement_t {name}_rows[] = {{",
        *rows,
        "};",
        f"static const fcsl_monitor_t {name}_monitor = {{",
        f"    .watched = {c_string(watched)},",
        f"    .machine = &{name}_machine,",
        f"    .observed = {name}_observed,",
        f"    .observed_count = {len(observed)}u,",
        f"    .requirements = {name}_rows,",
        f"    .requirement_count = {len(rows)}u,",
        "};",
    ]
