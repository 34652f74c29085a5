/* SPDX-License-Identifier: Apache-2.0
 *
 * What leaves the process has one NaN, whichever the processor made. Argument: the fixture library. The source is compiled in.
 */
#include "machine/canonical.c"

#include <dlfcn.h>
#include <stdlib.h>

#include "fcsl_check.h"

typedef struct {
    uint64_t before;
    uint64_t after;
} bits_t;

static const bits_t BITS_F64[] = {
    {UINT64_C(0x7ff8000000000000), UINT64_C(0x7ff8000000000000)},
    {UINT64_C(0xfff8000000000000), UINT64_C(0x7ff8000000000000)},
    {UINT64_C(0x7ff0000000000001), UINT64_C(0x7ff8000000000000)},
    {UINT64_C(0xffffffffffffffff), UINT64_C(0x7ff8000000000000)},
    {UINT64_C(0x7ff0000000000000), UINT64_C(0x7ff0000000000000)},
    {UINT64_C(0xfff0000000000000), UINT64_C(0xfff0000000000000)},
    {UINT64_C(0x8000000000000000), UINT64_C(0x8000000000000000)},
    {UINT64_C(0x0000000000000001), UINT64_C(0x0000000000000001)},
};
static const bits_t BITS_F32[] = {
    {0x7fc00000u, 0x7fc00000u}, {0xffc00000u, 0x7fc00000u}, {0x7f800001u, 0x7fc00000u}, {0xffffffffu, 0x7fc00000u},
    {0x7f800000u, 0x7f800000u}, {0xff800000u, 0xff800000u}, {0x80000000u, 0x80000000u}, {0x00000001u, 0x00000001u},
};

/* Element `i` of the field gets these bits; all else stays. */
static void check_element(const fcsl_machine_t *machine, const fcsl_field_t *field, uint32_t i, const bits_t *bits)
{
    const size_t scalar = field->type == FCSL_F64 ? 8u : 4u; /* little-endian */
    uint8_t *in = malloc(machine->size);
    uint8_t *out = malloc(machine->size);
    CHECK(in != NULL && out != NULL);
    memset(in, 0x3a, machine->size); /* no float is a NaN */
    memcpy(in + field->offset + i * scalar, &bits->before, scalar);
    fcsl_copy_canonical(machine, out, in);
    CHECK(memcmp(out + field->offset + i * scalar, &bits->after, scalar) == 0);
    memcpy(out + field->offset + i * scalar, &bits->before, scalar);
    CHECK(memcmp(out, in, machine->size) == 0);
    free(in);
    free(out);
}

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    void *library = dlopen(argv[1], RTLD_NOW);
    CHECK(library != NULL);
    const fcsl_machine_t *machine = *(const fcsl_machine_t *const *)dlsym(library, "fcsl_machines");
    uint32_t elements = 0;
    for (uint32_t f = 0; f < machine->field_count; f++) {
        const fcsl_field_t *field = &machine->fields[f];
        for (uint32_t i = 0; i < field->count && (field->type == FCSL_F64 || field->type == FCSL_F32);
             i++, elements++) {
            for (size_t k = 0; k < sizeof BITS_F64 / sizeof BITS_F64[0]; k++) {
                check_element(machine, field, i, field->type == FCSL_F64 ? &BITS_F64[k] : &BITS_F32[k]);
            }
        }
    }
    CHECK(elements > 10);
    return 0;
}
