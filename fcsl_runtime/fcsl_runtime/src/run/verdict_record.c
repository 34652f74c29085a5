/* SPDX-License-Identifier: Apache-2.0
 *
 * Puts the verdicts on requirements into the recording of a run, when one changes.
 */
#include "monitor_run.h"
#include "requirements.h"

fcsl_verdict_table_t fcsl_monitor_table(const fcsl_run_t *run)
{
    const struct fcsl_monitor_run *made = run->monitor;
    return made != NULL ? (fcsl_verdict_table_t){.monitor = made->monitor,
                                                 .kept = made->kept_fields,
                                                 .kept_begin = made->kept_begin}
                        : (fcsl_verdict_table_t){0};
}

void fcsl_monitor_record(fcsl_run_t *run)
{
    if (run->monitor != NULL) {
        run->monitor->is_noted = 0;
    }
}

static fcsl_verdict_row_t row_of(const struct fcsl_monitor_run *made, uint32_t index)
{
    const uint8_t *data = made->run->data;
    const fcsl_results_t *at = &made->results[index];
    const uint8_t holds = data[at->holds];
    const uint64_t violations = fcsl_result_count(data, at->violations);
    const uint64_t exercised = fcsl_result_count(data, at->exercised);
    const uint8_t verdict = fcsl_verdict_status(&made->monitor->requirements[index],
                                                fcsl_result_asked(made, data, index), holds, exercised, violations);
    return (fcsl_verdict_row_t){.violations = violations, .verdict = verdict, .holds = holds};
}

/* Those of the last violations, behind the rows. */
static void put_values(const struct fcsl_monitor_run *made)
{
    const uint32_t count = made->monitor->requirement_count;
    uint8_t *out = (uint8_t *)(made->noted + count);
    for (uint32_t i = 0; i < made->kept_begin[count]; i++) {
        memcpy(out + (size_t)i * FCSL_VERDICT_VALUE_BYTES, made->run->data + made->kept[i].last,
               made->kept_fields[i].size);
    }
}

__attribute__((hot)) void fcsl_monitor_note(fcsl_run_t *run, uint64_t tick)
{
    struct fcsl_monitor_run *made = run->monitor;
    int changed = !made->is_noted;
    for (uint32_t i = 0; i < made->monitor->requirement_count; i++) {
        const fcsl_verdict_row_t row = row_of(made, i);
        fcsl_verdict_row_t *noted = &made->noted[i];
        changed = changed || row.violations != noted->violations || row.verdict != noted->verdict ||
                  row.holds != noted->holds;
        *noted = row;
    }
    if (changed) {
        put_values(made);
        /* What found no room comes with the next tick. */
        made->is_noted =
            fcsl_recorder_verdicts(run->recorder, fcsl_run_stamp(run, tick), (const uint8_t *)made->noted) == 0;
    }
}
