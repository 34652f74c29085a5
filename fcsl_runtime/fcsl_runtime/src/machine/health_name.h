/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_HEALTH_NAME_H
#define FCSL_HEALTH_NAME_H

#include "fcsl/fcsl_machine.h"

/* "nominal", "degraded", "failed", "stale"; "" for a number that is no health. */
static inline const char *fcsl_health_name(int32_t health)
{
    static const char *const names[] = {"nominal", "degraded", "failed", "stale"};
    return health >= FCSL_NOMINAL && health <= FCSL_STALE ? names[health] : "";
}

#endif /* FCSL_HEALTH_NAME_H */
