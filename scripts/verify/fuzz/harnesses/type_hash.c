/* SPDX-License-Identifier: Apache-2.0
 *
 * type_hash.h: the hash of a message definition. Input: the name of the type, a zero, the definition.
 */
#include "fuzz.h"
#include "messages/type_hash.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    char *text = take_text(&bytes);
    const size_t name = strlen(text);
    char hash[FCSL_TYPE_HASH_BYTES];
    const int status = fcsl_type_hash(text, name < size ? text + name + 1u : "", hash);
    FUZZ_CHECK(status == 0 ? strlen(hash) == FCSL_TYPE_HASH_BYTES - 1u : status == -1 && hash[0] == '\0');
    free(text);
    return 0;
}
