/* SPDX-License-Identifier: Apache-2.0
 *
 * Instructions of functions of fcsl_math and of the C library. Reads lines "function x y" (y 0 for functions of one argument, sizes
 * in x for those of memory) and prints one count for each.
 */
#define _GNU_SOURCE
#include "stepped.h"

#include <fcsl/fcsl_math.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    const char *name;
    uintptr_t function;
    int arguments; /* 0: memcpy and its kind */
    int is_single;
} function_t;

#define ONE(name)    {#name, (uintptr_t)(name), 1, 0}, {#name "f", (uintptr_t)(name##f), 1, 1}
#define TWO(name)    {#name, (uintptr_t)(name), 2, 0}, {#name "f", (uintptr_t)(name##f), 2, 1}
#define MEMORY(name) {#name, (uintptr_t)(name), 0, 0}

static const function_t FUNCTIONS[] = {
    ONE(cr_sin),   ONE(cr_cos),    ONE(cr_tan),     ONE(cr_asin),   ONE(cr_acos),   ONE(cr_atan),   ONE(cr_sinh),
    ONE(cr_cosh),  ONE(cr_tanh),   ONE(cr_exp),     ONE(cr_expm1),  ONE(cr_log),    ONE(cr_log1p),  ONE(cr_log2),
    ONE(cr_log10), ONE(cr_cbrt),   TWO(cr_atan2),   TWO(cr_pow),    TWO(cr_hypot),  TWO(fmod),      ONE(floor),
    ONE(ceil),     ONE(trunc),     ONE(round),      ONE(roundeven), ONE(rint),      ONE(nearbyint), ONE(sqrt),
    TWO(copysign), MEMORY(memcpy), MEMORY(memmove), MEMORY(memset), MEMORY(memcmp),
};

static double call(const function_t *f, double x, double y)
{
    static uint8_t from[1 << 16], to[1 << 16];
    stepped_arm(f->function);
    if (f->arguments == 0 && strcmp(f->name, "memset") == 0) {
        ((void *(*)(void *, int, size_t))f->function)(to, 0, (size_t)x);
        return 0;
    }
    if (f->arguments == 0) {
        ((void *(*)(void *, const void *, size_t))f->function)(to, from, (size_t)x);
        return 0;
    }
    if (f->is_single) {
        return f->arguments == 1 ? ((float (*)(float))f->function)((float)x)
                                 : ((float (*)(float, float))f->function)((float)x, (float)y);
    }
    return f->arguments == 1 ? ((double (*)(double))f->function)(x) : ((double (*)(double, double))f->function)(x, y);
}

int main(void)
{
    if (stepped_begin() != 0) {
        return 2;
    }
    char name[32];
    double x = 0;
    double y = 0;
    while (scanf("%31s %lf %lf", name, &x, &y) == 3) {
        const function_t *found = NULL;
        for (size_t i = 0; i < sizeof FUNCTIONS / sizeof FUNCTIONS[0]; i++) {
            found = strcmp(FUNCTIONS[i].name, name) == 0 ? &FUNCTIONS[i] : found;
        }
        if (found == NULL) {
            fprintf(stderr, "stepped_math: no function `%s`\n", name);
            return 2;
        }
        const volatile double result = call(found, x, y);
        (void)result;
        printf("%" PRIu64 "\n", stepped.all);
    }
    return 0;
}
