# SPDX-License-Identifier: Apache-2.0
"""`--json`, `--sarif`: one document on stdout with a stable schema for editors and other programs."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from test_codes import ALONE

from fcsl_compiler.base.codes.examples import EXAMPLE_CONTROL, EXAMPLE_MACHINE, EXAMPLE_NAV
from fcsl_compiler.base.codes.pages import table
from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.toolchain import ToolchainError


def closed(properties: dict[str, Any], optional: tuple[str, ...] = ()) -> dict[str, Any]:
    """An object with exactly these members; `optional` may be absent."""
    required = [p for p in properties if p not in optional]
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}


def array(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


TEXT = {"type": "string", "minLength": 1}
MAYBE = {"type": "string"}
COUNT = {"type": "integer", "minimum": 0}
FROM_1 = {"type": "integer", "minimum": 1}
LOCATION = closed({"file": TEXT, "line": FROM_1, "column": FROM_1, "end_line": FROM_1, "end_column": FROM_1})
JSON = closed(
    {
        "version": {"const": 1},
        "ok": {"type": "boolean"},
        "diagnostics": array(
            closed(
                {
                    "code": {"pattern": "^[EW][0-9]{3}$"},
                    "severity": {"enum": ["error", "warning"]},
                    "message": TEXT,
                    "why": MAYBE,
                    "help": MAYBE,
                    "location": LOCATION,
                    "notes": array(closed({"message": TEXT, "location": LOCATION})),
                    "rendered": TEXT,
                }
            )
        ),
        "machines": array(
            closed(
                {
                    "config": TEXT,
                    "name": TEXT,
                    "instances": COUNT,
                    "states": FROM_1,
                    "output": TEXT,
                    "stack_bytes": COUNT,
                },
                ("output", "stack_bytes"),
            )
        ),
        "failure": TEXT,
    },
    ("failure",),
)

# The essentials of SARIF 2.1.0 (§3.13 to §3.30), strict in what this tool writes.
MESSAGE = closed({"text": TEXT})
PHYSICAL = closed(
    {
        "artifactLocation": closed({"uri": {"type": "string", "pattern": "^[A-Za-z0-9_.~/:%+,;=@!$&()*-]+$"}}),
        "region": closed({"startLine": FROM_1, "startColumn": FROM_1, "endLine": FROM_1, "endColumn": FROM_1}),
    }
)
RULE = closed(
    {
        "id": TEXT,
        "shortDescription": MESSAGE,
        "fullDescription": MESSAGE,
        "help": MESSAGE,
        "defaultConfiguration": closed({"level": {"enum": ["error", "warning"]}}),
    }
)
RESULT = closed(
    {
        "ruleId": TEXT,
        "ruleIndex": COUNT,
        "level": {"enum": ["error", "warning"]},
        "message": MESSAGE,
        "locations": {**array(closed({"physicalLocation": PHYSICAL})), "minItems": 1},
        "relatedLocations": array(closed({"id": COUNT, "message": MESSAGE, "physicalLocation": PHYSICAL})),
    }
)
SARIF = closed(
    {
        "$schema": {"const": "https://json.schemastore.org/sarif-2.1.0.json"},
        "version": {"const": "2.1.0"},
        "runs": {
            **array(
                closed(
                    {
                        "tool": closed({"driver": closed({"name": {"const": "fcslc"}, "rules": array(RULE)})}),
                        "columnKind": {"const": "unicodeCodePoints"},
                        "invocations": array(
                            closed(
                                {
                                    "executionSuccessful": {"type": "boolean"},
                                    "toolExecutionNotifications": array(
                                        closed({"level": {"const": "error"}, "message": MESSAGE})
                                    ),
                                },
                                ("toolExecutionNotifications",),
                            )
                        ),
                        "results": array(RESULT),
                    }
                )
            ),
            "minItems": 1,
            "maxItems": 1,
        },
    }
)
SCHEMAS = {"json": JSON, "sarif": SARIF}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A correct machine, one with errors in the algorithm and in the JSON, and one with a warning. Sets the current
    folder."""
    monkeypatch.chdir(tmp_path)
    for name in ("good", "bad files"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "nav.py").write_text(EXAMPLE_NAV)
        (tmp_path / name / "control.py").write_text(EXAMPLE_CONTROL)
    (tmp_path / "good" / "craft.json").write_text(EXAMPLE_MACHINE)
    (tmp_path / "good" / "idle.json").write_text(EXAMPLE_MACHINE.replace(', "control": 50', ""))
    bad = tmp_path / "bad files"
    (bad / "control.py").write_text(re.sub("self.force = .*", "self.force = self.mode  # µ", EXAMPLE_CONTROL))
    (bad / "tug.json").write_text(EXAMPLE_MACHINE.replace('"nav": 100', '"nav": 30'))
    return tmp_path


