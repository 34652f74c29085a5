# SPDX-License-Identifier: Apache-2.0
"""Mutations of a program or machine: bytes, words, tokens, syntax tree, JSON text and JSON values."""

import ast
import copy
import io
import json
import random
import tokenize
from collections.abc import Callable, Iterator
from typing import Any

#: Pieces of syntax, and values that are too large, too small or of the wrong kind.
WORDS = """( ) [ ] { } : , . * ** // - ~ << >> & @ -> := not and or if else is in lambda: await yield del global assert
raise pass break continue return import class def while True False None 0 -1 1e400 1e-400 nan inf 2147483648 -9223372036854775808
99999999999999999999 0x1p3 1_000 1j "x" b"x" f"{u}" ... self self. self.rate self.torque self.health self.transition_request f32
i32 f64(1) zeros(2) eye(3) inv( for # "GO" "" "failed" "stale" "f64[3]" "f64[2][2]" "TransitionRequest" "Health" inputs outputs
parameters state execute start ClassVar dict[str,str] hw_write_gpio(1,True) hw_read_adc(0) hw_read_u32(7) hw_write_u32(1,2) sat_i32(
wrap_add( round( range(9) Goal(1.0)""".split()
WORDS += [
    "\n",
    "\n    ",
    "    ",
    "\t",
    "\\",
    "\f",
    "\r",
    "\x00",
    "\ud7ff",
    "θ",
    "\u202e",
    "０",
    "\n@extern\n",
    "\nfrom law import wrap\n",
    "\nclass Other:\n    def execute(self):\n        pass\n",
    "\n    def execute(self):\n",
    '\n    inputs = {"x": "f64"}\n',
    "'''",
    '"' * 3,
]
#: Statements whose execution would be detected: see test_fuzz.py.
WORDS += [
    f"\n{s}\n" for s in ("open('ran', 'w')", "__import__('os').system('touch ran')", "exec('1/0')", "raise SystemExit")
]

NUMBERS = ["0", "-1", "1", "2", "65536", "65537", "4294967296", "9" * 30, "1e308", "1e-320", "0.1", "True", "1" * 5000]

JUNK: list[Any] = [
    None,
    True,
    -1,
    0,
    1,
    3.5,
    1e300,
    10**30,
    2**63,
    "",
    "*",
    "law",
    "imu.outputs.rate",
    "imu.rate",
    "imu.health",
    "machine.dt",
    "RUN",
]
JUNK += [
    "none",
    [],
    {},
    [1, 2, 3],
    [[1]],
    {"instance": []},
    {"every": "x"},
    {"hz": 0},
    ["RUN", "RUN", 3],
    "a" * 300,
    "\x00",
]
JUNK += [
    "ä.json",
    "../x.py",
    "/etc/passwd",
    "package://",
    "f64[99999999999]",
    "f64[3] rad/s",
    "Goal[4]",
    "a.b.c.d.e",
    "\u202e",
]
KEYS = [
    "",
    "x y",
    "__",
    "int",
    "tick_hz",
    "delayed",
    "initial",
    "phase",
    "health",
    "é",
    "frozen",
    "structs",
    "targets",
    "class",
    "source",
    "$schema",
]


def mutate_bytes(data: bytes, rng: random.Random) -> bytes:
    """Overwrites, removes or inserts one to three runs of bytes."""
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(len(data) + 1)
        new = rng.randbytes(rng.randint(0, 4))
        data = data[:at] + new + data[at + rng.randrange(5) :]
    return data


def mutate_text(text: str, rng: random.Random) -> str:
    """Makes one to three edits: deletes, duplicates or swaps a word or line, or inserts a piece of syntax."""
    for _ in range(rng.randint(1, 3)):
        lines = text.split("\n")
        n = rng.randrange(len(lines))
        kind = rng.randrange(6)
        if kind == 0:
            del lines[n]
        elif kind == 1:
            lines.insert(rng.randrange(len(lines)), lines[n])
        elif kind == 2:
            m = rng.randrange(len(lines))
            lines[n], lines[m] = lines[m], lines[n]
        else:
            words = lines[n].split(" ")
            m = rng.randrange(len(words))
            if kind == 3:
                del words[m]
            elif kind == 4:
                words[m] = rng.choice(WORDS)
            else:
                words.insert(m, rng.choice([*WORDS, *text.split()]))
            lines[n] = " ".join(words)
        text = "\n".join(lines) or "\n"
    return text


