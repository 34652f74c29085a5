# SPDX-License-Identifier: Apache-2.0
"""Requirements with an effect, and those that guard a transition, are part of the machine.

What they do in generated machines is compared with an oracle in test_generated.py.
"""

import json
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_tables import PUPPET, kind, puppet_machine, run_table

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.coverage.instrument import instrument
from fcsl_compiler.driver.passes import Compilation, compile_machine
from fcsl_compiler.driver.record import SUFFIX, StaleBuild, check_record, write_record
from fcsl_compiler.emit.field_table import field_table, layout_hash, source_hash
from fcsl_compiler.model.machine import Machine

__all__ = ["kind"]

SLOW = {"id": "R-1", "text": "The value is small.", "then": "one.inputs.divisor < 2", "effect": {"fail": "two"}}
GUARD = {
    "id": "R-2",
    "text": "It is not large.",
    "never": "one.inputs.divisor * 3000000000000000000 > 8000000000000000000",
}
TO_C = {"from": "A", "to": "C", "requirement": "R-2", "priority": 9}


def test_a_violation_fails_its_instance_and_takes_a_transition(tmp_path: Path) -> None:
    """In its own tick. `two` runs in every third tick of C, and keeps the health until then."""
    requirements = [{**SLOW, "stale": "hold"}, GUARD]
    m = puppet_machine(tmp_path, requirements=requirements, transitions=[TO_C], requests=["GO", "HALT"])
    columns = ["machine.state", "machine.next_state", "two.outputs.health", "requirements.r_2.outputs.health"]
    table: list[tuple[dict[str, Any], list[Any]]] = [
        ({}, ["A", "A", "nominal", "nominal"]),
        ({"one.inputs.divisor": 2}, ["A", "A", "failed", "nominal"]),
        ({"one.inputs.divisor": 1}, ["A", "A", "nominal", "nominal"]),
        ({"one.inputs.divisor": 4}, ["A", "A", "failed", "failed"]),  # beyond 64 bits: it does not act
        ({"one.inputs.divisor": 3}, ["A", "C", "failed", "degraded"]),
        *[({}, ["C", "C", "failed", "nominal"])] * 2,
        ({"one.inputs.divisor": 1}, ["C", "C", "failed", "nominal"]),
        ({}, ["C", "C", "failed", "nominal"]),
        ({}, ["C", "C", "nominal", "nominal"]),
    ]
    run_table(m, columns, table)


def machine(folder: Path, own: Any, **more: Any) -> Compilation:
    """A and B run `one` and `two`."""
    schedule = {"schedule": {"one": 10, "two": 10}}
    config = {
        "tick_hz": 10,
        "initial_state": "A",
        "algorithms": {"Puppet": {"source": "puppet.py"}},
        "instances": {name: {"algorithm": "Puppet"} for name in ("one", "two")},
        "states": {"A": schedule, "B": schedule},
        "requests": ["GO", "HALT"],
        "requirements": own,
    }
    (folder / "puppet.py").write_text(PUPPET)
    path = folder / "craft.json"
    path.write_text(json.dumps({**config, **more.pop("config", {})}))
    return compile_machine(path, "", **{"until": "schedule", **more})


def hashes(m: Machine) -> tuple[str, str]:
    return source_hash(m), layout_hash(m, field_table(m))


def test_what_acts_counts_in_the_hashes_and_nothing_else_does(tmp_path: Path) -> None:
    """In the JSON, and in a file that it names; what `--requirements` gives instead does not act."""
    reporting = {key: value for key, value in SLOW.items() if key != "effect"}
    without = machine(tmp_path, []).checked
    assert hashes(machine(tmp_path, [reporting]).checked) == hashes(without)
    with_effect = machine(tmp_path, [SLOW]).checked
    assert source_hash(with_effect) != source_hash(without)
    own = tmp_path / "own.json"
    found = []
    for text in ("It is.", "It was."):
        own.write_text(json.dumps({"requirements": [{**SLOW, "text": text}]}))
        found.append(hashes(machine(tmp_path, "own.json").checked))
    assert found[0] != found[1]
    other = machine(tmp_path, [reporting], requirements=own)
    assert hashes(other.checked) == hashes(without) and [r.text for r in other.requirements] == ["It was."]
    still = machine(tmp_path, [SLOW], requirements=own)
    assert hashes(still.checked) == hashes(with_effect)


def test_a_subset_machine_has_those_that_need_nothing_else(tmp_path: Path) -> None:
    """A transition without its requirement is left out, as one without its instance is."""
    edges = {"transitions": [{"from": "A", "to": "B", "requirement": "R-2"}]}
    whole = machine(tmp_path, [SLOW, GUARD], config=edges).checked
    assert [i.name for i in whole.instances][2:] == ["requirements.r_1", "requirements.r_2"]
    one = machine(tmp_path, [SLOW, GUARD], config=edges, instances=["one"]).checked
    assert [i.name for i in one.instances] == ["one", "requirements.r_2"] and len(one.edges) == 1
    two = machine(tmp_path, [SLOW, GUARD], config=edges, instances=["two"]).checked
    assert [i.name for i in two.instances] == ["two"] and not two.edges


def test_a_library_is_older_than_the_file_of_its_requirements(tmp_path: Path) -> None:
    own, library = tmp_path / "own.json", tmp_path / "libcraft.so"
    own.write_text(json.dumps({"requirements": [SLOW]}))
    compilation = machine(tmp_path, "own.json", until="emit")
    write_record(Path(f"{library}{SUFFIX}"), [compilation], "fcsl build")
    check_record(library, "craft", compilation.build_hash)
    own.write_text(own.read_text() + "\n")
    with pytest.raises(StaleBuild, match=r"requirements .*own\.json has changed"):
        check_record(library, "craft", compilation.build_hash)


def test_coverage_is_about_the_files_of_the_user(tmp_path: Path) -> None:
    m = machine(tmp_path, [SLOW]).checked
    assert [source.name for source in m.sources] == ["puppet.py", "craft_effects.py"]
    assert [file.name for file in instrument(m, "craft.json").map.files] == ["puppet.py"]


def test_a_wrong_requirement_is_reported_once(tmp_path: Path) -> None:
    """A transition that names it is not."""
    edges = {"transitions": [{"from": "A", "to": "B", "requirement": "R-2"}]}
    with pytest.raises(DiagnosticError) as caught:
        machine(tmp_path, [{**GUARD, "never": "one.outputs.z > 1"}], config=edges)
    assert [d.code for d in caught.value.diagnostics] == ["E257"]
