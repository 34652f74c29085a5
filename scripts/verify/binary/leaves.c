/* SPDX-License-Identifier: Apache-2.0
 *
 * How much stack the C library's functions that a machine may call use: each is called on a painted stack with arguments
 * that lead through its special cases. Usage: leaves NAME...
 * Prints `name bytes address library` lines, the address (within the library) of the variant that the loader chose; fails for a function whose arguments are not known here.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fenv.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "painted.h"

enum { BUFFER_BYTES = 1 << 16, NUMBERS = 16 };

typedef enum { REALS, REAL_AND_INTEGER, MEMORY, EXCEPTIONS, FLAGS_AND_EXCEPTIONS, ENVIRONMENT } arguments_t;

typedef struct {
    const char *name; /* without the `f` of the function for floats */
    arguments_t arguments;
} function_t;

static const function_t functions[] = {
    {"fma", REALS},
    {"fmod", REALS},
    {"round", REALS},
    {"roundeven", REALS},
    {"rint", REALS},
    {"nearbyint", REALS},
    {"floor", REALS},
    {"ceil", REALS},
    {"trunc", REALS},
    {"fmin", REALS},
    {"fmax", REALS},
    {"sqrt", REALS},
    {"copysign", REALS},
    {"fabs", REALS},
    {"ldexp", REAL_AND_INTEGER},
    {"scalbn", REAL_AND_INTEGER},
    {"fegetround", EXCEPTIONS},
    {"fesetround", EXCEPTIONS},
    {"feclearexcept", EXCEPTIONS},
    {"feraiseexcept", EXCEPTIONS},
    {"fetestexcept", EXCEPTIONS},
    {"fegetexceptflag", FLAGS_AND_EXCEPTIONS},
    {"fesetexceptflag", FLAGS_AND_EXCEPTIONS},
    {"fegetenv", ENVIRONMENT},
    {"fesetenv", ENVIRONMENT},
    {"feholdexcept", ENVIRONMENT},
    {"feupdateenv", ENVIRONMENT},
    {"memcpy", MEMORY},
    {"memmove", MEMORY},
    {"memset", MEMORY},
    {"memcmp", MEMORY},
    {"__memcpy_chk", MEMORY},
    {"__memmove_chk", MEMORY},
    {"__memset_chk", MEMORY},
};

static const uint64_t doubles[NUMBERS] = {
    0, /* then 1, -1, 1.5, -2.5, 3e15, least subnormal, a subnormal, least normal, 2^-30, 2^60, largest, infinities, NaN */
    0x3ff0000000000000,
    0xbff0000000000000,
    0x3ff8000000000000,
    0xc004000000000000,
    0x43254dc3ae9c8001,
    0x0000000000000001,
    0x000fffffffffffff,
    0x0010000000000000,
    0x3e10000000000000,
    0x43b0000000000000,
    0x7fefffffffffffff,
    0x7ff0000000000000,
    0xfff0000000000000,
    0x7ff8000000000000,
    0x8000000000000000,
};
static const uint32_t floats[NUMBERS] = {
    0,          0x3f800000, 0xbf800000, 0x3fc00000, 0xc0200000, 0x4a400001, 0x00000001, 0x007fffff,
    0x00800000, 0x30800000, 0x5d800000, 0x7f7fffff, 0x7f800000, 0xff800000, 0x7fc00000, 0x80000000,
};
static const int32_t integers[NUMBERS] = {0,    1,     -1,   52,    -52,   53,     1022,      -1022,
                                          1100, -1100, 2100, -2100, 50000, -50000, INT32_MAX, INT32_MIN};

static double number(uint32_t index, bool is_float)
{
    const uint64_t bits = is_float ? floats[index] : doubles[index];
    double value = 0.0;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint64_t address(void *memory)
{
    return (uint64_t)(uintptr_t)memory;
}

static void call_reals(const void *function, bool is_float, bool with_integer)
{
    for (uint32_t n = 0; n < NUMBERS * NUMBERS * NUMBERS; n++) {
        const double reals[3] = {number(n % NUMBERS, is_float), number(n / NUMBERS % NUMBERS, is_float),
                                 number(n / NUMBERS / NUMBERS, is_float)};
        const uint64_t first = with_integer ? (uint64_t)(int64_t)integers[n / NUMBERS % NUMBERS] : 0u;
        (void)painted_call(function, (const uint64_t[4]){first}, reals);
    }
}

static void call_memory(const void *function)
{
    static uint8_t from[BUFFER_BYTES];
    static uint8_t to[BUFFER_BYTES];
    const double reals[3] = {0};
    for (uint64_t size = 0; size <= BUFFER_BYTES; size += size < 600u ? 1u : size / 3u) {
        (void)painted_call(function, (const uint64_t[4]){address(to), address(from), size, BUFFER_BYTES}, reals);
        if (size < BUFFER_BYTES) { /* overlapping, both ways */
            (void)painted_call(function, (const uint64_t[4]){address(to + 1), address(to), size, BUFFER_BYTES - 1u},
                               reals);
            (void)painted_call(function, (const uint64_t[4]){address(to), address(to + 1), size, BUFFER_BYTES}, reals);
        }
    }
}

static void call_environment(const void *function, arguments_t arguments)
{
    static const int roundings[] = {FE_TONEAREST, FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO};
    const double reals[3] = {0};
    fenv_t now;
    fexcept_t flags = 0;
    for (uint64_t n = 0; n <= FE_ALL_EXCEPT; n++) {
        (void)fegetenv(&now);
        const uint64_t first = arguments == EXCEPTIONS             ? n
                               : arguments == FLAGS_AND_EXCEPTIONS ? (uint64_t)(uintptr_t)&flags
                                                                   : (uint64_t)(uintptr_t)&now;
        (void)painted_call(function, (const uint64_t[4]){first, n}, reals);
        (void)fesetenv(FE_DFL_ENV);
    }
    for (uint32_t i = 0; arguments == EXCEPTIONS && i < sizeof roundings / sizeof roundings[0]; i++) {
        (void)painted_call(function, (const uint64_t[4]){(uint64_t)roundings[i]}, reals);
        (void)fesetenv(FE_DFL_ENV);
    }
}

static const function_t *find(const char *name, bool *is_float)
{
    for (uint32_t i = 0; i < sizeof functions / sizeof functions[0]; i++) {
        const size_t length = strlen(functions[i].name);
        *is_float = strcmp(name + (strlen(name) < length ? 0 : length), "f") == 0;
        if (strncmp(name, functions[i].name, length) == 0 && (name[length] == '\0' || *is_float)) {
            return &functions[i];
        }
    }
    return NULL;
}

int main(int argc, char **argv)
{
    for (int i = 1; i < argc; i++) {
        bool is_float = false;
        const function_t *function = find(argv[i], &is_float);
        const void *entry = dlsym(RTLD_DEFAULT, argv[i]);
        Dl_info where;
        if (function == NULL || entry == NULL || dladdr(entry, &where) == 0) {
            (void)fprintf(stderr, "leaves: %s: its arguments are not known, or there is no such function\n", argv[i]);
            return 1;
        }
        painted_begin();
        switch (function->arguments) {
        case REALS:
        case REAL_AND_INTEGER:
            call_reals(entry, is_float, function->arguments == REAL_AND_INTEGER);
            break;
        case MEMORY:
            call_memory(entry);
            break;
        default:
            call_environment(entry, function->arguments);
        }
        const size_t offset = (size_t)((uintptr_t)entry - (uintptr_t)where.dli_fbase);
        (void)printf("%s %zu %zu %s\n", argv[i], painted_used(), offset, where.dli_fname);
    }
    return 0;
}
