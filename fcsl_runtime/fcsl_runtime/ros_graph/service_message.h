/* SPDX-License-Identifier: Apache-2.0
 *
 * Requests and responses of std_srvs/srv/Trigger and SetBool as CDR.
 */
#ifndef FCSL_SERVICE_MESSAGE_H
#define FCSL_SERVICE_MESSAGE_H

#include <stddef.h>
#include <stdint.h>

#include "fcsl/fcsl_service_input.h"

enum { SERVICE_REQUEST_BYTES = 64, SERVICE_RESPONSE_BYTES = 272 };

/* The value that a call of a SetBool has; 1 of a Trigger. 0, or -1: no CDR of its type. */
int service_request_read(uint8_t kind, const uint8_t *cdr, size_t size, int *value);

/* Returns its bytes. */
size_t service_response_write(uint8_t cdr[SERVICE_RESPONSE_BYTES], const fcsl_service_answer_t *answer);

#endif /* FCSL_SERVICE_MESSAGE_H */
