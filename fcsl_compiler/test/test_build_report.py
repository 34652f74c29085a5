# SPDX-License-Identifier: Apache-2.0
"""`fcsl build --report` against simulation, hand counts and compiled machines. The check `instructions` compares
bounds with executed instructions."""

import ctypes
import json
import random
import subprocess
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine as Native
from fcsl_test_abi import classes
from test_golden import golden

from fcsl_compiler.base.source import SourceFile
from fcsl_compiler.build_report import compiled_facts, report_text
from fcsl_compiler.build_report.arithmetic import binary
from fcsl_compiler.build_report.bound import Bounder
from fcsl_compiler.build_report.facts import machine_facts
from fcsl_compiler.build_report.instruction_counts import COUNTS
from fcsl_compiler.build_report.instruction_table import most
from fcsl_compiler.build_report.levelling import MOST_TICKS, levelled, load_per_tick
from fcsl_compiler.build_report.objects import NotReadable, read_object
from fcsl_compiler.build_report.paths import Unbounded
from fcsl_compiler.build_report.schedule_facts import MOST_SLOTS, NEVER, latency, major_cycle, slots
from fcsl_compiler.build_report.semantics import Decoder
from fcsl_compiler.build_report.values import Flags, State, decide, greatest, minus, number, part, plus
from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.library import build_library
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.driver.toolchain import compile_objects
from fcsl_compiler.emit.operations import operations
from fcsl_compiler.model.machine import Entry

LANDER = Path(__file__).parents[2] / "examples/lander/fc/lander_control.json"
SPAN = SourceFile("none", "\n").whole()
DIVISORS = (1, 2, 3, 4, 5, 6, 10, 12, 15)


def entry(rng: random.Random, instance: int = 0) -> Entry:
    divisor = rng.choice(DIVISORS)
    return Entry(instance, divisor, rng.randrange(divisor), SPAN)


def simulated(source: Entry, target: Entry, delayed: bool) -> tuple[int, int]:
    """Minimum and maximum age of the value that `target` uses, from the rules of the tick, after both have run."""
    ages, computed = [], None
    for tick in range(6 * major_cycle([source, target])):
        yesterday = computed
        if tick % source.divisor == source.phase:
            computed = tick
        used = yesterday if delayed else computed
        if tick % target.divisor == target.phase and used is not None:
            ages.append(tick - used)
    return min(ages), max(ages)


def test_latency_is_that_of_a_simulated_schedule() -> None:
    rng = random.Random(5)
    for _ in range(400):
        source, target, delayed = entry(rng), entry(rng, 1), rng.random() < 0.5
        found = latency(source, target, delayed)
        assert (found.least, found.most) == simulated(source, target, delayed), (source, target, delayed)


def test_slots_are_what_is_due_at_every_tick() -> None:
    rng = random.Random(6)
    for _ in range(100):
        entries = [entry(rng, n) for n in range(rng.randrange(6))]
        cycle, found = major_cycle(entries), slots(entries)
        assert found is not None and sum(s.ticks for s in found) == cycle
        for tick in range(cycle):
            due = tuple(n for n, e in enumerate(entries) if tick % e.divisor == e.phase)
            assert [s for s in found if s.due == due and s.first <= tick], (tick, due)
        assert all(tuple(n for n, e in enumerate(entries) if s.first % e.divisor == e.phase) == s.due for s in found)


def test_slots_of_a_cycle_too_long_to_go_through() -> None:
    """Prime periods coincide as the Chinese remainder theorem predicts."""
    entries = [Entry(n, d, d - 1, SPAN) for n, d in enumerate((997, 991, 2, 1))]
    found = slots(entries)
    assert major_cycle(entries) > MOST_TICKS and found is not None and levelled(entries, [1] * 4) is None
    assert {s.due for s in found} == {(*a, *b, *c, 3) for a in ((), (0,)) for b in ((), (1,)) for c in ((), (2,))}
    assert (
        sum(s.ticks for s in found) == major_cycle(entries)
        and next(s for s in found if len(s.due) == 4).first == 2 * 997 * 991 - 1
    )
    assert all(tuple(n for n, e in enumerate(entries) if s.first % e.divisor == e.phase) == s.due for s in found)


def test_slots_that_never_come_or_are_too_many() -> None:
    primes = (1000003, 1000033, 1000037, 1000039)
    found = slots([Entry(n, d, 1, SPAN) for n, d in enumerate(primes)])
    assert found is not None and len(found) == 16 and min(s.first for s in found if len(s.due) == 4) == 1
    found = slots([Entry(n, d, n, SPAN) for n, d in enumerate(primes)])
    assert found is not None and max(s.first for s in found) < NEVER and (0, 1, 2, 3) not in {s.due for s in found}
    many = [Entry(n, d, 0, SPAN) for n, d in enumerate((2, 3, 5, 7, 11, 13, 17, 19, 23))]
    assert 2 ** len(many) > MOST_SLOTS and slots(many) is None


