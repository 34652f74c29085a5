/* SPDX-License-Identifier: Apache-2.0
 *
 * CDR begins with four bytes: its kind (0: plain; little-endian by the second), and options. A request without fields has a byte
 * of none, which some leave out.
 */
#define _POSIX_C_SOURCE 200809L
#include "service_message.h"

#include <string.h>

enum { HEADER = 4, LENGTH_AT = 8, TEXT_AT = 12 };

int service_request_read(uint8_t kind, const uint8_t *cdr, size_t size, int *value)
{
    if (size < HEADER || cdr[0] != 0 || cdr[1] > 1) {
        return -1;
    }
    *value = 1;
    if (kind == FCSL_SET_BOOL) {
        if (size <= HEADER || cdr[HEADER] > 1) {
            return -1;
        }
        *value = cdr[HEADER];
    }
    return 0;
}

size_t service_response_write(uint8_t cdr[SERVICE_RESPONSE_BYTES], const fcsl_service_answer_t *answer)
{
    const size_t length = strnlen(answer->message, sizeof answer->message - 1u);
    const uint32_t counted = (uint32_t)length + 1u; /* with the 0 */
    memset(cdr, 0, SERVICE_RESPONSE_BYTES);
    cdr[1] = 1;
    cdr[HEADER] = answer->success;
    for (uint32_t i = 0; i < sizeof counted; i++) {
        cdr[LENGTH_AT + i] = (uint8_t)(counted >> (8u * i));
    }
    memcpy(cdr + TEXT_AT, answer->message, length);
    return TEXT_AT + length + 1u;
}