def mutate_tokens(text: str, rng: random.Random) -> str:
    """Replaces one or two tokens by others of the same kind, so that most of the text still parses."""
    for _ in range(rng.randint(1, 2)):
        tokens = [t for t in _tokens(text) if t.string.strip() and t.type != tokenize.COMMENT]
        if not tokens:
            return text
        one = rng.choice(tokens)
        same = [t.string for t in tokens if t.type == one.type and t.string != one.string] or [one.string]
        new = rng.choice([*same, *NUMBERS]) if one.type == tokenize.NUMBER else rng.choice([*same, *same, *WORDS])
        lines = text.split("\n")
        (row, start), (last, end) = one.start, one.end
        if row == last and row <= len(lines):
            line = lines[row - 1]
            lines[row - 1] = line[:start] + new + line[end:]
        text = "\n".join(lines)
    return text


def _tokens(text: str) -> list[tokenize.TokenInfo]:
    found: list[tokenize.TokenInfo] = []
    try:
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            found.append(token)
    except (tokenize.TokenError, SyntaxError):
        pass  # keep the tokens before the error
    return found


_OPERATORS: tuple[type[ast.operator], ...] = (
    ast.Add,
    ast.Sub,
    ast.Mult,
    ast.Div,
    ast.FloorDiv,
    ast.Mod,
    ast.Pow,
    ast.LShift,
    ast.RShift,
    ast.BitAnd,
    ast.MatMult,
)


def mutate_tree(text: str, rng: random.Random, donor: str) -> str:
    """Replaces one to three nodes by others of this file or of `donor`, or drops, duplicates or wraps them. The result
    is valid Python."""
    try:
        tree, other = ast.parse(text), ast.parse(donor)
    except (SyntaxError, ValueError):
        return mutate_text(text, rng)
    for _ in range(rng.randint(1, 3)):
        rng.choice((_swap_expression, _swap_expression, _edit_statements, _change_operator, _wrap))(tree, other, rng)
    try:
        return ast.unparse(ast.fix_missing_locations(tree)) + "\n"
    except (AttributeError, TypeError, ValueError, RecursionError):  # the tree is not valid Python
        return mutate_text(text, rng)


def _slots(tree: ast.AST) -> Iterator[tuple[ast.expr, Callable[[ast.expr], None]]]:
    """Every expression with a function that replaces it."""
    for node in ast.walk(tree):
        for name, value in ast.iter_fields(node):
            if isinstance(value, ast.expr):
                yield value, lambda new, node=node, name=name: setattr(node, name, new)
            elif isinstance(value, list):
                for n, item in enumerate(value):
                    if isinstance(item, ast.expr):
                        yield item, lambda new, value=value, n=n: value.__setitem__(n, new)


def _swap_expression(tree: ast.Module, other: ast.Module, rng: random.Random) -> None:
    slots = list(_slots(tree))
    if slots:
        _, put = rng.choice(slots)
        put(copy.deepcopy(rng.choice([*slots, *_slots(other)])[0]))


def _edit_statements(tree: ast.Module, other: ast.Module, rng: random.Random) -> None:
    bodies = [b for n in ast.walk(tree) for b in (getattr(n, "body", None), getattr(n, "orelse", None)) if _is_body(b)]
    donors = [s for s in ast.walk(other) if isinstance(s, ast.stmt)]
    body = rng.choice(bodies)
    at = rng.randrange(len(body))
    kind = rng.randrange(4)
    if kind == 0 and len(body) > 1:
        del body[at]
    elif kind == 1:
        body.insert(at, copy.deepcopy(rng.choice(body)))
    elif kind == 2:
        body.insert(at, copy.deepcopy(rng.choice(donors or body)))
    else:
        rng.shuffle(body)


