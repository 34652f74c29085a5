# SPDX-License-Identifier: Apache-2.0
"""Seeded defects: each is written into a copy of a machine's generated C, and the checks that must find it are named."""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from binary_build import Binary, compile_lined
from cases import EXAMPLES, CheckFailed

from fcsl_compiler.build import build_library
from fcsl_compiler.passes import Compilation
from fcsl_compiler.targets import Target

_STEP = re.compile(r"fcsl_step_\w+\(void \*machine, const fcsl_host_t \*host\)\n\{\n")


@dataclass(frozen=True)
class Control:
    """`code` defines `seeded`, which the step then calls first; `foreign` code comes from a file of its own, as externs do.

    Where no check must find it, none may: it is no defect.
    """

    name: str
    code: str
    found_by: frozenset[str]
    foreign: bool = False


def _c(name: str, found_by: str, code: str, foreign: bool = False) -> Control:
    return Control(name, code, frozenset(found_by.split()), foreign)


_FAMILY = """
#define _GNU_SOURCE
#include <malloc.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>
void seeded(void);
void seeded(void)
{
    static void *volatile memory;
    void *old = NULL;
    %s;
}
"""

#: Every way to memory, each alone: what is not counted would go unseen.
_ALLOCATORS = {
    "malloc": "memory = malloc(16)",
    "calloc": "memory = calloc(2, 8)",
    "realloc": "memory = realloc(old, 16)",
    "reallocarray": "memory = reallocarray(old, 2, 8)",
    "free": "free(memory)",
    "aligned_alloc": "memory = aligned_alloc(64, 64)",
    "memalign": "memory = memalign(64, 64)",
    "posix_memalign": "(void)!posix_memalign(&old, 64, 64); memory = old",
    "valloc": "memory = valloc(64)",
    "pvalloc": "memory = pvalloc(64)",
    "mmap": "memory = mmap(NULL, 4096, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0)",
    "mremap": "memory = mremap(memory, 4096, 8192, 0)",
    "munmap": "(void)munmap(memory, 4096)",
    "brk": "(void)!brk(memory)",
    "sbrk": "memory = sbrk(16)",
}

#: A `switch` that gcc makes a jump through a table of addresses.
_SWITCH = """static __attribute__((noinline)) void chosen(volatile uint64_t n)
{ switch (n) {
    case 0: __asm__ volatile("nop"); break;
    case 1: __asm__ volatile("nop;nop"); break;
    case 2: __asm__ volatile("nop;nop;nop"); break;
    case 3: __asm__ volatile("nop;nop;nop;nop"); break;
    case 4: __asm__ volatile("nop;nop;nop;nop;nop"); break;
    case 5: __asm__ volatile("%s" : : : "rax", "rcx", "r11", "memory"); break;
    default: break;
} }
static void seeded(void) { volatile uint64_t n = 3u; chosen(n); }"""

