/* SPDX-License-Identifier: Apache-2.0
 *
 * service_message.h: the request of a call of a service, and its response. Input: the kind of service, then the request; its
 * bytes are the text of the response, too.
 */
#include "fuzz.h"
#include "ros_graph/service_message.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    const uint8_t kind = (uint8_t)(take_number(&bytes, 1) & 1u);
    size_t length = bytes.left;
    uint8_t *request = take_copy(&bytes, &length);
    int value = -1;
    const int status = service_request_read(kind, request, length, &value);
    FUZZ_CHECK(status == -1 || (status == 0 && (value == 0 || value == 1) && length >= 4u));
    fcsl_service_answer_t answer = {.success = (uint8_t)(length & 1u)};
    memcpy(answer.message, request, length < sizeof answer.message ? length : sizeof answer.message);
    uint8_t response[SERVICE_RESPONSE_BYTES];
    const size_t written = service_response_write(response, &answer);
    FUZZ_CHECK(written <= sizeof response && response[4] == answer.success && response[written - 1u] == 0);
    FUZZ_CHECK(strlen((char *)response + 12) + 13u == written);
    free(request);
    return 0;
}