def _is_body(value: object) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], ast.stmt)


def _change_operator(tree: ast.Module, other: ast.Module, rng: random.Random) -> None:
    del other
    found = [n for n in ast.walk(tree) if isinstance(n, ast.BinOp | ast.AugAssign)]
    if found:
        rng.choice(found).op = rng.choice(_OPERATORS)()


def _wrap(tree: ast.Module, other: ast.Module, rng: random.Random) -> None:
    """x becomes f(x), x[i], (x if c else x), -x, x.y, [x], x + 1 or a comparison."""
    del other
    slots = list(_slots(tree))
    if not slots:
        return
    x, put = rng.choice(slots)
    name = rng.choice(["sin", "i32", "f32", "u64", "abs", "norm", "inv", "transpose", "sat_i32", "round", "f", "range"])
    one: ast.expr = ast.Constant(rng.choice([0, 1, -1, 2.5, True, 10**20]))
    wrapped: list[ast.expr] = [
        ast.Call(ast.Name(name), [x], []),
        ast.Call(ast.Name("min"), [x, one, x], []),
        ast.Subscript(x, one),
        ast.Subscript(x, ast.Slice(one, None, None)),
        ast.IfExp(ast.Compare(x, [ast.Lt()], [one]), x, one),
        ast.UnaryOp(rng.choice((ast.USub, ast.Not, ast.Invert))(), x),
        ast.Attribute(x, rng.choice(["x", "position", "T"])),
        ast.List([x, one]),
        ast.BinOp(x, rng.choice(_OPERATORS)(), one),
        ast.BoolOp(ast.And(), [x, x]),
        ast.Compare(one, [ast.LtE(), ast.Lt()], [x, one]),
        ast.Tuple([x, x]),
    ]
    put(rng.choice(wrapped))


def mutate_json(value: Any, rng: random.Random) -> Any:
    """Replaces, removes, renames or duplicates one or two nodes."""
    for _ in range(rng.randint(1, 2)):
        places: list[tuple[Any, Any]] = []

        def visit(node: Any, places: list[tuple[Any, Any]] = places) -> None:
            for key in list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ():
                places.append((node, key))
                visit(node[key])

        visit(value)
        if not places:
            return value
        node, key = rng.choice(places)
        other, name = rng.choice(places)
        kind = rng.randrange(6)
        if kind == 0:
            del node[key]
        elif kind == 1 and isinstance(node, dict):
            node[rng.choice([*KEYS, *(k for n, k in places if isinstance(n, dict))])] = node.pop(key)
        elif kind == 2:
            node[key] = copy.deepcopy(other[name])
        elif kind == 3 and isinstance(node, list):
            node.append(copy.deepcopy(other[name]))
        elif kind == 4 and isinstance(node[key], int | float) and not isinstance(node[key], bool):
            node[key] = rng.choice([node[key] + 1, -node[key], node[key] * 2**40, float(node[key])])
        else:
            node[key] = rng.choice(JUNK)
    return value


def mutate_json_text(text: str, rng: random.Random) -> str:
    """Removes a few characters of the file, or inserts a piece of syntax."""
    at = rng.randrange(len(text) + 1)
    inserted = rng.choice([*WORDS, '"', "{", "1", " ", "//", "NaN", "\\u0000", "'"]) if rng.random() < 0.7 else ""
    return text[:at] + inserted + text[at + rng.randrange(3) :]


def mutate_config(text: str, rng: random.Random) -> str:
    """Mutates values or text of the machine JSON."""
    if rng.random() < 0.25:
        return mutate_json_text(text, rng)
    return json.dumps(mutate_json(json.loads(text), rng), indent=rng.choice([None, 1]))


def mutate_program(text: str, rng: random.Random, donor: str) -> str:
    kind = rng.randrange(5)
    if kind == 0:
        return mutate_text(text, rng)
    return mutate_tokens(text, rng) if kind < 3 else mutate_tree(text, rng, donor)