def test_levelling_never_worsens_the_peak() -> None:
    rng = random.Random(7)
    gained = 0
    for _ in range(300):
        entries = [entry(rng, n) for n in range(1, rng.randrange(2, 7))]
        costs = [rng.randrange(1, 500) for _ in entries]
        better = levelled(entries, costs)
        if better is not None:
            gained += 1
            assert max(load_per_tick(better, costs)) <= 0.9 * max(load_per_tick(entries, costs))
            assert [(e.instance, e.divisor) for e in better] == [(e.instance, e.divisor) for e in entries]
            assert all(0 <= e.phase < e.divisor for e in better)
    assert gained > 50


def test_levelling_finds_what_is_there() -> None:
    """Four equal loads in a quarter of the ticks: one per tick. No change if they are already distributed."""
    entries = [Entry(n, 4, 0, SPAN) for n in range(4)]
    better = levelled(entries, [10] * 4)
    assert better is not None and sorted(e.phase for e in better) == [0, 1, 2, 3]
    assert levelled(better, [10] * 4) is None


def test_levelling_for_a_tiny_gain_is_not_proposed() -> None:
    entries = [Entry(n, d, 0, SPAN) for n, d in enumerate((1, 2, 2))]
    assert levelled(entries, [100, 6, 7]) is None
    assert levelled(entries, [100, 15, 15]) is not None


# ---- operations ----------------------------------------------------------------------------------------------------

PORTS = """
class One:
    inputs = {"a": "f64[3]", "m": "f64[2][3]", "n": "i64"}
    outputs = {"y": "f64", "v": "f64[3]"}
"""


def counted(tmp_path: Path, body: str, before: str = "") -> dict[str, int]:
    text = before + PORTS + "    def execute(self):\n" + "".join(f"        {s}\n" for s in body.split("\n"))
    config = write_machine(tmp_path, {"one": text}, {"one": 100})
    lowered = compile_machine(config, "", until="lower").lowered
    assert lowered is not None
    return {k: n for k, n in operations(lowered.instances[0].execute, lowered.program).items() if n}


def write_machine(folder: Path, algorithms: dict[str, str], schedule: dict[str, Any], **more: Any) -> Path:
    """One instance of each algorithm, with its name. Each file contains one class."""
    definitions = {}
    for name, text in algorithms.items():
        (folder / f"{name}.py").write_text(text)
        (algorithm,) = classes(text)
        definitions[name] = {"source": f"{name}.py", "class": algorithm}
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": definitions,
        "instances": {name: {"algorithm": name} for name in algorithms},
        "states": {"RUN": {"schedule": schedule}},
        "transitions": [],
        **more,
    }
    path = folder / "m.json"
    path.write_text(json.dumps(config))
    return path


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("self.y = self.a[0] * self.a[1] + self.a[2]", {"load": 3, "multiply": 1, "add": 1, "store": 1}),
        ("self.y = sin(self.a[0]) / sqrt(self.a[1])", {"load": 2, "sin": 1, "sqrt": 1, "divide": 1, "store": 1}),
        ("self.v = self.a * 2.0", {"load": 3, "multiply": 3, "store": 3}),
        ("if self.a[0] > 1.0:\n    self.y = self.a[1] + 1.0 + 2.0\nelse:\n    self.y = self.a[1] * 3.0",
         {"load": 2, "compare": 1, "branch": 1, "add": 2, "multiply": 1, "store": 1}),
        ("s = 0.0\nfor i in range(2):\n    for j in range(3):\n        s = s + self.m[i, j]\nself.y = s",
         {"load": 6, "add": 6, "store": 1}),
        ("s = 0.0\nfor i in range(3):\n    for j in range(i, 3):\n        s = s + self.a[j]\nself.y = s",
         {"load": 6, "add": 6, "store": 1}),
        ("self.y = clamp(self.a[0], -1.0, 1.0) ** 3", {"load": 1, "compare": 2, "multiply": 2, "store": 1}),
    ],
)  # fmt: skip
def test_operations_as_counted_by_hand(tmp_path: Path, body: str, expected: dict[str, int]) -> None:
    assert counted(tmp_path, body) == expected


def test_operations_of_a_called_function_count(tmp_path: Path) -> None:
    helper = "def twice(x: f64) -> f64:\n    return x + x\n"
    found = counted(tmp_path, "self.y = twice(self.a[0]) * twice(self.a[1])", helper)
    assert found == {"load": 2, "add": 2, "multiply": 1, "store": 1}


def test_products_that_structural_zeros_leave_out_do_not_count(tmp_path: Path) -> None:
    text = """class One:
    inputs = {"x": "f64[2]"}
    parameters = {"m": "f64[2][2]"}
    outputs = {"y": "f64[2]"}
    def execute(self):
        self.y = matvec(self.m, self.x)
"""
    found = []
    for frozen in ([], ["m"]):
        instance = {"algorithm": "one", "parameters": {"m": [[2.0, 3.0], [0.0, 5.0]]}, "frozen": frozen}
        config = write_machine(tmp_path, {"one": text}, {"one": 100}, instances={"one": instance})
        machine = compile_machine(config, "").lowered
        assert machine is not None
        counts = operations(machine.instances[0].execute, machine.program)
        found.append((counts["multiply"], counts["add"]))
    assert found == [(4, 2), (3, 1)]