CONTROLS: tuple[Control, ...] = (
    _c("nothing", "", "static void seeded(void) {}"),
    _c("a switch", "", _SWITCH % "nop"),
    _c("a system call in a case of a switch that is never taken", "code", _SWITCH % "syscall"),
    *(
        _c(f"{name} in an extern", "symbols code allocations", _FAMILY % call, foreign=True)
        for name, call in _ALLOCATORS.items()
    ),
    _c(
        "recursion",
        "graph code",
        """static __attribute__((noinline)) uint64_t depth(volatile uint64_t n) { return n == 0u ? 0u : depth(n - 1u) + n; }
static void seeded(void) { volatile uint64_t n = depth(3u); (void)n; }""",
    ),
    _c(
        "a call through a pointer",
        "graph code",
        """static void nothing(void) {}
static void seeded(void) { void (*volatile f)(void) = nothing; f(); }""",
    ),
    _c(
        "a call through a pointer at the end of a function",
        "graph code",
        """static void nothing(void) {}
static __attribute__((noinline)) void last(void) { void (*volatile f)(void) = nothing; f(); }
static void seeded(void) { last(); }""",
    ),
    _c(
        "an array of variable length",
        "graph code",
        """static __attribute__((noinline)) void fill(void)
{ volatile uint32_t n = 100u; volatile char a[n]; for (uint32_t i = 0; i < 100u; i++) { a[i] = 1; } }
static void seeded(void) { fill(); }""",
    ),
    _c(
        "4 KiB of stack in an extern",
        "stack",
        """void seeded(void);
void seeded(void) { volatile char a[4096]; for (unsigned i = 0; i < sizeof a; i++) { a[i] = 1; } }""",
        foreign=True,
    ),
    _c(
        "a system call by its instruction",
        "code strict",
        """static void seeded(void)
{ long r = 110; __asm__ volatile("syscall" : "+a"(r) : : "rcx", "r11", "memory"); }""",
    ),
    _c(
        "a system call by the C library",
        "symbols graph code strict",
        """#include <unistd.h>
static void seeded(void) { (void)getppid(); }""",
    ),
    _c(
        "a variable that is written",
        "symbols",
        "static volatile uint64_t count;\nstatic void seeded(void) { count = count + 1u; }",
    ),
    _c(
        "a thread's variable",
        "symbols",
        "static _Thread_local volatile uint64_t count;\nstatic void seeded(void) { count = count + 1u; }",
    ),
    _c(
        "code that runs when the library is loaded",
        "symbols",
        """static __attribute__((constructor)) void early(void) { __asm__ volatile("nop"); }
static void seeded(void) {}""",
    ),
    _c(
        "a function chosen by the loader",
        "symbols graph",
        """static void nothing(void) {}
static void (*choose(void))(void) { return nothing; }
__attribute__((ifunc("choose"))) void chosen(void);
static void seeded(void) { chosen(); }""",
    ),
    _c(
        "a weak function",
        "symbols graph code",
        "extern __attribute__((weak)) void perhaps(void);\nstatic void seeded(void) { if (perhaps) { perhaps(); } }",
    ),
    _c(
        "data of the C library",
        "symbols",
        "extern char **environ;\nstatic void seeded(void) { char **volatile e = environ; (void)e; }",
    ),
    _c(
        "a function that another library may replace",
        "symbols code",
        """__attribute__((visibility("default"), noinline)) double cr_shown(double x) { __asm__ volatile(""); return x; }
static void seeded(void) { volatile double x = cr_shown(1.0); (void)x; }""",
    ),
    _c(
        "a changed rounding mode",
        "environment",
        "#include <fenv.h>\nstatic void seeded(void) { (void)fesetround(FE_UPWARD); }",
    ),
    _c(
        "x87 registers left in use",
        "environment",
        'static void seeded(void) { __asm__ volatile("fld1"); }',
    ),
    _c(
        "a changed signal mask",
        "symbols graph code signals strict",
        """#include <signal.h>
static void seeded(void) { sigset_t s; (void)sigemptyset(&s); (void)sigaddset(&s, SIGUSR1); (void)sigprocmask(SIG_BLOCK, &s, NULL); }""",
    ),
)


def base(folder: Path) -> Compilation:
    """The machine that is spoilt: the smallest example. Its C files are left in `folder`."""
    return build_library([EXAMPLES["minimal"]], folder / "library.so")[0]


def seed(control: Control, made: Compilation, clean: Path, folder: Path) -> Binary:
    """A library with the defect. Raises CheckFailed where the generated C has no place for it, and ToolchainError."""
    folder.mkdir(parents=True)
    name = made.checked.name
    for file in clean.glob("*.[ch]"):
        shutil.copy(file, folder)
    source = folder / f"{name}.c"
    text = source.read_text()
    step = _STEP.search(text)
    if step is None:
        raise CheckFailed(f"{source.name} has no fcsl_step: the defects would not be called")
    head = text.index("static", 0)
    define = "void seeded(void);" if control.foreign else control.code
    # _GNU_SOURCE comes first of all, for what the defects include.
    spoilt = (
        f"#define _GNU_SOURCE\n{text[:head]}{define}\n\n{text[head : step.end()]}    seeded();\n{text[step.end() :]}"
    )
    source.write_text(spoilt)
    more = None
    if control.foreign:
        extern = folder / "externs" / "seeded.c"
        extern.parent.mkdir()
        extern.write_text(control.code)
        more = Target("seeded", (extern,))
    return compile_lined(made, folder, folder / "lined", more)
