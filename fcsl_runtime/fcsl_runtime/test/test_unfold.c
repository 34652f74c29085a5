/* SPDX-License-Identifier: Apache-2.0
 *
 * Folded fields: those of the fixture, folded by hand, unfold to its table; damaged ones are refused. Argument: the fixture library.
 */
#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_library.h"
#include "fcsl_check.h"

enum { FIELDS_MAX = 64, INSTANCES_MAX = 8 };

static const fcsl_machine_t *good;
static fcsl_machine_t machine;
static fcsl_folded_fields_t folded;
static fcsl_field_t inside[FIELDS_MAX];
static fcsl_field_t others[FIELDS_MAX];
static fcsl_instance_t instances[INSTANCES_MAX];
static fcsl_fold_t folds[INSTANCES_MAX];
static fcsl_folded_instance_t folded_instances[INSTANCES_MAX];
static fcsl_folded_connection_t connections[FIELDS_MAX];

/* Every instance of the fixture is one fold. */
static void fold_good(void)
{
    CHECK(good->field_count <= FIELDS_MAX && good->instance_count <= INSTANCES_MAX);
    machine = *good;
    machine.fields = NULL;
    machine.folded = &folded;
    machine.instances = instances;
    memcpy(instances, good->instances, good->instance_count * sizeof instances[0]);
    folded = (fcsl_folded_fields_t){.folds = folds,
                                    .fold_count = good->instance_count,
                                    .instances = folded_instances,
                                    .others = others,
                                    .connections = connections};
    for (uint32_t i = 0; i < good->field_count; i++) {
        inside[i] = good->fields[i];
        inside[i].connected_from = FCSL_NONE;
        if (good->fields[i].connected_from != FCSL_NONE) {
            connections[folded.connection_count++] =
                (fcsl_folded_connection_t){.field = i, .connected_from = good->fields[i].connected_from};
        }
    }
    uint32_t at = 0;
    for (uint32_t i = 0; i < good->instance_count; i++) {
        const fcsl_instance_t *instance = &good->instances[i];
        for (; at < instance->first_field; at++) {
            others[folded.other_count++] = good->fields[at];
        }
        const uint32_t record = good->fields[at].offset;
        folds[i] = (fcsl_fold_t){.fields = &inside[at], .field_count = instance->field_count};
        folded_instances[i] = (fcsl_folded_instance_t){.fold = i, .offset = record};
        for (; at < instance->first_field + instance->field_count; at++) {
            inside[at].path += strlen(instance->name);
            inside[at].offset -= record;
            inside[at].instance = FCSL_NONE;
        }
    }
    for (; at < good->field_count; at++) {
        others[folded.other_count++] = good->fields[at];
    }
}

static void test_whole(void)
{
    fcsl_error_t error = {""};
    void *made = NULL;
    fold_good();
    CHECK(folded.other_count > instances[0].first_field); /* some are behind the instances */
    CHECK(folded.connection_count > 0);
    const fcsl_machine_t *whole = fcsl_library_unfold(&machine, &made, &error);
    CHECK(whole != NULL && whole == made && whole->folded == NULL);
    for (uint32_t i = 0; i < good->field_count; i++) {
        fcsl_field_t field = whole->fields[i];
        CHECK(strcmp(field.path, good->fields[i].path) == 0);
        field.path = good->fields[i].path;
        CHECK(memcmp(&field, &good->fields[i], sizeof field) == 0);
    }
    fcsl_run_t *run = fcsl_run_open_machine(&machine, NULL, &error);
    CHECK(run != NULL);
    CHECK(strcmp(fcsl_run_machine(run)->fields[instances[0].first_field].path,
                 good->fields[instances[0].first_field].path) == 0);
    CHECK(fcsl_run_close(run, &error) == 0);
    free(made);

    CHECK(fcsl_library_unfold(good, &made, &error) == good && made == NULL);
}

#define REFUSED(damage)                                                                                                \
    do {                                                                                                               \
        fcsl_error_t error = {""};                                                                                     \
        void *made = &machine;                                                                                         \
        fold_good();                                                                                                   \
        damage;                                                                                                        \
        CHECK(fcsl_library_unfold(&machine, &made, &error) == NULL);                                                   \
        CHECK(made == NULL && strstr(error.text, "inconsistent") != NULL);                                             \
    } while (0)

static void test_damage(void)
{
    static char endless[1024];
    memset(endless, 'a', sizeof endless - 1u);
    REFUSED(machine.field_count = UINT32_MAX);
    REFUSED(machine.instance_count = UINT32_MAX);
    REFUSED(machine.field_count++);
    REFUSED(machine.field_count--);
    REFUSED(machine.instance_count--);
    REFUSED(machine.instance_count = 0);
    REFUSED(machine.instances = NULL);
    REFUSED(folded.folds = NULL);
    REFUSED(folded.fold_count = UINT32_MAX);
    REFUSED(folded.fold_count--);
    REFUSED(folded.instances = NULL);
    REFUSED(folded.others = NULL);
    REFUSED(folded.other_count = UINT32_MAX);
    REFUSED(folded.other_count = machine.field_count);
    REFUSED(folded.connections = NULL);
    REFUSED(folded.connection_count = UINT32_MAX);
    REFUSED(connections[0].field = machine.field_count);
    REFUSED(folds[0].fields = NULL);
    REFUSED(folds[0].field_count++);
    REFUSED(folds[0].field_count = UINT32_MAX);
    REFUSED(folded_instances[0].fold = folded.fold_count);
    REFUSED(inside[instances[0].first_field].path = NULL);
    REFUSED(inside[instances[0].first_field].path = endless);
    REFUSED(instances[0].name = NULL);
    REFUSED(instances[0].name = endless);
    REFUSED(instances[0].first_field++);
    REFUSED(instances[0].first_field = UINT32_MAX);
    REFUSED(instances[0].field_count++);
}

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    void *library = dlopen(argv[1], RTLD_NOW);
    CHECK(library != NULL);
    good = *(const fcsl_machine_t *const *)dlsym(library, "fcsl_machines");
    test_whole();
    test_damage();
    return 0;
}
