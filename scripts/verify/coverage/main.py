# SPDX-License-Identifier: Apache-2.0
"""Coverage: what `fcsl cover` says of random algorithms is what clang says of their generated C.

Every algorithm is compiled twice, for coverage and plain; the plain C with clang's source-based coverage and MC/DC. Both
run the same ticks. Compared are, line by line of Python, whether it ran, and of every decision of two conditions or more
how often each condition was True and False at all, and which conditions have their pair. clang asks for pairs in which no
other condition that both evaluated differs; of masking MC/DC that is a part. So every pair that clang finds must be found,
and by clang's own rule the combinations that fcslc kept must give exactly clang's verdicts.
"""

from __future__ import annotations

import argparse
import itertools
import json
import random
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from fcsl_compiler.coverage.counts import Counts, read_folder
from fcsl_compiler.coverage.mcdc import Vector, shown
from fcsl_compiler.coverage.probe_map import Decision
from fcsl_compiler.driver.library import emit
from fcsl_compiler.driver.toolchain import include_dirs

from ..shared.cases import CheckFailed, compile_c, run, write_facts
from ..shared.effort import scaled

CLANG = "clang-19"
FLAGS = ["-std=c11", "-O1", "-ffp-contract=off", "-fprofile-instr-generate", "-fcoverage-mapping", "-fcoverage-mcdc"]
INPUTS = [f"b{n}" for n in range(6)]
HEAD = f"""\
class Law:
    inputs = {{{", ".join(f'"{name}": "bool"' for name in INPUTS)}, "x": "f64"}}
    outputs = {{"n": "i64", "r": "bool"}}

    def execute(self):
"""

#: The host of the plain machine: one instance; each word of the input is a tick's inputs, as bits; x is the word mod 7.
HOST = """\
#include <stdio.h>
#include <stdlib.h>
#include "trial.h"

int main(int count, char **words)
{
    static trial_t m;
    const fcsl_host_t host = {0};
    trial_machine.init(&m);
    if (trial_machine.start(&m) != 0) {
        return 1;
    }
    for (int k = 1; k < count; ++k) {
        const unsigned long word = strtoul(words[k], NULL, 10);
        @SETS@
        m.i_law.inputs.x = (double)(word % 7u);
        trial_machine.step(&m, &host);
    }
    return 0;
}
"""


def expression(r: random.Random, conditions: int) -> str:
    """A Boolean expression of so many conditions. `not` stands before conditions alone: clang 19 measures no decision with
    one before an operator (test_cover_mcdc.py has those)."""
    if conditions == 1:
        text = r.choice(
            [*(f"self.{name}" for name in INPUTS), *(f"self.x {sign} {r.randrange(7)}.0" for sign in (">", "=="))]
        )
        return f"not {text}" if r.random() < 0.2 else text
    left = r.randrange(1, conditions)
    return f"({expression(r, left)} {r.choice(('and', 'or'))} {expression(r, conditions - left)})"


def statements(r: random.Random, depth: int) -> list[str]:
    """Statements of execute, with decisions of one to six conditions."""
    found: list[str] = []
    for _ in range(r.randrange(1, 4)):
        text = expression(r, r.choice((1, 2, 2, 3, 4, 5, 6)))
        kind = r.random()
        if kind < 0.3 or depth == 0:
            found.append(f"self.r = {text}")
        elif kind < 0.4:
            found.append(f"self.n = 1 if {text} else 2")
        else:
            found += [f"if {text}:", *(f"    {line}" for line in statements(r, depth - 1))]
            if r.random() < 0.5:
                found += ["else:", *(f"    {line}" for line in statements(r, depth - 1))]
    return found


def write_trial(folder: Path, r: random.Random) -> Path:
    """A machine of one algorithm."""
    folder.mkdir(parents=True)
    body = "\n".join(f"        {line}" for line in statements(r, 2))
    (folder / "law.py").write_text(f"{HEAD}{body}\n")
    config = {
        "tick_hz": 10,
        "initial_state": "RUN",
        "algorithms": {"Law": {"source": "law.py"}},
        "instances": {"law": {"algorithm": "Law"}},
        "states": {"RUN": {"schedule": {"law": 10}}},
    }
    path = folder / "trial.json"
    path.write_text(json.dumps(config))
    return path


def by_fcslc(folder: Path, config: Path, ticks: list[int]) -> Counts:
    """Through the interface that users have: a command under `fcsl cover`'s environment, hosted by AlgTwin."""
    script = (
        "import sys\nfrom simclient import AlgTwin\n"
        "with AlgTwin.from_config(sys.argv[1]) as twin:\n"
        "    for word in map(int, sys.argv[2:]):\n"
        f"        for bit, name in enumerate({INPUTS!r}):\n"
        "            twin.set(f'law.inputs.{name}', bool(word >> bit & 1))\n"
        "        twin.set('law.inputs.x', float(word % 7))\n        twin.tick()\n"
    )
    counts = folder / "counts"
    counts.mkdir()
    environment = [f"FCSL_COVER_DIR={counts}", f"FCSL_CACHE_DIR={folder / 'cache'}"]
    run(["env", *environment, sys.executable, "-c", script, config, *map(str, ticks)])
    return read_folder(counts)[0]


