/* SPDX-License-Identifier: Apache-2.0
 *
 * The values that requirements keep of the first and of the last tick that violated them.
 */
#include <math.h>
#include <stdio.h>

#include "monitor_run.h"

enum { PATH_BYTES = 512 };

/* Where the monitor keeps a value that it gets at the path `input`; 0, or -1: it does not keep it. */
static int find(const fcsl_machine_t *machine, const char *instance, const char *input, fcsl_kept_t *kept)
{
    char prefix[PATH_BYTES];
    char path[PATH_BYTES];
    (void)snprintf(prefix, sizeof prefix, "%.200s.inputs.", instance);
    const size_t length = strlen(prefix);
    if (strncmp(input, prefix, length) != 0) {
        return -1;
    }
    (void)snprintf(path, sizeof path, "%.200s.outputs.first_%.200s", instance, input + length);
    if (fcsl_monitor_locate(machine, path, &kept->first) == NULL) {
        return -1;
    }
    (void)snprintf(path, sizeof path, "%.200s.outputs.last_%.200s", instance, input + length);
    return fcsl_monitor_locate(machine, path, &kept->last) != NULL ? 0 : -1;
}

void fcsl_kept_bind(struct fcsl_monitor_run *made, const fcsl_machine_t *watched)
{
    const fcsl_monitor_t *monitor = made->monitor;
    const uint32_t rows_bytes = (uint32_t)(monitor->requirement_count * sizeof(fcsl_served_row_t));
    uint32_t count = 0;
    for (uint32_t i = 0; i < monitor->requirement_count; i++) {
        const char *instance = monitor->machine->instances[monitor->requirements[i].instance].name;
        made->kept_begin[i] = count;
        for (uint32_t k = 0; k < monitor->observed_count; k++) {
            const fcsl_observed_t *observed = &monitor->observed[k];
            uint32_t unused = 0;
            if (find(monitor->machine, instance, observed->input, &made->kept[count]) != 0) {
                continue;
            }
            const fcsl_field_t *field = fcsl_monitor_locate(watched, observed->path, &unused); /* bound before */
            made->kept_fields[count] = (fcsl_field_t){
                .path = observed->path,
                .role = field->role,
                .type = field->type,
                .count = 1,
                .offset = rows_bytes + count * 2u * FCSL_KEPT_LAST,
                .size = fcsl_scalar_size(field->type),
                .instance = FCSL_NONE,
                .connected_from = FCSL_NONE,
                .unit = field->unit,
                .doc = "",
                .minimum = -INFINITY,
                .maximum = INFINITY,
            };
            count++;
        }
    }
    made->kept_begin[monitor->requirement_count] = count;
}

void fcsl_kept_gather(const struct fcsl_monitor_run *made, uint32_t index)
{
    const uint8_t *data = made->run->data;
    uint8_t *rows = (uint8_t *)made->rows;
    for (uint32_t i = made->kept_begin[index]; i < made->kept_begin[index + 1u]; i++) {
        const fcsl_field_t *field = &made->kept_fields[i];
        memcpy(rows + field->offset, data + made->kept[i].first, field->size);
        memcpy(rows + field->offset + FCSL_KEPT_LAST, data + made->kept[i].last, field->size);
    }
}

const fcsl_field_t *fcsl_run_kept_values(const fcsl_run_t *run, uint32_t index, uint32_t *count)
{
    const struct fcsl_monitor_run *made = run->monitor;
    *count = made->kept_begin[index + 1u] - made->kept_begin[index];
    return made->kept_fields + made->kept_begin[index];
}
