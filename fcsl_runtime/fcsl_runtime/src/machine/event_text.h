/* SPDX-License-Identifier: Apache-2.0
 *
 * The values of an event as text.
 */
#ifndef FCSL_EVENT_TEXT_H
#define FCSL_EVENT_TEXT_H

#include "scalar_text.h"

/* A value of fcsl_event_t: "3", "0.1", "true", "degraded"; a NaN is "nan". */
void fcsl_event_value_text(uint8_t type, uint64_t bits, char text[SCALAR_TEXT_BYTES]);

#endif /* FCSL_EVENT_TEXT_H */
