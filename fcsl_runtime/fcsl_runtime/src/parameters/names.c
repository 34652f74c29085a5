/* SPDX-License-Identifier: Apache-2.0
 *
 * Names of nodes and of parameters.
 */
#include "names.h"

#include <stdio.h>
#include <string.h>

#include "base/nearest.h"

#define PARAMETERS ".parameters."
#define QOS        "qos_overrides." /* what rclcpp and rclpy declare in every node */

/* The next name of a path: where it begins, and its length; 0 at the end. */
static size_t next_name(const char **path)
{
    *path += strspn(*path, "/");
    return strcspn(*path, "/");
}

int fcsl_node_matches(const char *pattern, const char *node)
{
    const char *any = NULL; /* the last `**`, and what of the node it stands for at least */
    const char *covered = node;
    for (;;) {
        const size_t wanted = next_name(&pattern);
        const size_t there = next_name(&node);
        if (wanted == 2u && strncmp(pattern, "**", 2) == 0) {
            any = pattern += 2;
            covered = node;
        } else if (there > 0u &&
                   ((wanted == 1u && *pattern == '*') || (wanted == there && strncmp(pattern, node, there) == 0))) {
            pattern += wanted;
            node += there;
        } else if (wanted == 0u && there == 0u) {
            return 1;
        } else if (any != NULL && next_name(&covered) > 0u) {
            covered += next_name(&covered);
            node = covered;
            pattern = any;
        } else {
            return 0;
        }
    }
}

void fcsl_parameter_name(const fcsl_machine_t *machine, const fcsl_field_t *field, char name[PARAMETER_NAME_BYTES])
{
    const char *instance = field->instance >= 0 ? machine->instances[field->instance].name : "";
    const size_t length = strlen(instance);
    const char *rest = field->path;
    if (strncmp(rest, instance, length) == 0 && strncmp(rest + length, PARAMETERS, strlen(PARAMETERS)) == 0) {
        rest += length + strlen(PARAMETERS);
    }
    const int head = snprintf(name, PARAMETER_NAME_BYTES, "%s.", instance);
    size_t at = head > 0 && head < PARAMETER_NAME_BYTES ? (size_t)head : 0u;
    for (; *rest != '\0' && at + 1u < PARAMETER_NAME_BYTES; rest++) {
        if (*rest != ']') {
            name[at++] = *rest == '[' ? '.' : *rest;
        }
    }
    name[at] = '\0';
}

static int is_parameter(const fcsl_field_t *field)
{
    return field->role == FCSL_ROLE_PARAMETER;
}

int32_t fcsl_parameter_find(const fcsl_machine_t *machine, const char *name)
{
    char own[PARAMETER_NAME_BYTES];
    for (uint32_t i = 0; i < machine->field_count; i++) {
        const fcsl_field_t *field = &machine->fields[i];
        const char *instance =
            is_parameter(field) && field->instance >= 0 ? machine->instances[field->instance].name : NULL;
        if (instance != NULL && strncmp(name, instance, strlen(instance)) == 0) {
            fcsl_parameter_name(machine, field, own);
            if (strcmp(own, name) == 0) {
                return (int32_t)i;
            }
        }
    }
    return FCSL_NONE;
}

/* Whether it names an instance, or a parameter without its instance. */
static int is_part_of(const char *own, const char *name)
{
    const size_t length = strlen(name);
    const size_t own_length = strlen(own);
    return (strncmp(own, name, length) == 0 && own[length] == '.') ||
           (own_length > length && own[own_length - length - 1u] == '.' &&
            strcmp(own + own_length - length, name) == 0);
}

/* Of a path of the variable server, `pilot.parameters.gain`, the name. */
static int is_path(const fcsl_machine_t *machine, const char *name, char own[PARAMETER_NAME_BYTES])
{
    const char *cut = strstr(name, PARAMETERS);
    if (cut == NULL || strlen(name) >= PARAMETER_NAME_BYTES) {
        return 0;
    }
    (void)snprintf(own, PARAMETER_NAME_BYTES, "%.*s%s", (int)(cut - name), name, cut + strlen(PARAMETERS) - 1u);
    return fcsl_parameter_find(machine, own) != FCSL_NONE;
}

int fcsl_parameter_is_foreign(const fcsl_machine_t *machine, const char *name, char nearest[PARAMETER_NAME_BYTES])
{
    nearest_t found = fcsl_nearest_begin();
    const int is_own = strchr(name, '.') == NULL || strncmp(name, QOS, strlen(QOS)) == 0;
    if (is_path(machine, name, nearest)) {
        return 0;
    }
    nearest[0] = '\0';
    for (uint32_t i = 0; i < machine->field_count; i++) {
        char own[PARAMETER_NAME_BYTES];
        if (!is_parameter(&machine->fields[i])) {
            continue;
        }
        fcsl_parameter_name(machine, &machine->fields[i], own);
        if (is_part_of(own, name)) {
            memcpy(nearest, own, sizeof own);
            return 0;
        }
        const uint32_t edits = found.edits;
        fcsl_nearest_consider(&found, own, name);
        if (found.edits < edits) {
            memcpy(nearest, own, sizeof own);
            found.name = nearest;
        }
    }
    if (fcsl_nearest_if_like(&found, name)[0] == '\0') {
        nearest[0] = '\0';
    }
    return is_own;
}