def by_clang(folder: Path, config: Path, ticks: list[int]) -> tuple[dict[str, Any], dict[int, int]]:
    """llvm-cov's export of the C file, and the Python line of every C line."""
    emit([config], folder / "plain")
    sets = " ".join(f"m.i_law.inputs.{name} = (word >> {bit} & 1u) != 0u;" for bit, name in enumerate(INPUTS))
    (folder / "host.c").write_text(HOST.replace("@SETS@", sets))
    sources = [folder / "plain" / "trial.c", folder / "plain" / "fcsl_machines.c", folder / "host.c"]
    program = folder / "host"
    compile_c([CLANG], FLAGS, sources, [folder / "plain", *include_dirs()], program)
    run(["env", f"LLVM_PROFILE_FILE={folder}/raw", program, *map(str, ticks)])
    run(["llvm-profdata-19", "merge", "-o", folder / "data", folder / "raw"])
    exported = run(["llvm-cov-19", "export", program, f"-instr-profile={folder}/data", str(sources[0])])
    lines: dict[int, int] = {}
    for first, last, file, line in json.loads((folder / "plain" / "trial.map.json").read_text())["runs"]:
        if file == "law.py":
            lines |= {number: line for number in range(first, last + 1)}
    return json.loads(exported)["data"][0]["files"][0], lines


def clang_rule(decision: Decision, vectors: list[Vector]) -> set[int]:
    """llvm::coverage::MCDCRecord: a pair of other outcomes, of whose common conditions one alone differs, is that one's."""
    found: set[int] = set()
    for v, w in itertools.combinations(vectors, 2):
        differ = (v.value ^ w.value) & v.evaluated & w.evaluated
        if v.outcome != w.outcome and differ.bit_count() == 1:
            found.add(differ.bit_length() - 1)
    return found


def compare(
    counts: Counts, clang: dict[str, Any], lines: dict[int, int], text: list[str], tally: dict[str, int]
) -> None:
    """Raises CheckFailed at the first difference."""
    file = counts.map.files[0]
    records: dict[int, list[list[Any]]] = {}
    for record in sorted(clang["mcdc_records"], key=lambda r: (r[0], r[1])):
        if record[0] in lines:  # not a decision of the machine's own
            records.setdefault(lines[record[0]], []).append(record[-1])
    decisions = [d for d in file.decisions.values() if len(d.conditions) > 1]
    for decision in decisions:
        at = f"line {decision.at[0]}"
        theirs = records.pop(decision.at[0], [])
        if len(theirs) != 1 or len(theirs[0]) != len(decision.conditions):
            raise CheckFailed(f"{at}: clang knows {theirs}, fcslc {len(decision.conditions)} conditions")
        vectors = counts.vectors(decision)
        own = {n for n, seen in shown(decision.tree, vectors).items() if len(seen) == 2}
        said = {n for n, covered in enumerate(theirs[0]) if covered}
        if clang_rule(decision, vectors) != said:
            raise CheckFailed(
                f"{at}: by clang's rule {sorted(clang_rule(decision, vectors))}, clang says {sorted(said)}"
            )
        if not said <= own:
            raise CheckFailed(f"{at}: clang has pairs of {sorted(said)}, fcslc of {sorted(own)}")
        tally["conditions"] += len(decision.conditions)
        tally["pairs of both"] += len(said)
        tally["pairs by masking alone"] += len(own - said)
    if records:
        raise CheckFailed(f"clang knows decisions on lines {sorted(records)} that fcslc does not")
    tally["decisions"] += len(decisions)
    tally["branches"] += compare_branches(counts, clang, lines)
    tally["lines"] += compare_lines(counts, clang, text)


def compare_branches(counts: Counts, clang: dict[str, Any], lines: dict[int, int]) -> int:
    """Each condition of a line, in order: whether it was ever True, and ever False."""
    theirs: dict[int, list[tuple[bool, bool]]] = {}
    for row in sorted(clang["branches"], key=lambda r: (r[0], r[1])):
        if row[0] in lines:
            theirs.setdefault(lines[row[0]], []).append((row[4] > 0, row[5] > 0))
    compared = 0
    for decision in counts.map.files[0].decisions.values():
        values: list[set[bool | None]]
        if len(decision.conditions) == 1:
            values = [{value != _is_turned(decision.tree, 0) for value in counts.outcomes(decision)}]
        else:
            values = [{v.of(n) for v in counts.vectors(decision)} for n in range(len(decision.conditions))]
        # clang takes `!x` for the condition.
        turned = [_is_turned(decision.tree, n) for n in range(len(values))]
        own = [((not t) in v, t in v) for v, t in zip(values, turned, strict=True)]
        found = theirs.get(decision.at[0])
        if found is None and not decision.branch and len(decision.conditions) == 1:
            continue  # clang takes no notice of a comparison that is a value
        if found != own:
            raise CheckFailed(f"line {decision.at[0]}: clang's branches {found}, fcslc's {own}")
        compared += 2 * len(decision.conditions)
    return compared