def test_operations_with_structural_zeros_do_not_count(tmp_path: Path) -> None:
    constants = 'B: "f64[3]" = [0.0, 2.0, 0.5]\nM: "f64[2][3]" = [[3.0, 0.0, 2.0], [0.0, 1.0, 0.0]]\n'
    assert counted(tmp_path, "self.v = self.a + B", constants) == {"load": 3, "add": 2, "store": 3}
    found = counted(tmp_path, "r = matvec(M, self.a)\nself.y = r[0]", constants)
    # Three elements of a, two of the result for the return, one of r; the result twice, and y.
    assert found == {"load": 6, "multiply": 2, "add": 1, "store": 5}


# ---- machine code --------------------------------------------------------------------------------------------------


def bound_of(tmp_path: Path, text: str, function: str) -> int:
    source = tmp_path / "c.c"
    source.write_text("#include <stdint.h>\n" + text)
    code = read_object(compile_objects([source], [], tmp_path / "o")[0])
    return Bounder(code, price=most).of(function).instructions


def test_a_loop_of_twice_the_turns_has_twice_the_bound(tmp_path: Path) -> None:
    loop = "double f(double *a) {{ double s = 0; for (int i = 0; i < {}; i++) s = s * 0.5 + a[i]; return s; }}"
    few, many = (bound_of(tmp_path, loop.format(n), "f") for n in (1000, 2000))
    assert few >= 2000 and 1.9 < many / few < 2.1


def test_a_triangular_loop_is_counted_turn_by_turn(tmp_path: Path) -> None:
    text = """double f(double *a) { double s = 0; for (int i = 0; i < 40; i++) for (int j = i; j < 40; j++) {
        s = s * 0.5 + a[j]; __asm__ volatile("nop; nop; nop; nop; nop; nop; nop; nop; nop; nop; nop; nop"); } return s; }"""
    turns = 40 * 41 // 2
    assert 14 * turns < bound_of(tmp_path, text, "f") < 22 * turns


def test_a_loop_entered_in_its_middle_is_counted_turn_by_turn(tmp_path: Path) -> None:
    """gcc duplicates a loop body and removes from one copy the parts that only the first iteration needs not test. All
    iterations pass `mov %rcx`."""
    text = """__asm__(".text; .globl f; .type f,@function; f: mov $9,%edx; test %edi,%edi; js 3f;"
        "1: nop; 2: lea -1(%rdx),%rcx; test %rdx,%rdx; je 5f; 6: mov %rcx,%rdx; test %esi,%esi; jns 1b;"
        "3: test %r8d,%r8d; je 4f; cmp %r9d,%edi; jne 2b;"
        "4: lea -1(%rdx),%rcx; test %rdx,%rdx; je 5f; jmp 6b; 5: ret");"""
    bound = bound_of(tmp_path, text, "f")
    assert 3 + 9 * 11 < bound < 3 + 10 * 13


@pytest.mark.parametrize("size", [296, 301, 4099])
def test_string_instructions_from_the_next_multiple_of_8_on_are_counted(tmp_path: Path, size: int) -> None:
    """After the first bytes, at an address of any alignment, gcc's `rep movsq` and `rep stosq` do the rest."""
    text = f"""#include <string.h>
        void copy(char *to, const char *from) {{ memcpy(to, from, {size}); }}
        void clear(char *to) {{ memset(to, 0, {size}); }}
        void later(char *to, const char *from, int some) {{ if (some) to[3] = 1; else memset(to + 5, 0, {size});
            memcpy(to + 3, from, {size}); memcpy(to + {size} + 8, from, {size}); }}"""
    for function, times in (("copy", 1), ("clear", 1), ("later", 3)):
        turns = size // 8 * times
        assert turns - 2 * times <= bound_of(tmp_path, text, function) <= turns + 30 * times, function


@pytest.mark.parametrize(
    ("instruction", "register", "is_known"),
    [("movsb", "esi", False), ("stosb", "esi", True), ("movsb", "edi", False), ("stosb", "edi", False)]
    + [(name, "ecx", False) for name in ("movsb", "stosb")],
)
def test_a_string_instruction_changes_its_registers(
    instruction: str, register: str, is_known: bool, tmp_path: Path
) -> None:
    """A loop of as many turns as its register says: 10 before the instruction. Of the count 0 are left, which are 2^32 turns."""
    text = f"""__asm__(".text; .globl f; .type f,@function; f: mov $10,%esi; mov $10,%edi; mov $10,%ecx;"
        "rep {instruction}; 1: dec %{register}; jne 1b; ret");"""
    if is_known:
        assert 20 < bound_of(tmp_path, text, "f") < 60
    else:
        with pytest.raises(Unbounded):
            bound_of(tmp_path, text, "f")


