# SPDX-License-Identifier: Apache-2.0
"""Seeded defects: each is written into a copy of a machine's generated C, and the checks that must find it are named."""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from fcsl_compiler.driver.library import build_library
from fcsl_compiler.driver.passes import Compilation
from fcsl_compiler.model.target import Target

from ..shared.cases import EXAMPLES, CheckFailed
from .build import Binary, compile_lined

_STEP = re.compile(r"fcsl_step_\w+\(void \*machine, const fcsl_host_t \*host\)\n\{\n")


@dataclass(frozen=True)
class Control:
    """`code` defines `seeded`, which the step then calls first; `foreign` code comes from a file of its own, as externs do.

    `found_by`: checks that must find it, each with words that its finding must have. Without any, no check may find a thing.
    """

    name: str
    code: str
    found_by: dict[str, str]
    foreign: bool = False


#: Of each control.
TICKS = 256
_KILLED = "killed by signal 9"
_POINTER = "through a pointer that is not the host's"
_LEFT_BEHIND = "are not as they were"

#: Every way to memory.
_ALLOCATORS = """memory = malloc(16);
memory = calloc(2, 8);
memory = realloc(memory, 16);
memory = reallocarray(memory, 2, 8);
free(memory);
memory = aligned_alloc(64, 64);
memory = memalign(64, 64);
(void)!posix_memalign(&old, 64, 64);
memory = valloc(64);
memory = pvalloc(64);
memory = mmap(NULL, 4096, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
memory = mremap(memory, 4096, 8192, 0);
(void)munmap(memory, 4096);
(void)!brk(memory);
memory = sbrk(16);"""

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
    Control("nothing", "static void seeded(void) {}", {}),
    Control("a switch", _SWITCH % "nop", {}),
    Control(
        "a system call in a case of a switch that is never taken",
        _SWITCH % "syscall",
        {"code": "`syscall` enters the kernel"},
    ),
    Control(
        "every way to memory, in an extern",
        f"""#define _GNU_SOURCE
#include <malloc.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>
void seeded(void);
void seeded(void) {{ static void *volatile memory; void *old = NULL; {_ALLOCATORS} }}""",
        {
            "symbols": "aligned_alloc, brk, calloc, free, malloc, memalign, mmap, mremap, munmap, posix_memalign, pvalloc, "
            "realloc, reallocarray, sbrk, valloc",
            "code": "a call of malloc",
            "allocations": f"{TICKS * len(_ALLOCATORS.splitlines())} calls",
        },
        foreign=True,
    ),
    Control(
        "recursion",
        """static __attribute__((noinline)) uint64_t depth(volatile uint64_t n) { return n == 0u ? 0u : depth(n - 1u) + n; }
static void seeded(void) { volatile uint64_t n = depth(3u); (void)n; }""",
        {"graph": "recursion: ", "code": "recursion: depth calls depth"},
    ),
    Control(
        "a call through a pointer",
        """static void nothing(void) {}
static void seeded(void) { void (*volatile f)(void) = nothing; f(); }""",
        {"graph": _POINTER, "code": _POINTER},
    ),
    Control(
        "a call through a pointer at the end of a function",
        """static void nothing(void) {}
static __attribute__((noinline)) void last(void) { void (*volatile f)(void) = nothing; f(); }
static void seeded(void) { last(); }""",
        {"graph": _POINTER, "code": _POINTER},
    ),
    Control(
        "an array of variable length",
        """static __attribute__((noinline)) void fill(void)
{ volatile uint32_t n = 100u; volatile char a[n]; for (uint32_t i = 0; i < 100u; i++) { a[i] = 1; } }
static void seeded(void) { fill(); }""",
        {"graph": "frame whose size is known when it runs", "code": "by an amount that is not known"},
    ),
    Control(
        "4 KiB of stack in an extern",
        """void seeded(void);
void seeded(void) { volatile char a[4096]; for (unsigned i = 0; i < sizeof a; i++) { a[i] = 1; } }""",
        {"stack": "bytes of stack, more than"},
        foreign=True,
    ),
    Control(
        "a system call by its instruction",
        """static void seeded(void)
{ long r = 110; __asm__ volatile("syscall" : "+a"(r) : : "rcx", "r11", "memory"); }""",
        {"code": "`syscall` enters the kernel", "strict": _KILLED},
    ),
    Control(
        "a system call by the C library",
        "#include <unistd.h>\nstatic void seeded(void) { (void)getppid(); }",
        {"symbols": "would call getppid", "graph": "calls getppid", "code": "a call of getppid", "strict": _KILLED},
    ),
    Control(
        "a variable that is written",
        "static volatile uint64_t count;\nstatic void seeded(void) { count = count + 1u; }",
        {"symbols": "variables in .bss: count"},
    ),
    Control(
        "a thread's variable",
        "static _Thread_local volatile uint64_t count;\nstatic void seeded(void) { count = count + 1u; }",
        {"symbols": "thread-local .tbss"},
    ),
    Control(
        "code that runs when the library is loaded",
        """static __attribute__((constructor)) void early(void) { __asm__ volatile("nop"); }
static void seeded(void) {}""",
        {"symbols": "runs early from .init_array"},
    ),
    Control(
        "a function chosen by the loader",
        """static void nothing(void) {}
static void (*choose(void))(void) { return nothing; }
__attribute__((ifunc("choose"))) void chosen(void);
static void seeded(void) { chosen(); }""",
        {"symbols": "resolves chosen when it is loaded", "graph": "calls chosen"},
    ),
    Control(
        "a weak function",
        "extern __attribute__((weak)) void perhaps(void);\nstatic void seeded(void) { if (perhaps) { perhaps(); } }",
        {"symbols": "imports weak perhaps", "graph": "calls perhaps", "code": "a call of perhaps"},
    ),
    Control(
        "data of the C library",
        "extern char **environ;\nstatic void seeded(void) { char **volatile e = environ; (void)e; }",
        {"symbols": "environ, which is no function"},
    ),
    Control(
        "a function that another library may replace",
        """__attribute__((visibility("default"), noinline)) double shown(double x) { __asm__ volatile(""); return x; }
static void seeded(void) { volatile double x = shown(1.0); (void)x; }""",
        {"symbols": "calls its own shown through the loader", "code": "a call of shown"},
    ),
    Control(
        "a changed rounding mode",
        "#include <fenv.h>\nstatic void seeded(void) { (void)fesetround(FE_UPWARD); }",
        {"environment": _LEFT_BEHIND},
    ),
    Control(
        "x87 registers left in use",
        'static void seeded(void) { __asm__ volatile("fld1"); }',
        {"environment": _LEFT_BEHIND},
    ),
    Control(
        "a changed signal mask",
        """#include <signal.h>
static void seeded(void)
{ sigset_t s; (void)sigemptyset(&s); (void)sigaddset(&s, SIGUSR1); (void)sigprocmask(SIG_BLOCK, &s, NULL); }""",
        {
            "symbols": "sigprocmask",
            "graph": "calls sig",
            "code": "a call of sig",
            "signals": "not as it was",
            "strict": _KILLED,
        },
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