def _is_turned(tree: Any, condition: int) -> bool:
    """Whether `not` stands before the condition."""
    if isinstance(tree, int):
        return False
    if tree[0] == "not":
        return tree[1] == condition
    return any(_is_turned(part, condition) for part in tree[1:])


def compare_lines(counts: Counts, clang: dict[str, Any], text: list[str]) -> int:
    """A Python line ran where the C behind its comment did. (The comment of an `elif` stands inside its block.)"""
    executed: dict[int, bool] = {}
    for number, line in enumerate(text):
        comment = re.match(r"\s*/\* law.py:(\d+): (?!def )", line)
        if comment and not text[number - 1].strip().startswith("} else if"):
            statement = text[number + 1]
            at = (number + 2, len(statement) - len(statement.lstrip()) + 1)
            entry = [s for s in clang["segments"] if (s[0], s[1]) <= at and s[3]][-1]
            executed[int(comment[1])] = entry[2] > 0
    file = counts.map.files[0]
    for number, ran in executed.items():
        if ran != bool(counts.words[file.lines[number][1]]):
            raise CheckFailed(f"line {number}: clang says {ran}, fcslc {not ran}")
    return len(executed)


#: What is taken away of what fcslc counted, and the words of the difference that must be found.
DAMAGES = {"combinations": ("by clang's rule", "clang's branches"), "lines": ("clang says True, fcslc False",)}


def damaged(counts: Counts, what: str) -> Counts:
    """The same without any combination of conditions, or without any line."""
    words, file = list(counts.words), counts.map.files[0]
    if what == "lines":
        for _, word in file.lines.values():
            words[word] = 0
    else:
        for d in file.decisions.values():
            words[d.word + 3 : d.word + d.words] = [0] * d.slots
    return Counts(counts.map, tuple(words))


def trial(number: int, seed: int, tally: dict[str, int], damage: str = "") -> None:
    """One random algorithm; `damage`: one of DAMAGES, which must be found. Raises CheckFailed."""
    r = random.Random(f"{seed}/{number}")
    with tempfile.TemporaryDirectory(prefix="fcsl-coverage-") as scratch:
        folder = Path(scratch)
        config = write_trial(folder / "trial", r)
        ticks = [r.randrange(1 << 16) for _ in range(r.choice((1, 3, 10, 40)))]
        counts = by_fcslc(folder, config, ticks)
        try:
            clang, lines = by_clang(folder, config, ticks)
            text = (folder / "plain" / "trial.c").read_text().splitlines()
            compare(damaged(counts, damage) if damage else counts, clang, lines, text, tally)
        except CheckFailed as error:
            program = (folder / "trial" / "law.py").read_text()
            raise CheckFailed(f"trial {number} of seed {seed}: {error}\n{program}\nticks {ticks}") from None


def controls(seed: int, tally: dict[str, int]) -> dict[str, str]:
    """In how many of five algorithms each damage was found, for its own reason. Raises CheckFailed where in none."""
    seen = {}
    for damage, words in DAMAGES.items():
        found = 0
        for number in range(5):
            try:
                trial(number, seed, dict.fromkeys(tally, 0), damage)
            except CheckFailed as error:
                found += any(word in str(error) for word in words)
        if not found:
            raise CheckFailed(f"control: {damage} taken away were not missed: this check finds nothing")
        seen[f"control, {damage} missed"] = f"{found} of 5"
    return seen


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--trials", type=int, default=scaled(20, 40), help="how many random algorithms (default 20, or 40)"
    )
    parser.add_argument("--seed", type=int, default=1, help="which ones (default 1)")
    options = parser.parse_args()
    if options.trials < 1:
        parser.error("--trials: at least 1")
    tally = dict.fromkeys(
        ("lines", "branches", "decisions", "conditions", "pairs of both", "pairs by masking alone"), 0
    )
    try:
        for number in range(options.trials):
            trial(number, options.seed, tally)
            if number % 10 == 9:
                print(f"{number + 1} of {options.trials} algorithms: fcslc and clang agree", flush=True)
        missed = controls(options.seed, tally)
    except (CheckFailed, subprocess.SubprocessError) as error:
        print(f"coverage: {error}", file=sys.stderr)
        return 1
    facts = {"algorithms": options.trials, **tally, **missed}
    for name, value in facts.items():
        print(f"{name:<32} {value}")
    write_facts("coverage", facts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
