/* SPDX-License-Identifier: Apache-2.0
 *
 * The command `authenticate`: compares tokens in constant time.
 */
#include <string.h>

#include "request.h"

/* The token itself, compared in a time that does not tell where it differs. */
int fcsl_handle_authenticate(request_t *request)
{
    const char *secret = request->commander->secret;
    const char *token = fcsl_request_text(request, "token", TOKEN_BYTES_MAX);
    if (token == NULL) {
        return -1;
    }
    const size_t length = strlen(secret);
    const size_t told = strlen(token);
    unsigned different = length != told;
    for (size_t i = 0; i < told; i++) {
        different |= (unsigned)((unsigned char)token[i] ^ (unsigned char)secret[length > 0 ? i % length : 0]);
    }
    if (different != 0 && length > 0) {
        return fcsl_request_refuse(request, "unauthorized", "", "this is not the token of this server");
    }
    request->session->trusted = 1;
    return 0;
}
