#!/usr/bin/env bash
# `make verify`: the evidence of docs/evidence.md, one line a check. The same every time; a failure names its seed.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
scripts/verify_tools.sh
. scripts/env.sh
tests=fcsl_compiler/test
progress "generated programs: compiled = CPython = oracle" \
    python3 -m pytest -q -s "$tests/test_generated.py" -k "test_programs or test_machines" --programs 2000 --program-seed 2
progress "broken programs and configs: always a diagnostic" \
    python3 -m pytest -q -s "$tests/test_fuzz.py" --fuzz 500 --fuzz-seed 2
progress "elementary functions: correctly rounded at 100 000 hard points each" \
    env FCSL_VERIFY=1 python3 -m pytest -v "$tests/test_rounding.py" -k test_correctly_rounded
progress "no allocation, bounded stack, no foreign call: every example's binary" python3 scripts/verify/binary.py
progress "sanitizers: native tests, threads, generated C" python3 scripts/verify/sanitize.py
progress "fuzzers: every native parser, each with a seeded defect" python3 scripts/verify/fuzz.py
progress "coverage: fcslc and clang agree on lines, branches and MC/DC" python3 scripts/verify/coverage.py
progress "EVA: no run-time error in generated C" python3 scripts/verify/eva.py
progress "instruction bounds: what a step executes is counted and never exceeds them" python3 scripts/verify/instructions.py
progress "same bits: every example on every target and in CPython" python3 scripts/verify/bits.py
progress "processor in the loop: the lander's controller on a Cortex-M7" python3 scripts/verify/pil.py
say "verified"