def test_a_count_that_depends_on_an_address_is_known_up_to_a_step() -> None:
    """(address - multiple of 8 + size) / 8, in 32 bits: one number or two, by the size."""
    for size, least, last in ((160, 19, 19), (163, 19, 20)):
        start = ("rcx", 0x20)
        multiple = binary("and", plus(start, number(8)), number(-8), 64)
        rest = minus(part(start, 32), part(multiple, 32), 32)
        count = binary("shr", plus(rest, number(size), 32), number(3), 32)
        assert count is not None and (count[1], greatest(count)) == (least, last)
        assert minus(count, count) == number(0)
        assert decide("e", Flags(count, number(19), 32)) is (True if least == last else None)


def test_given_iteration_limits_bound_a_loop_over_data(tmp_path: Path) -> None:
    """A binary search. The bound uses the given iteration limit, independent of how gcc jumps to the function."""
    text = """double s(const double *t, int n, double x) { int a = 0; while (a + 1 < n) { int m = (a + n) / 2; if (t[m] <= x) a = m; else n = m;
        __asm__ volatile("nop; nop; nop; nop; nop; nop; nop; nop; nop; nop"); } return t[a]; }
        double f(const double *t, double x) { return s(t, 1000, x); }"""
    source = tmp_path / "c.c"
    source.write_text(text)
    code = read_object(compile_objects([source], [], tmp_path / "o")[0])
    with pytest.raises(Unbounded, match="has no bound that the analysis can prove"):
        Bounder(code).of("s")
    few, many = (Bounder(code, turns={"s": (("nop", n),)}).of("s").instructions for n in (10, 20))
    assert 10 * 12 < few < 10 * 30 and 1.8 < many / few < 2.1
    with pytest.raises(Unbounded):
        Bounder(code, turns={"s": (("sqrtsd", 10),)}).of("s")


def test_a_missing_bound_is_reported(tmp_path: Path) -> None:
    with pytest.raises(Unbounded, match="has no bound that the analysis can prove"):
        bound_of(
            tmp_path,
            "int f(int n) { while (n != 1) n = n & 1 ? 3 * n + 1 : n / 2; return n; }",
            "f",
        )
    with pytest.raises(Unbounded, match="itself"):
        bound_of(
            tmp_path, "__attribute__((noinline)) long f(long n) { return n < 2 ? 1 : f(n - 1) * f(n / 2) + n; }", "f"
        )
    with pytest.raises(Unbounded, match="the number of instructions of `strtod` is unknown"):
        bound_of(tmp_path, "double strtod(const char *, char **); double f(char *a) { return strtod(a, 0) + 1; }", "f")
    with pytest.raises(NotReadable, match="cannot read|x86-64"):
        read_object(tmp_path / "c.c")


def test_a_store_to_an_array_forgets_it_and_keeps_what_the_compiler_put_away() -> None:
    s = State()
    s.store(("rsp", -64), 8, number(7))
    s.escape(("rsp", -48))
    s.store(("rsp", -48), 8, number(9))
    s.forget()
    assert s.load(("rsp", -64), 8) == number(7) and s.load(("rsp", -48), 8) is None


@pytest.mark.parametrize("bits", [8, 32, 64])
def test_conditions_are_those_of_the_processor(bits: int) -> None:
    """Compared with signed and unsigned comparisons of Python integers."""
    rng = random.Random(bits)
    half = 1 << (bits - 1)
    for _ in range(500):
        a, b = (rng.choice([0, 1, half - 1, half, 2 * half - 1, rng.randrange(2 * half)]) for _ in range(2))
        flags = Flags(number(a), number(b), bits)
        sa, sb = (v - 2 * half if v >= half else v for v in (a, b))
        expected = {"e": a == b, "b": a < b, "be": a <= b, "l": sa < sb, "le": sa <= sb}
        expected |= {"ne": a != b, "ae": a >= b, "a": a > b, "ge": sa >= sb, "g": sa > sb}
        assert {c: decide(c, flags) for c in expected} == expected
    assert decide("e", None) is None and plus(("rdi", 8), number(-8)) == ("rdi", 0)


#: Targets by size in bytes, and second operands.
_TARGETS = {1: ("%al", "%cl"), 2: ("%ax", "%cx"), 4: ("%eax", "%ecx"), 8: ("%rax", "%rcx")}
_SIGNS = ("e", "ne", "s", "ns")
_ORDER = ("b", "ae", "be", "a", "l", "ge", "le", "g")
_ASKED = (*_SIGNS, *_ORDER, "o", "no", "p", "np")
#: Instruction, sizes, and the conditions that are known after it where its operands are.
_WIDE, _ALL = (4, 8), (1, 2, 4, 8)
_INSTRUCTIONS: list[tuple[str, tuple[int, ...], tuple[str, ...]]] = [
    ("cmp {b},{a}", _ALL, _SIGNS + _ORDER),
    ("sub {b},{a}", _ALL, _SIGNS + _ORDER),
    *((f"{name} {{b}},{{a}}", _ALL, _SIGNS + _ORDER) for name in ("test", "and", "or", "xor")),
    ("add {b},{a}", _ALL, _SIGNS),
    *((f"{name} {{a}}", _ALL, _SIGNS) for name in ("inc", "dec", "neg")),
    *((f"{name} %cl,{{a}}", _WIDE, ()) for name in ("shl", "shr", "sar", "rol", "ror")),
    *((f"{name} {{a}}", _WIDE, ()) for name in ("shl", "shr", "sar")),
    ("imul {b},{a}", _WIDE, ()),
    ("imul $-7,{b},{a}", _WIDE, ()),
    ("mul {b}", _WIDE, ()),
    ("imul {b}", _WIDE, ()),
    # Those that leave the flags alone: the comparison before them counts.
    ("not {a}", _ALL, _SIGNS + _ORDER),
    *((f"cmov{c} {{b}},{{a}}", _WIDE, _SIGNS + _ORDER) for c in ("e", "ne", "b", "g", "s")),
    *((f"{move} %cl,{{a}}", _WIDE, _SIGNS + _ORDER) for move in ("movzb", "movsb")),
    ("lea -9(%rax,%rcx,4),{a}", _WIDE, _SIGNS + _ORDER),
    ("cltq", (8,), _SIGNS + _ORDER),
    ("cltd", (4,), _SIGNS + _ORDER),
    ("cqto", (8,), _SIGNS + _ORDER),
]


