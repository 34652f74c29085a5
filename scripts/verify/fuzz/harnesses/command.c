/* SPDX-License-Identifier: Apache-2.0
 *
 * protocol.h: one request line of the variable server after the other, on a machine. Each reply is one line, of JSON.
 */
#include "vars/protocol.h"
#include "vars_host.h"

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
    vars->protocol = (protocol_t){.history = &hosted.history,
                                  .host = &vars->host,
                                  .slot = &vars->slot,
                                  .counters = &vars->counters,
                                  .checkpoints = "/nonexistent", /* names are checked, and found nowhere */
                                  .secret = ""};
    FUZZ_CHECK(fcsl_slot_open(&vars->slot, 8u * TOKENS_MAX) == 0);
    FUZZ_CHECK(fcsl_catalog_open(&vars->protocol.catalog, &block, 1, &hosted.history) == 0);
    FUZZ_CHECK(fcsl_protocol_open(&vars->protocol) == 0 && fcsl_client_allocate(&vars->clients[0]) == 0);
}

static void serve(fcsl_vars_t *vars, const char *line, size_t length)
{
    static char reply[REPLY_BYTES];
    client_t *client = &vars->clients[0];
    json_out_t out;
    fcsl_json_begin(&out, reply, sizeof reply);
    const serve_status_t status = fcsl_protocol_serve(&vars->protocol, client, line, length, &out);
    FUZZ_CHECK(status == SERVE_REPLIED || status == SERVE_POSTED);
    if (status == SERVE_POSTED) {
        fcsl_vars_serve(vars);
        FUZZ_CHECK(fcsl_slot_take_back(&vars->slot));
        vars->protocol.ticks_left = 0; /* the host ends within a portion of them */
        fcsl_protocol_complete(&vars->protocol);
        fcsl_protocol_reply(&vars->protocol, client, &out);
    }
    check_reply(&out);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static fcsl_vars_t vars;
    bytes_t bytes = {data, size};
    hosted_open();
    if (vars.protocol.tokens == NULL) {
        open_once(&vars);
    }
    vars.host = hosted_host(); /* of this input's run */
    vars.protocol.snapshot_of = 0;
    vars.protocol.checkpoint.number = 0;
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
