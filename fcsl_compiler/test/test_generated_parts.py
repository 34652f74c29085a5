# SPDX-License-Identifier: Apache-2.0
"""Generated machines, some of whose instances become a part: the C stays the same."""

import copy
import json
import re
from pathlib import Path
from typing import Any

from fcsl_generator.campaign import generate
from fcsl_generator.machines import Case, cases

from fcsl_compiler.driver.passes import compile_machine

COUNT = 30


def rates_of(config: dict[str, Any], moved: list[str]) -> dict[str, Any] | None:
    """Rates of instances that all states schedule alike or not at all; None where they do not."""
    schedules = [config.get("always", {}), *(state.get("schedule", {}) for state in config["states"].values())]
    found = [{n: s[n] for n in moved if n in s} for s in schedules]
    there = [rates for rates in found if rates]
    if not there or any(rates != there[0] for rates in there) or set(there[0]) != set(moved):
        return None
    return there[0] if not any(isinstance(r, dict) and "every" in r for r in there[0].values()) else None


class Split:
    """A machine of which instances [first, last) are a part `p`."""

    def __init__(self, config: dict[str, Any], first: int, last: int):
        self.flat, self.outer = copy.deepcopy(config), copy.deepcopy(config)
        self.moved = list(config["instances"])[first:last]
        self.ports: dict[str, dict[str, str]] = {"inputs": {}, "outputs": {}}
        self.part: dict[str, Any] = {
            "tick_hz": config["tick_hz"],
            "initial_state": "ON",
            "algorithms": config["algorithms"],
            "instances": {n: config["instances"][n] for n in self.moved},
            "requests": config.get("requests", []),
            "ports": self.ports,
            **({"structs": config["structs"]} if "structs" in config else {}),
        }

    def split(self) -> bool:
        """Makes part and outer machine; False if their schedules do not allow it."""
        rates = rates_of(self.outer, self.moved)
        if rates is None:
            return False
        self.part["states"] = {"ON": {"schedule": rates}}
        for schedule in [self.outer.get("always", {}), *(s.get("schedule", {}) for s in self.outer["states"].values())]:
            if self.moved[0] in schedule:
                for name in self.moved:
                    del schedule[name]
                schedule["p"] = True
        requests = {request: request for request in self.outer.get("requests", [])}
        instances = {}
        for name, definition in self.outer["instances"].items():
            if name == self.moved[0]:
                instances["p"] = {"machine": "part.json", **({"requests": requests} if requests else {})}
            if name not in self.moved:
                instances[name] = definition
        self.outer["instances"] = instances
        self._connect()
        for channel in self.outer.get("channels", []):
            instance, record, field, *members = channel["field"].split(".")
            if instance in self.moved:
                channel["field"] = ".".join(["p", record, self._port(record, f"{instance}.{field}"), *members])
        for transition in self.outer.get("transitions", []):
            if transition.get("health", {}).get("instance") in self.moved:
                transition["health"]["instance"] = f"p.{transition['health']['instance']}"
        if "publish" in self.outer:
            self.outer["publish"] = [f"p.{n}" if n in self.moved else n for n in self.outer["publish"]]
        return True

    def _connect(self) -> None:
        inside, outside = [], []
        for connection in self.outer.get("connections", []):
            ends = [connection[end].partition(".")[0] for end in ("from", "to")]
            is_inside = ends[1] in self.moved and ends[0] in (*self.moved, "machine")
            (inside if is_inside else outside).append(connection)
        self.part["connections"] = inside
        # The part's come first.
        self.flat["connections"] = copy.deepcopy([*inside, *outside])
        for connection in outside:
            for end, record in (("from", "outputs"), ("to", "inputs")):
                instance, _, rest = connection[end].partition(".")
                if instance in self.moved:
                    field, dot, members = rest.partition(".")
                    connection[end] = f"p.{self._port(record, f'{instance}.{field}')}{dot}{members}"
        self.outer["connections"] = outside

    def _port(self, record: str, path: str) -> str:
        name = path.replace(".", "X").replace("_", "Y")
        self.ports[record][name] = path
        return name


def code_of(case: Case, config: dict[str, Any], folder: Path) -> list[str]:
    """The C, without comments and hashes; instances of the part have the names that they have without it."""
    path = Case(config, case.program, case.structs, case.ticks, case.board).write(folder, "whole")
    compilation = compile_machine(path, "")
    text = re.sub(r"/\*.*?\*/", "", compilation.header + compilation.source, flags=re.DOTALL)
    text = re.sub(r"0x[0-9a-f]{2}u?|[0-9a-f]{64}|^#line.*", "", text, flags=re.MULTILINE)
    return (
        re.sub(r"(?<![a-z])(i_|whole_|__|\b)p(?:__|\.)(?=b\d)", r"\1", text).replace("WholePB", "WholeB").splitlines()
    )


def test_a_generated_machine_of_parts_is_the_machine_without(tmp_path: Path) -> None:
    split = 0
    for number in range(COUNT):
        case = generate(cases(), 1, 1, first=number)[0]
        count = len(case.config["instances"])
        for first, last in {(0, count), (0, (count + 1) // 2), (count // 2, count)}:
            made = Split(case.config, first, last)
            if "requests" not in case.config or not made.split():
                continue
            split += 1
            folder = tmp_path / f"{number}_{first}_{last}"
            folder.mkdir()
            flat = code_of(case, made.flat, folder)
            (folder / "part.json").write_text(json.dumps(made.part, indent=1))
            assert code_of(case, made.outer, folder) == flat, f"{folder}: {case}"
    assert split > COUNT // 3