def test_instructions_are_those_of_the_processor(tmp_path: Path) -> None:
    """Known values and conditions after an instruction, compared with the processor that executes it: rax, rdx, and every
    condition as `set` stores it. Where nothing is known nothing is compared, so what must be known is listed."""
    edges = [0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFFFFFF, 1 << 31, (1 << 32) - 1, (1 << 63) - 1, 1 << 63, (1 << 64) - 1]
    rng = random.Random(3)
    cases: list[tuple[str, int, tuple[str, ...]]] = []
    text = []
    for words, sizes, known in _INSTRUCTIONS:
        for size in sizes:
            for turn in range(12):
                a, b = (rng.choice([*edges, rng.getrandbits(64)]) for _ in range(2))
                target, other = _TARGETS[size]
                shown = words.format(a=target, b=target if turn % 4 == 3 else other)
                cases.append((f"{shown} of {a:#x}, {b:#x}", size, known))
                stores = "".join(f"set{c} {16 + n}(%rdi);" for n, c in enumerate(_ASKED))
                text.append(
                    f"f{len(cases) - 1}: movabs ${a:#x},%rax; movabs ${b:#x},%rcx; mov $5,%edx; cmp $3,%rcx; {shown};"
                    f" mov %rax,(%rdi); mov %rdx,8(%rdi); {stores} ret\n"
                )
    source = tmp_path / "c.s"
    symbols = "".join(f".globl f{n}\n.type f{n},@function\n" for n in range(len(cases)))
    source.write_text(".text\n" + symbols + "".join(text) + '.section .note.GNU-stack,"",@progbits\n')
    subprocess.run(["cc", "-shared", "-o", tmp_path / "c.so", source], check=True)
    subprocess.run(["cc", "-c", "-o", tmp_path / "c.o", source], check=True)
    code, library = read_object(tmp_path / "c.o"), ctypes.CDLL(str(tmp_path / "c.so"))
    decoder = Decoder(code)
    for n, (name, size, known) in enumerate(cases):
        state, at = State(), code.functions[f"f{n}"]
        while (i := code.instructions[at]).mnemonic != "ret":
            effect = decoder.effect(i)
            if effect is not None:
                effect(state)
            at = (at[0], at[1] + i.length)
        out = ctypes.create_string_buffer(16 + len(_ASKED))
        library[f"f{n}"](out)
        for offset in (0, 8):
            value = state.load(("rdi", offset), 8)
            assert value is not None or size < 4, f"{name}: byte {offset} is unknown"
            assert value in (None, number(int.from_bytes(out.raw[offset : offset + 8], "little"))), (name, offset)
        for place, condition in enumerate(_ASKED, 16):
            value = state.load(("rdi", place), 1)
            assert value is not None or condition not in known, f"{name}: {condition} is unknown"
            assert value in (None, number(out.raw[place])), (name, condition)


@pytest.mark.parametrize(
    ("before", "turns"),
    [
        ("cmp $7,%edi; jne 9f", 7),
        ("cmpl $7,%edi; je 1f; ret", 7),
        ("cmp $7,%rdi; jne 9f", 7),
        ("test %edi,%edi; jne 9f; add $4,%edi", 4),
        ("sub $3,%edi; jne 9f; add $4,%edi", 4),
        ("and $12,%edi; jne 9f; add $4,%edi", 4),
        ("dec %edi; jne 9f; add $4,%edi", 4),
        ("cmp $7,%edi; mov %edi,%esi; jne 9f", 7),
        ("xor %eax,%eax; cmp %rsi,%rdx; sete %al; jne 9f; lea 3(%rax),%edi", 4),
        ("xor %eax,%eax; cmp %rsi,%rdx; setl %al; jge 9f; lea 3(%rax),%edi", 4),
        ("xor %eax,%eax; cmp %rsi,%rdx; setge %al; jl 9f; lea 3(%rax),%edi", 4),
        ("xor %eax,%eax; cmp %rsi,%rdx; setge %al; jge 9f; lea 3(%rax),%edi", 3),
    ],
)
def test_a_count_that_a_condition_implies_bounds_a_loop(tmp_path: Path, before: str, turns: int) -> None:
    """gcc uses a register that it has just compared as the number."""
    bound = bound_of(
        tmp_path, f'__asm__(".globl f; .type f,@function; f: {before}; 1: dec %edi; jne 1b; 9: ret");', "f"
    )
    assert bound - 2 * turns - 1 == sum(not word.strip().startswith("ret") for word in before.split(";"))


