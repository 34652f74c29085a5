# SPDX-License-Identifier: Apache-2.0
"""Controls of the check `eva`: one small machine, and copies of its C with a seeded defect, each of which EVA must find."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

from ..shared import cases
from .run import Subject
from .subjects import subject

_ALGORITHM = """\
class Pick:
    inputs = {"at": "i64", "number": "i32", "divisor": "i32"}
    outputs = {"picked": "f64", "quotient": "i32", "doubled": "f64[5]"}
    state = {"table": "f64[5]"}

    def execute(self):
        self.picked = self.table[self.at]
        self.quotient = self.number // self.divisor
        self.doubled = self.table + self.table
"""
_CONFIG = {
    "tick_hz": 10,
    "initial_state": "RUN",
    "algorithms": {"Pick": {"source": "pick.py"}},
    "instances": {"pick": {"algorithm": "Pick"}},
    "states": {"RUN": {"schedule": {"pick": 10}}},
}


@dataclass(frozen=True)
class Control:
    """A machine with a seeded defect; EVA's complaint must contain `word`."""

    name: str
    word: str
    subject: Subject


#: What it is; what of the C, once there, becomes what; a word of EVA's complaint.
_DEFECTS = (
    ("a loop one too long", "i_ < 5;", "i_ <= 5;", "index_bound"),
    ("an index one too large", "index >= size", "index > size", "index_bound"),
    ("an index unchecked", "fcsl_index(inputs->at, 5, 2u, fault_)", "inputs->at", "index_bound"),
    ("a division by zero", "if (b > 0) {", "if (b >= 0) {", "division_by_zero"),
    ("an overflow", "a != INT32_MIN", "a != INT32_MAX", "overflow"),
    ("a local without its zero", "uint32_t fault = 0;", "uint32_t fault;", "initialization"),
    ("a machine without its zeros", "memset(m, 0, sizeof *m);", "", "initialization"),
    ("code that no run reaches", "(void)m;\n    return 0;", "return 1;", "never reached"),
    ("a step that does not end", "m->tick += 1u;", "for (;;) {\n    }", "non-terminating"),
)


def controls(folder: Path) -> list[Control]:
    """The machine without a defect, then one copy for each. Raises CheckFailed where a defect finds no place."""
    source = folder / "control" / "source"
    source.mkdir(parents=True, exist_ok=True)
    (source / "pick.py").write_text(_ALGORITHM)
    config = source / "control.json"
    config.write_text(json.dumps(_CONFIG))
    sound = subject(config, source.parent)
    found = [Control("none", "", sound)]
    text = sound.sources[0].read_text()
    for at, (name, right, wrong, word) in enumerate(_DEFECTS):
        if text.count(right) != 1:
            raise cases.CheckFailed(
                f"the control `{name}` wants `{right}` once in the C of its machine: {sound.sources[0]}"
            )
        seeded = folder / f"control{at}"
        seeded.mkdir(exist_ok=True)
        copy = seeded / "control.c"
        copy.write_text(text.replace(right, wrong))
        changed = replace(sound, name=f"control{at}", folder=seeded, sources=(copy, *sound.sources[1:]))
        found.append(Control(name, word, changed))
    return found
