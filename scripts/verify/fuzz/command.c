/* SPDX-License-Identifier: Apache-2.0
 *
 * command.h: one request line of fcsl-fc's command server after the other, on a machine. Each reply is one line, of JSON.
 */
#include "command.h"
#include "hosted.h"

/* Short, so that a reply that does not fit is met, too. */
enum { REPLY_BYTES = 16384 };

static void check_reply(const char *reply, size_t size)
{
    static json_token_t tokens[REPLY_BYTES];
    json_t json;
    FUZZ_CHECK(size > 0 && size < REPLY_BYTES && memchr(reply, '\n', size) == reply + size - 1u);
    FUZZ_CHECK(json_parse(reply, size - 1u, tokens, REPLY_BYTES, &json) == NULL && json_member(&json, 0, "ok") != 0);
    const uint32_t error = json_member(&json, 0, "error");
    FUZZ_CHECK((json.tokens[json_member(&json, 0, "ok")].type == JSON_TRUE) == (error == 0));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    /* Buffers alone outlive an input: they are large, and what they hold is written before it is read. */
    static service_counters_t counters;
    static commander_t commander;
    static char reply[REPLY_BYTES];
    bytes_t bytes = {data, size};
    if (commander.tokens == NULL) {
        FUZZ_CHECK(commander_open(&commander, fcsl_machines[0], &hosted_mailbox, &counters) == 0);
    }
    hosted_open();
    while (bytes.left > 0) {
        const uint8_t *newline = memchr(bytes.at, '\n', bytes.left);
        size_t length = newline != NULL ? (size_t)(newline - bytes.at) : bytes.left;
        char *line = (char *)take_copy(&bytes, &length);
        check_reply(reply, commander_serve(&commander, line, length, reply, REPLY_BYTES));
        free(line);
        (void)take_number(&bytes, 1); /* the newline */
    }
    hosted_close();
    return 0;
}