@pytest.mark.parametrize(
    "before",
    [
        "cmp $7,%edi; je 9f",  # any other
        "cmp $7,%edi; jle 9f",
        "test $7,%edi; jne 9f",  # some bits
        "test %esi,%edi; jne 9f",
        "cmp %esi,%edi; jne 9f",
        "cmp $7,%edi; mov (%rsi),%edi; jne 9f",  # changed since
        "imul %esi,%edi; jne 9f",
    ],
)
def test_a_condition_that_implies_no_count_bounds_nothing(tmp_path: Path, before: str) -> None:
    with pytest.raises(Unbounded, match="has no bound"):
        bound_of(
            tmp_path,
            f'__asm__(".globl f; .type f,@function; f: mov (%r8),%edi; {before}; 1: dec %edi; jne 1b; 9: ret");',
            "f",
        )


# ---- the report ----------------------------------------------------------------------------------------------------


def test_latency_is_that_of_the_compiled_machine(tmp_path: Path) -> None:
    """A source writes the tick as its value; the reader records the minimum and maximum age."""
    source = (
        'class Source:\n    inputs = {"t": "u64"}\n    outputs = {"at": "u64"}\n'
        "    def execute(self):\n        self.at = self.t + 1\n"
    )
    reader = (
        'class Reader:\n    inputs = {"t": "u64", "at": "u64"}\n    outputs = {"least": "u64", "most": "u64"}\n'
        "    def start(self):\n        self.least = 1000\n"
        "    def execute(self):\n        if self.at > 0:\n            age = self.t + 1 - self.at\n"
        "            self.least = min(self.least, age)\n            self.most = max(self.most, age)\n"
    )
    rng = random.Random(8)
    for n in range(3):
        folder = tmp_path / str(n)
        folder.mkdir()
        schedule = {}
        for name in ("source", "reader"):
            divisor = rng.choice((1, 2, 4, 5, 10))
            schedule[name] = {"every": divisor, "phase": rng.randrange(divisor)}
        wire: dict[str, Any] = {"from": "source.at", "to": "reader.at"}
        wire |= {"delayed": True, "initial": 0} if n % 2 else {}
        ticks = [{"from": "machine.tick", "to": f"{i}.t"} for i in schedule]
        config = write_machine(folder, {"source": source, "reader": reader}, schedule, connections=[wire, *ticks])
        facts = facts_of(config, folder / "out")
        machine = Native(folder / "out" / "libm.so", "m")
        for _ in range(100):
            machine.step()
        found = next(c for c in facts["states"][0]["connections"] if c["to"] == "reader.at")
        assert found["latency_ticks"] == [machine.get("reader.outputs.least"), machine.get("reader.outputs.most")]


def facts_of(config: Path, folder: Path) -> dict[str, Any]:
    found: list[dict[str, Any]] = []
    folder.mkdir()
    build_library(
        [config], folder / f"lib{config.stem}.so", inspect=lambda *built: found.append(compiled_facts(*built))
    )
    return found[0]


def test_golden(tmp_path: Path) -> None:
    """All facts of the lander that do not depend on the C compiler. Facts that do are present and consistent."""
    facts = facts_of(LANDER, tmp_path / "out")
    compiled = ("stack_bytes", "struct_bytes", "code_bytes", "constant_bytes", "descriptor_bytes")
    assert all(facts[key] > 0 for key in compiled) and not facts["why_no_code"]
    assert sum(i["record_bytes"] for i in facts["instances"]) < facts["struct_bytes"]
    for state in facts["states"]:
        loads = [slot["load"] for slot in state["slots"]]
        assert state["own_instructions"] == state["instructions"] >= max(loads) - 40
    stable = machine_facts(compile_machine(LANDER, "", until="schedule").checked, None, None, "not looked at")
    golden("lander.report.json", json.dumps(stable, indent=1) + "\n")
    assert shape(stable) == shape(facts)
    assert report_text(facts).startswith("== lander_control, 100 Hz\nstack of a step: ")
    golden("lander.report.txt", report_text(stable))


def shape(facts: Any) -> Any:
    """The schema: keys, without the values that depend on compilation."""
    if isinstance(facts, dict):
        return {k: shape(v) for k, v in facts.items()}
    return [shape(v) for v in facts] if isinstance(facts, list) and facts and isinstance(facts[0], dict) else None


