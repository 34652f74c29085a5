# SPDX-License-Identifier: Apache-2.0
"""Algorithm classes: several in a file, other names, comments, name conflicts. Compiled machines and CPython side by
side."""

from pathlib import Path

import pytest
from fcsl_test_abi import Machine, classes, write_machine, write_one_each
from fcsl_test_twins import Twins

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.passes import compile_machine

# ---- several classes in a file ---------------------------------------------------------------------------------------

SENSORS = """
from fcsl_builtins import f64

SCALE = 2.0


def scaled(x: f64) -> f64:
    return SCALE * x


class Source:
    outputs = {"x": "f64"}

    def execute(self):
        self.x += 1.0


class Filter:
    inputs = {"x": "f64"}
    outputs = {"y": "f64"}
    state = {"source": "f64"}

    def start(self):
        self.source = scaled(0.5)

    def execute(self):
        self.source = scaled(self.x) + self.source
        self.y = self.source


class Draft:
    inputs = {"x": "f64"}

    def execute(self):
        self.z = nothing + "here" * self.x
"""


def test_several_classes_in_a_file(tmp_path: Path) -> None:
    """With their own and other names. A class that no machine uses may be incomplete."""
    algorithms = {
        "Source": {"source": "sensors.py"},
        "smooth": {"source": "sensors.py", "class": "Filter"},
        "Smoother": {"source": "sensors.py", "class": "Filter"},
    }
    wires = [{"from": "source.x", "to": "smooth.x"}, {"from": "smooth.y", "to": "smoother.x"}]
    path = write_one_each(tmp_path, {"sensors.py": SENSORS}, algorithms, connections=wires)
    twins = Twins(path)
    assert {n: i.algorithm for n, i in twins.native.instances.items()} == {
        "source": b"Source",
        "smooth": b"smooth",
        "smoother": b"Smoother",
    }
    for tick, (x, y, z) in enumerate([(1, 3, 7), (2, 7, 21), (3, 13, 47)]):
        twins.step(where=f"tick {tick}")
        assert [twins.get(p) for p in ("source.outputs.x", "smooth.outputs.y", "smoother.outputs.y")] == [x, y, z]
    source = compile_machine(path, "").source
    for name in ("Source", "smooth", "Smoother"):
        assert f"alg_{name}__execute(" in source
    assert source.count("mod_sensors__scaled(double") == 1 and "Draft" not in source
    draft = {**algorithms, "Draft": {"source": "sensors.py"}}
    with pytest.raises(DiagnosticError) as error:
        compile_machine(write_one_each(tmp_path / "draft", {"sensors.py": SENSORS}, draft), "")
    assert {d.code for d in error.value.diagnostics} == {"E408"}


def test_a_class_that_is_not_used_may_be_of_another_machine(tmp_path: Path) -> None:
    """Its form is checked. Its types may be structs that this machine does not declare."""
    files = {
        "laws.py": 'class A:\n    def execute(self): ...\n\n\nclass B:\n    inputs = {"p": "Pose"}\n\n    def execute(self): ...\n'
    }
    compile_machine(write_one_each(tmp_path, files, {"A": {"source": "laws.py"}}), "")
    files["laws.py"] += "    LIMIT = 1.0\n"
    with pytest.raises(DiagnosticError, match="E305"):
        compile_machine(write_one_each(tmp_path, files, {"A": {"source": "laws.py"}}), "")


def test_start_may_say_what_holds_anyway(tmp_path: Path) -> None:
    text = """class A:
    outputs = {"transition_request": "TransitionRequest"}

    def start(self):
        self.transition_request = ""
        self.health = "nominal"

    def execute(self): ...
"""
    twins = Twins(write_one_each(tmp_path, {"a.py": text}, {"A": {"source": "a.py"}}))
    assert twins.get("a.outputs.health") == "stale"  # as before the first run; both were compared


def test_instances_point_at_their_class(tmp_path: Path) -> None:
    algorithms = {"Source": {"source": "sensors.py"}, "smooth": {"source": "sensors.py", "class": "Filter"}}
    m = Machine.build(write_one_each(tmp_path, {"sensors.py": SENSORS}, algorithms))
    assert {n: i.source_line for n, i in m.instances.items()} == {
        "source": SENSORS[: SENSORS.index("self.x += 1.0")].count("\n"),
        "smooth": SENSORS[: SENSORS.index("self.source = scaled(self.x)")].count("\n"),
    }


# ---- comments --------------------------------------------------------------------------------------------------------

COMMENTED = """
class Law:
    '''Turns a thing.

    Twice.
    '''

    inputs = {  # of the class
        "a": "f64 m",  # the first
        # and more of it
        #: with marks

        #
        "b": "f64[3] m/s",   #without a blank
        "c": "bool", "d": "i32",  # ends two
        "e":
            "f64",  # on a line of its own
        # behind it, for `e`
        "f": "f64"
        "",  # joined
        "g": "f64"  # without a comma
        , "h": "f64",  # after a comma
    }  # the end
    outputs = {"x": "f64 N"}  # all on one line
    parameters = {"k": "f64", "l": "f64 in 0..1"}  # two on one line
    state = {
        # above the first
        "s": "f64",  # "quoted", 100 % {braces} \\\\ back
        "t": "f64",
        # only below
        "u": "f64",
    }

    def execute(self):
        pass
"""


