# SPDX-License-Identifier: Apache-2.0
"""`fcsl prove` on generated requirements: what it proves is violated by no flight; what it refutes is violated by its own."""

from __future__ import annotations

import random
from pathlib import Path

from requirements_oracle import Generator, written
from test_requirements import TICK_HZ, machine

from fcsl_compiler.driver.monitors import compile_monitor
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.prove.counterexample import violates
from fcsl_compiler.prove.invariants import RandomInputs
from fcsl_compiler.prove.progress import Answer
from fcsl_compiler.prove.properties import properties_of
from fcsl_compiler.prove.search import search
from fcsl_compiler.prove.watched import Watched


def test_answers_about_generated_requirements(tmp_path: Path) -> None:
    generator = Generator(115, TICK_HZ)
    path = machine(tmp_path, [written(generator.requirement(f"R-{i}")) for i in range(20)])
    compiled = compile_machine(path, "", until="lower")
    compile_monitor(compiled, until="lower")
    watched = Watched(compiled)
    wanted = list(properties_of(watched.machine, watched.requirements))
    found = search(watched, wanted, 5.0, 4, lambda _: None).findings
    refuted = [p for p in wanted if found[p].answer is Answer.REFUTED]
    proven = [p for p in wanted if found[p].answer is Answer.PROVEN and p.kind == "requirement"]
    assert refuted and proven
    assert all(violates(watched, p, found[p].flight) for p in refuted)
    for seed in range(8):
        watched.begin()
        inputs = RandomInputs(watched, random.Random(1000 + seed), loses=seed % 2 == 0)
        for _ in range(100):
            assert inputs.tick() is not None
            assert not any(watched.is_violated(p) for p in proven)