@pytest.mark.parametrize("states", [6, 9])
def test_a_kalman_filter_has_a_bound(tmp_path: Path, states: int) -> None:
    text = f"""class Filter:
    inputs = {{"z": "f64[3]", "f": "f64[{states}][{states}]", "h": "f64[3][{states}]"}}
    outputs = {{"x": "f64[{states}]"}}
    state = {{"p": "f64[{states}][{states}]"}}

    def start(self):
        self.p = eye({states})

    def execute(self):
        self.x = kf_predict_state(self.f, self.x)
        self.p = kf_predict_cov(self.f, self.p, 0.001 * eye({states}))
        k = kf_gain(self.p, self.h, 0.1 * eye(3))
        self.x = kf_update_state(self.x, k, self.z, self.h)
        self.p = kf_update_cov_joseph(self.p, k, self.h, 0.1 * eye(3))
"""
    facts = facts_of(write_machine(tmp_path, {"filter": text}, {"filter": 100}), tmp_path / "out")
    assert facts["instances"][0]["own_instructions"] > states**3 and not facts["instances"][0]["why_no_bound"]
    assert facts["states"][0]["own_instructions"] > states**3 and not facts["states"][0]["why_no_bound"]


@pytest.mark.parametrize("example", ["inverted_pendulum", "satellite"])  # `make verify` bounds every example
def test_examples_have_bounds(tmp_path: Path, example: str) -> None:
    facts = facts_of(LANDER.parents[2] / example / "fc" / f"{example}.json", tmp_path / "out")
    assert [i["name"] for i in facts["instances"] + facts["states"] if i["why_no_bound"]] == []


def test_a_tick_of_few_costs_less_than_one_of_many(tmp_path: Path) -> None:
    """The bound of a tick depends on the due instances, from the code of step. Levelling phases are suggested."""
    text = (
        'class Chain:\n    state = {"s": "f64[30]"}\n    def execute(self):\n'
        "        for i in range(29):\n            self.s[i + 1] = self.s[i] * 0.5 + 1.0\n"
    )
    schedule = {"a": 100, "b": {"every": 2}, "c": {"every": 4}, "d": {"every": 4}}
    facts = facts_of(write_machine(tmp_path, dict.fromkeys(schedule, text), schedule), tmp_path / "out")
    state = facts["states"][0]
    by_due = {len(slot["due"]): slot for slot in state["slots"]}
    bounds = [by_due[n]["own_instructions"] for n in (1, 2, 4)]
    each = facts["instances"][0]["own_instructions"]
    assert bounds[0] < bounds[1] < bounds[2] == state["own_instructions"]
    assert bounds[2] - bounds[0] > 2.5 * each and [by_due[n]["load"] for n in (1, 2, 4)] == [each, 2 * each, 4 * each]
    assert state["levelling"]["peak_before"] == 4 * each and state["levelling"]["peak_after"] == 2 * each


DECAY = 'class Decay:\n    outputs = {"y": "f64"}\n    def execute(self):\n        self.y = self.y * 0.5 + 1.0\n'


def test_a_cycle_too_long_to_go_through_has_a_bound(tmp_path: Path) -> None:
    schedule = {"a": 100, "b": {"every": 997}, "c": {"every": 991}}
    state = facts_of(write_machine(tmp_path, dict.fromkeys(schedule, DECAY), schedule), tmp_path / "out")["states"][0]
    assert len(state["slots"]) == 4 and not state["why_no_slots"]
    together, alone = (next(s for s in state["slots"] if len(s["due"]) == n)["own_instructions"] for n in (3, 1))
    assert state["own_instructions"] == together > alone


def test_more_sets_than_are_listed_have_the_bound_of_everything_due(tmp_path: Path) -> None:
    schedule = {f"i{n}": {"every": d} for n, d in enumerate((2, 3, 5, 7, 11, 13, 17, 19, 23))}
    facts = facts_of(write_machine(tmp_path, dict.fromkeys(schedule, DECAY), schedule), tmp_path / "out")
    state = facts["states"][0]
    assert state["slots"] is None and "256 sets" in state["why_no_slots"]
    assert state["own_instructions"] > sum(i["own_instructions"] for i in facts["instances"])
    assert "the bound assumes that all instances are due" in report_text(facts)


def test_math_calls_say_what_they_take_and_which_are_estimates(tmp_path: Path) -> None:
    head = PORTS + "    def execute(self):\n        self.y = "
    algorithms = {"wave": head + "sin(self.a[0])\n", "rest": head + "self.a[0] % self.a[1]\n"}
    config = write_machine(tmp_path, algorithms, {"wave": 100, "rest": 50}, states={
        "RUN": {"schedule": {"wave": 100, "rest": 50}}, "WAVE": {"schedule": {"wave": 100}},
    })  # fmt: skip
    facts = facts_of(config, tmp_path / "out")
    assert {f["function"]: f["estimate"] for f in facts["math"]} == {"fmod": True, "sin": False}
    wave = facts["instances"][0]
    assert wave["math"] == ["sin"] and wave["instructions"] - wave["own_instructions"] == COUNTS["cr_sin"].most
    assert wave["usual_instructions"] - wave["own_instructions"] == COUNTS["cr_sin"].usual
    lines = report_text(facts).splitlines()
    assert next(line for line in lines if line.startswith("fmod")).endswith("estimate: not proven")
    assert not next(line for line in lines if line.startswith("sin")).endswith("estimate: not proven")
    run, other = (next(line for line in lines if line.startswith(f"state {name}:")) for name in ("RUN", "WAVE"))
    assert "(an estimate, for fmod)" in run and "estimate" not in other