def report(capsys: pytest.CaptureFixture[str], form: str, *arguments: str) -> tuple[int, Any]:
    status = main([*arguments, f"--{form}"])
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    Draft202012Validator.check_schema(SCHEMAS[form])
    Draft202012Validator(SCHEMAS[form]).validate(document)
    return status, document


@pytest.mark.parametrize("form", SCHEMAS)
def test_success_is_a_document_too(folder: Path, form: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, found = report(capsys, form, "check", "good/craft.json")
    assert status == 0
    if form == "json":
        machine = {"config": "good/craft.json", "name": "craft", "instances": 2, "states": 2}
        assert found == {"version": 1, "ok": True, "diagnostics": [], "machines": [machine]}
    else:
        assert found["runs"][0]["results"] == [] and found["runs"][0]["invocations"] == [{"executionSuccessful": True}]


def test_several_machines_are_one_document(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, found = report(capsys, "json", "check", "good/idle.json", "bad files/tug.json", "good/craft.json")
    assert status == 1 and found["ok"] is False
    assert [d["code"] for d in found["diagnostics"]] == ["W204", "E402", "E220"]
    assert [m["name"] for m in found["machines"]] == ["idle", "craft"]


def test_places_are_files_that_an_editor_can_open(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, found = report(capsys, "json", "check", "bad files/tug.json")
    error = found["diagnostics"][0]
    at, note = error["location"], error["notes"][0]
    line = (folder / at["file"]).read_text().split("\n")[at["line"] - 1]
    assert at["end_line"] == at["line"] and line[at["column"] - 1 : at["end_column"] - 1] == "self.mode"
    assert (
        (folder / note["location"]["file"]).read_text().split("\n")[note["location"]["line"] - 1].endswith('"f64 N",')
    )
    assert error["message"] in error["rendered"] and error["help"] == "convert: f64(…)" and error["why"]


def test_sarif(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, found = report(capsys, "sarif", "check", "bad files/tug.json")
    run = found["runs"][0]
    assert status == 1 and [r["ruleId"] for r in run["results"]] == ["E402", "E220"]
    assert [run["tool"]["driver"]["rules"][r["ruleIndex"]]["id"] for r in run["results"]] == ["E402", "E220"]
    rule = run["tool"]["driver"]["rules"][1]
    assert rule["id"] == "E402" and rule["fullDescription"]["text"] == table()["E402"].explanation
    place = run["results"][0]["locations"][0]["physicalLocation"]
    assert place["artifactLocation"]["uri"] == "bad%20files/control.py"
    assert run["results"][0]["relatedLocations"][0]["physicalLocation"]["artifactLocation"] == place["artifactLocation"]
    _, found = report(capsys, "sarif", "check", str(folder / "bad files" / "tug.json"))
    place = found["runs"][0]["results"][0]["locations"][0]["physicalLocation"]
    assert place["artifactLocation"]["uri"] == (folder / "bad files" / "control.py").as_uri()


@pytest.mark.parametrize("form", SCHEMAS)
def test_a_file_that_is_not_there(folder: Path, form: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, found = report(capsys, form, "check", "good/none.json")
    assert status == 2
    if form == "json":
        assert found["diagnostics"][0]["location"]["file"] == "good/none.json"


def test_build(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, found = report(capsys, "json", "build", "good/idle.json", "-o", "out", "--c-only")
    assert status == 0 and found["machines"][0]["output"] == "out/fcsl_machines.c"
    assert [d["code"] for d in found["diagnostics"]] == ["W204"] and found["ok"] is True
    status, found = report(capsys, "json", "build", "good/craft.json", "-o", "out")
    assert status == 0 and found["machines"][0]["output"] == "out/libcraft.so"
    status, found = report(capsys, "sarif", "build", "bad files/tug.json", "-o", "none")
    assert status == 1 and len(found["runs"][0]["results"]) == 2 and not (folder / "none").exists()


@pytest.mark.parametrize("form", SCHEMAS)
def test_a_failure_of_the_tool_is_in_the_document(
    folder: Path, form: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ToolchainError("no C compiler")

    monkeypatch.setattr("fcsl_compiler.cli.build.build_library", broken)
    status, found = report(capsys, form, "build", "good/craft.json", "-o", "out")
    assert status == 1 and "no C compiler" in json.dumps(found)
    assert found.get("ok", False) is False


def test_dumps_are_text(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["build", "good/craft.json", "--dump", "verify", "--json"]) == 2
    assert "--dump" in capsys.readouterr().err


def test_text_counts_in_words(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "law.py").write_text("class Law:\n    def execute(self): ...\n")
    (folder / "craft.json").write_text(json.dumps(ALONE))
    assert main(["check", "craft.json"]) == 0
    assert capsys.readouterr().out == "craft.json: ok (1 instance, 1 state)\n"
