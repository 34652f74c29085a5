/* SPDX-License-Identifier: Apache-2.0
 *
 * When the configuration is sent: at the start, before data packets 1, 2, 4, 8, ..., and when it has not been for 10 s.
 */
#ifndef FCSL_TELEMETRY_RESEND_H
#define FCSL_TELEMETRY_RESEND_H

#include <stdint.h>

#define RESEND_NS UINT64_C(10000000000)

typedef struct {
    uint64_t next;    /* data packet that it is sent before */
    uint64_t sent_ns; /* when it last was */
} resend_t;

/* The start. */
static inline resend_t fcsl_resend_begin(uint64_t now_ns)
{
    return (resend_t){.next = 1, .sent_ns = now_ns};
}

/* Whether it is sent now, when data packet `sequence` is to come; `before`: that packet is sent next. */
static inline int fcsl_resend_due(resend_t *resend, uint64_t sequence, int before, uint64_t now_ns)
{
    const int scheduled = before && sequence == resend->next;
    if (scheduled) {
        resend->next *= 2;
    }
    if (!scheduled && now_ns - resend->sent_ns < RESEND_NS) {
        return 0;
    }
    resend->sent_ns = now_ns;
    return 1;
}

#endif /* FCSL_TELEMETRY_RESEND_H */