def test_what_depends_on_the_tick_is_bounded_for_every_tick(tmp_path: Path) -> None:
    """A loop that runs from tick 1000 on counts in every tick, and so does one that starts after some seconds."""
    for source, kind, late in (("tick", "u64", "u64(1000)"), ("time_ns", "i64", "5000000000")):
        folder = tmp_path / source
        folder.mkdir()
        text = (
            f'class Late:\n    inputs = {{"t": "{kind}", "x": "f64[100]"}}\n    outputs = {{"y": "f64"}}\n'
            f"    def execute(self):\n        s = 0.0\n        if self.t > {late}:\n"
            "            for i in range(100):\n                s = s * 0.5 + self.x[i]\n        self.y = s\n"
        )
        wire = {"from": f"machine.{source}", "to": "a.t"}
        # At 1 Hz the time is a constant multiple of the tick.
        facts = facts_of(write_machine(folder, {"a": text}, {"a": 1}, connections=[wire], tick_hz=1), folder / "out")
        assert facts["states"][0]["own_instructions"] > facts["instances"][0]["own_instructions"] > 300


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = write_machine(tmp_path, {"one": PORTS + "    def execute(self):\n        self.y = 1.0\n"}, {"one": 100})
    out = str(tmp_path / "out")
    assert main(["build", str(config), "-o", out, "--report"]) == 0
    printed = capsys.readouterr().out
    assert (
        "state RUN: a tick takes at most" in printed and printed.count("of a step") + printed.count("a step needs") == 1
    )
    assert main(["build", str(config), "-o", out, "--report", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)["report"]
    assert (document["kind"], document["version"]) == ("fcsl build report", 1) and len(document["machines"]) == 1
    for wrong in (
        ["--report", "--c-only"],
        ["--report", "--dump", "verify"],
        ["--report", "--sarif"],
    ):
        assert main(["build", str(config), "-o", out, *wrong]) == 2, wrong
        assert "--report" in capsys.readouterr().err


def test_without_objdump_the_report_says_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OBJDUMP", "no-such-objdump")
    facts = facts_of(LANDER, tmp_path / "out")
    assert facts["struct_bytes"] is None and "install binutils" in facts["why_no_code"]
    assert "install binutils" in report_text(facts) and facts["states"][0]["connections"]


def test_the_row_of_a_part_has_the_sums_of_its_instances(tmp_path: Path) -> None:
    """Parts in parts, too. What an instance does not know, the part does not know either."""
    leaf = {"tick_hz": 10, "initial_state": "A", "algorithms": {"Law": {"source": "law.py"}}}
    leaf |= {"instances": {"one": {"algorithm": "Law"}, "two": {"algorithm": "Law"}}}
    leaf |= {"states": {"A": {"schedule": {"one": 10, "two": 10}}}}
    inner = {"tick_hz": 10, "initial_state": "A", "algorithms": {"Law": {"source": "law.py"}}}
    inner |= {"instances": {"own": {"algorithm": "Law"}, "leaf": {"machine": "leaf.json"}}}
    inner |= {"states": {"A": {"schedule": {"own": 10, "leaf": True}}}}
    outer = {"tick_hz": 10, "initial_state": "A", "algorithms": {"Law": {"source": "law.py"}}}
    outer |= {"instances": {"alone": {"algorithm": "Law"}, "part": {"machine": "inner.json"}}}
    outer |= {"states": {"A": {"schedule": {"alone": 10, "part": True}}}}
    for name, machine in (("leaf", leaf), ("inner", inner), ("outer", outer)):
        (tmp_path / f"{name}.json").write_text(json.dumps(machine))
    (tmp_path / "law.py").write_text(
        'from fcsl_builtins import sin\n\n\nclass Law:\n    inputs = {"u": "f64"}\n    outputs = {"y": "f64"}\n\n'
        "    def execute(self):\n        self.y = sin(self.u) * 2.0\n"
    )
    facts = facts_of(tmp_path / "outer.json", tmp_path / "build")
    lines = report_text(facts).splitlines()
    rows = {line.split("  ")[0]: line for line in lines if line.startswith(("alone", "part"))}
    assert list(rows) == [
        *("alone", "part (3 instances)", "part.own", "part.leaf (2 instances)", "part.leaf.one", "part.leaf.two")
    ]
    numbers = {name: [int(n) for n in line[len(name) :].split() if n.isdigit()] for name, line in rows.items()}
    ones = [numbers[name] for name in ("part.own", "part.leaf.one", "part.leaf.two")]
    assert numbers["part (3 instances)"] == [sum(column) for column in zip(*ones, strict=True)]
    assert numbers["part.leaf (2 instances)"] == [sum(column) for column in zip(*ones[1:], strict=True)]
    assert "3·sin" in rows["part (3 instances)"] and "2·sin" in rows["part.leaf (2 instances)"]
    facts["instances"][1]["instructions"] = None
    unknown = next(line for line in report_text(facts).splitlines() if line.startswith("part (3"))
    assert unknown.split()[5] == "-"
