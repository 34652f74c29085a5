/* SPDX-License-Identifier: Apache-2.0
 *
 * commander.h: one request line of the variable server after the other, on a machine. Each reply is one line, of JSON.
 */
#include "vars/commander.h"
#include "hosted.h"

/* Short, so that a reply that does not fit is met, too. */
enum { REPLY_BYTES = 16384 };

static void check_reply(const json_out_t *out)
{
    static json_token_t tokens[REPLY_BYTES];
    json_t json;
    const char *newline = memchr(out->text, '\n', out->at);
    FUZZ_CHECK(!out->overflow && out->at > 0 && newline == out->text + out->at - 1u);
    FUZZ_CHECK(fcsl_json_parse(out->text, out->at - 1u, tokens, REPLY_BYTES, &json) == NULL);
    FUZZ_CHECK(fcsl_json_member(&json, 0, "ok") != 0);
    const uint32_t error = fcsl_json_member(&json, 0, "error");
    FUZZ_CHECK((json.tokens[fcsl_json_member(&json, 0, "ok")].type == JSON_TRUE) == (error == 0));
}

/* Buffers alone outlive an input: they are large, and what they hold is written before it is read. */
static void open_once(fcsl_vars_t *vars)
{
    static fcsl_vars_block_t block;
    block = hosted_block();
    vars->history = &hosted.history;
    vars->commander = (commander_t){.history = &hosted.history,
                                    .host = &vars->host,
                                    .mailbox = &vars->mailbox,
                                    .counters = &vars->counters,
                                    .checkpoints = "/nonexistent", /* names are checked, and found nowhere */
                                    .secret = ""};
    FUZZ_CHECK(fcsl_mailbox_open(&vars->mailbox, 8u * TOKENS_MAX) == 0);
    FUZZ_CHECK(fcsl_catalog_open(&vars->commander.catalog, &block, 1, &hosted.history) == 0);
    FUZZ_CHECK(fcsl_commander_open(&vars->commander) == 0 && fcsl_client_allocate(&vars->clients[0]) == 0);
}

static void serve(fcsl_vars_t *vars, const char *line, size_t length)
{
    static char reply[REPLY_BYTES];
    session_t *session = &vars->clients[0].session;
    json_out_t out;
    fcsl_json_begin(&out, reply, sizeof reply);
    const serving_t serving = fcsl_commander_serve(&vars->commander, session, line, length, &out);
    FUZZ_CHECK(serving == SERVED || serving == POSTED);
    if (serving == POSTED) {
        fcsl_vars_serve(vars);
        FUZZ_CHECK(fcsl_mailbox_done(&vars->mailbox));
        vars->commander.ticks_left = 0; /* the host ends within a portion of them */
        fcsl_commander_complete(&vars->commander);
        fcsl_commander_finish(&vars->commander, session, &out);
    }
    check_reply(&out);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static fcsl_vars_t vars;
    bytes_t bytes = {data, size};
    hosted_open();
    if (vars.commander.tokens == NULL) {
        open_once(&vars);
    }
    vars.host = hosted_host(); /* of this input's run */
    vars.commander.snapshot_of = 0;
    vars.commander.kept.number = 0;
    fcsl_client_begin(&vars.clients[0], -1, 1, 0);
    while (bytes.left > 0) {
        const uint8_t *newline = memchr(bytes.at, '\n', bytes.left);
        size_t length = newline != NULL ? (size_t)(newline - bytes.at) : bytes.left;
        char *line = (char *)take_copy(&bytes, &length);
        serve(&vars, line, length);
        free(line);
        (void)take_number(&bytes, 1); /* the newline */
    }
    hosted_close();
    return 0;
}
