/* SPDX-License-Identifier: Apache-2.0 */
#include "histogram_json.h"

#include <inttypes.h>

#include "fcsl/fcsl_vars.h"
#include "tick_stats.h"

void histogram_json(json_out_t *out, const char *name, const fcsl_histogram_t *histogram)
{
    fcsl_summary_t summary;
    fcsl_histogram_summary(histogram, &summary);
    fcsl_vars_begin(out, name);
    fcsl_vars_number(out, "count", summary.count);
    fcsl_vars_number(out, "p50", summary.p50);
    fcsl_vars_number(out, "p99", summary.p99);
    fcsl_vars_number(out, "p999", summary.p999);
    fcsl_vars_number(out, "max", summary.max);
    fcsl_json_raw(out, ",\"buckets\":[");
    const char *comma = "";
    for (uint32_t i = 0; i < FCSL_HISTOGRAM_BUCKETS; i++) {
        const uint64_t count = fcsl_tick_stats_get(&histogram->counts[i]);
        if (count > 0) {
            fcsl_json_raw(out, "%s[%" PRIu64 ",%" PRIu64 "]", comma, fcsl_histogram_end(i), count);
            comma = ",";
        }
    }
    fcsl_json_raw(out, "]");
    fcsl_vars_end(out);
}
