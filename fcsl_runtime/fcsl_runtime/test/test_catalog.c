/* SPDX-License-Identifier: Apache-2.0
 *
 * Arrays of structs in a table of fields: slices of those that are regular, and none of those that are not. The sources are
 * compiled in.
 */
#include "base/nearest.c"
#include "vars/catalog.c"

#include "vars/catalog_slice.c"
#include "machine/view.c"

#include "fcsl_check.h"

enum { OUTER = 3, INNER = 2, FIELDS = OUTER * INNER, STRIDE = 64 };

static fcsl_field_t fields[FIELDS];
static char paths[FIELDS][32];
static catalog_t catalog;

size_t fcsl_history_part(const fcsl_history_t *history, uint32_t part)
{
    (void)history;
    return (size_t)part;
}

/* "a.t[i].u[j].x", each one double: what the compiler makes of an array of structs with an array of structs in it. */
static void open_regular(void)
{
    static fcsl_vars_block_t block = {.prefix = "", .fields = fields, .field_count = FIELDS};
    for (uint32_t i = 0; i < FIELDS; i++) {
        (void)snprintf(paths[i], sizeof paths[i], "a.t[%u].u[%u].x", i / INNER, i % INNER);
        fields[i] = (fcsl_field_t){.path = paths[i],
                                   .type = FCSL_F64,
                                   .count = 1,
                                   .size = 8,
                                   .offset = STRIDE * (i / INNER) + 16u * (i % INNER)};
    }
    CHECK(fcsl_catalog_open(&catalog, &block, 1, NULL) == 0);
}

static void test_regular(void)
{
    target_t target;
    open_regular();
    CHECK(fcsl_catalog_find_slice(&catalog, "a.t[:].u[:].x", &target) == TARGET_OK &&
          fcsl_view_count(&target.view) == FIELDS);
    for (uint32_t i = 0; i < FIELDS; i++) {
        CHECK(fcsl_view_byte(&target.view, i) == (int64_t)fields[i].offset && fcsl_view_field(&target.view, i) == i);
    }
    CHECK(fcsl_catalog_find_slice(&catalog, "a.t[::-2].u[1].x", &target) == TARGET_OK &&
          fcsl_view_count(&target.view) == 2);
    CHECK(fcsl_view_byte(&target.view, 0) == 2 * STRIDE + 16 && fcsl_view_byte(&target.view, 1) == 16);
    CHECK(fcsl_catalog_find_slice(&catalog, "a.t[3].u[0].x", &target) == TARGET_INDEX &&
          fcsl_catalog_find_slice(&catalog, "a.t[:].u[2].x", &target) == TARGET_INDEX);
    CHECK(fcsl_catalog_find_slice(&catalog, "a.t[:].u[:].y", &target) == TARGET_UNKNOWN &&
          fcsl_catalog_find_slice(&catalog, "a.u[:].t[:].x", &target) == TARGET_UNKNOWN);
    CHECK(fcsl_catalog_find_slice(&catalog, "a.t.u.x", &target) == TARGET_UNKNOWN &&
          fcsl_catalog_find_slice(&catalog, "", &target) == TARGET_UNKNOWN);
    fcsl_catalog_free(&catalog);
}

#define IRREGULAR(damage)                                                                                              \
    do {                                                                                                               \
        target_t target;                                                                                               \
        open_regular();                                                                                                \
        damage;                                                                                                        \
        CHECK(fcsl_catalog_find_slice(&catalog, "a.t[:].u[:].x", &target) == TARGET_UNKNOWN);                          \
        fcsl_catalog_free(&catalog);                                                                                   \
    } while (0)

/* Tables that no compiler made: nobody is to read beside the fields. */
static void test_irregular(void)
{
    IRREGULAR(fields[FIELDS - 1].offset += 8u);                              /* only the farthest one */
    IRREGULAR(fields[1].offset += 1000u);                                    /* the inner distance */
    IRREGULAR(fields[1].type = FCSL_I64);                                    /* another type */
    IRREGULAR((fields[1].size = 4, fields[1].type = FCSL_F64));              /* another size */
    IRREGULAR(fields[FIELDS - INNER].offset = STRIDE * (OUTER - 1) + 1u);    /* no whole number of steps */
}

/* The last field stands elsewhere in the table, or is missing. */
static void test_order(void)
{
    target_t target;
    open_regular();
    const entry_t last = catalog.entries[FIELDS - 1];
    for (uint32_t i = 0; i < FIELDS; i++) {
        if (strcmp(catalog.sorted[i].path, last.path) == 0) {
            catalog.sorted[i].field = 0;
        }
    }
    CHECK(fcsl_catalog_find_slice(&catalog, "a.t[:].u[:].x", &target) == TARGET_UNKNOWN);
    fcsl_catalog_free(&catalog);
    open_regular();
    catalog.count--; /* sorted by path: a.t[2].u[1].x is the last one */
    CHECK(fcsl_catalog_find_slice(&catalog, "a.t[:].u[:].x", &target) == TARGET_UNKNOWN);
    fcsl_catalog_free(&catalog);
}

/* A path that lacks names at a dot, as that of a part's port does, means the first field that has more there. */
static void test_nearest(void)
{
    open_regular();
    CHECK(strcmp(fcsl_catalog_nearest(&catalog, "a.x"), "a.t[0].u[0].x") == 0);
    CHECK(strcmp(fcsl_catalog_nearest(&catalog, "a.t[1].x"), "a.t[1].u[0].x") == 0);
    CHECK(strcmp(fcsl_catalog_nearest(&catalog, "a.t[2].u[1].y"), "a.t[2].u[1].x") == 0);
    CHECK(strcmp(fcsl_catalog_nearest(&catalog, "zzzz"), "") == 0 &&
          strcmp(fcsl_catalog_nearest(&catalog, "."), "") == 0);
    fcsl_catalog_free(&catalog);
}

int main(void)
{
    test_nearest();
    test_regular();
    test_irregular();
    test_order();
    return 0;
}