def test_comments_are_documentation(tmp_path: Path) -> None:
    path = write_machine(
        tmp_path,
        "commented",
        {
            "tick_hz": 1,
            "initial_state": "A",
            "instances": {"one": {"algorithm": "Law", "parameters": {"k": 1, "l": 1}}},
            "states": {"A": {"schedule": {"one": 1}}},
        },
        {"law": COMMENTED},
    )
    m = Machine.build(path)
    found = {p.split(".")[2]: f.doc.decode() for p, f in m.fields.items() if p.startswith("one.") and p.count(".") == 2}
    assert {name: doc for name, doc in found.items() if doc} == {
        "a": "the first and more of it with marks",
        "b": "without a blank",
        "e": "on a line of its own behind it, for `e`",
        "f": "joined",
        "g": "without a comma",
        "h": "after a comma",
        "x": "all on one line",
        "s": '"quoted", 100 % {braces} \\\\ back',
        **{
            n: d
            for n, d in found.items()
            if n in ("faults", "overruns", "fault_place", "health", "transition_request") and d
        },
    }
    assert compile_machine(path, "").checked.algorithms[0].doc == "Turns a thing.\n\nTwice."


# ---- names that could meet -------------------------------------------------------------------------------------------


def law(expression: str, head: str = "") -> str:
    return f'{head}\n\n\nclass Law:\n    outputs = {{"x": "f64"}}\n\n    def execute(self):\n        self.x = {expression}\n'


def helper(name: str, result: str, head: str = "") -> str:
    return f"{head}\n\n\ndef {name}(x: f64) -> f64:\n    return {result}\n"


MEETING: dict[str, tuple[dict[str, str], float]] = {
    "constants of files whose names begin alike": (
        {
            "law.py": law("k_X[0] * 10.0 + X[1]", "from frames import k_X\nfrom frames_k import X"),
            "frames.py": "k_X = [1.0, 2.0]\n",
            "frames_k.py": "X = [3.0, 4.0]\n",
        },
        14.0,
    ),
    "helpers of files whose names begin alike": (
        {
            "law.py": law(
                "a(1.0) + b(2.0) + c(3.0)", "from frames import a\nfrom frames_2 import b\nfrom sub.frames import c"
            ),
            "frames.py": helper("a", "x * 100.0"),
            "frames_2.py": helper("b", "x * 10.0"),
            "sub/frames.py": helper("c", "x"),
        },
        123.0,
    ),
    "helpers of one name": (
        {
            "law.py": law("a(1.0) + b(2.0)", "from frames import a" + helper("b", "x + 100.0")),
            "frames.py": helper("b", "x + K[0]", "K = [3.0]") + helper("a", "b(x)"),
        },
        106.0,
    ),
    "constants of one name": (
        {
            "law.py": law("a(1.0) + K[0]", "from frames import a\n\nK = [5.0]"),
            "frames.py": helper("a", "x + K[0]", "K = [3.0]"),
        },
        9.0,
    ),
    "a helper that hides one of the library": (
        {
            "law.py": law("dot(1.0) + norm([3.0, 4.0])", "from frames import dot"),
            "frames.py": helper("dot", "x + norm([3.0, 4.0])"),
        },
        11.0,
    ),
    "a helper that hides it here and not there": (
        {
            "law.py": law("a(1.0) + dot(2.0)", "from frames import a" + helper("dot", "x")),
            "frames.py": helper("a", "dot([x, 2.0], [3.0, 4.0])"),
        },
        13.0,
    ),
    "a class named as a function of the library": ({"law.py": law("norm([3.0, 4.0])").replace("Law", "norm")}, 5.0),
    "a local named as its class": ({"law.py": law("1.0\n        Law = 2.0\n        self.x += Law")}, 3.0),
    "a file named by no letter of C": ({"ö-1 b.c.py": law("a(1.0) + K[1]", helper("a", "x", "K = [1.0, 2.0]"))}, 3.0),
    "a file named as a word of C": ({"int.py": law("a(1.0) + K[1]", helper("a", "x", "K = [1.0, 2.0]"))}, 3.0),
}


@pytest.mark.parametrize("name", MEETING)
def test_names_that_could_meet(name: str, tmp_path: Path) -> None:
    files, expected = MEETING[name]
    first = next(iter(files))
    twins = Twins(write_one_each(tmp_path, files, {"Law": {"source": first, "class": classes(files[first])[0]}}))
    twins.expect([({}, {"law.outputs.x": expected})])


def test_ports_of_any_name(tmp_path: Path) -> None:
    """Keywords of C, and names in generated C. Only outputs are fields of messages."""
    names = [
        "int",
        "double",
        "self",
        "NULL",
        "true",
        "restrict",
        "memcpy",
        "host",
        "fault",
        "m_int",
        "parameters_t",
        "lambda",
    ]
    text = f"""
def f(inputs: f64, outputs: f64) -> f64:
    parameters = inputs
    state = outputs
    return parameters + state


class Law:
    inputs = {{"given": "f64"}}
    outputs = {{"x": "f64"}}
    state = {dict.fromkeys([n for n in names if n != "lambda"], "f64")}

    def execute(self):
        inputs = self.given
        outputs = 2.0
        health = self.int + 1.0
        start = f(inputs, outputs)
        execute = start
{"".join(f"        self.{n} = execute + {i}.0{chr(10)}" for i, n in enumerate(names[:-1]))}
        self.x = health + self.m_int + self.self
"""
    twins = Twins(write_one_each(tmp_path, {"law.py": text}, {"Law": {"source": "law.py"}}))
    twins.expect([({"law.inputs.given": 1.0}, {"law.outputs.x": 1.0 + 12.0 + 5.0, "law.state.NULL": 6.0})])
