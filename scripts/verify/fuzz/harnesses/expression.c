/* SPDX-License-Identifier: Apache-2.0
 *
 * protocol.h: expressions over the fixture machine. The same text has the same value twice, and what it writes is JSON.
 */
#include "vars/protocol.h"
#include "vars_host.h"

static int evaluate(const catalog_t *catalog, const char *text, char *reply, size_t capacity)
{
    evaluated_t evaluated;
    fcsl_expression_error_t error;
    json_out_t out;
    fcsl_json_begin(&out, reply, capacity);
    if (fcsl_evaluate(text, catalog, fcsl_run_data(hosted.run), &evaluated, &error) != 0) {
        FUZZ_CHECK(error.at <= strlen(text) && error.text[0] != '\0' && error.hint != NULL && error.code[0] != '\0');
        return -1;
    }
    fcsl_evaluated_write(&evaluated, &out);
    FUZZ_CHECK(!out.overflow && out.at > 0);
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char first[2048];
    char second[2048];
    json_token_t tokens[4];
    json_t json;
    bytes_t bytes = {data, size < FCSL_EXPRESSION_BYTES_MAX ? size : FCSL_EXPRESSION_BYTES_MAX - 1u};
    char *text = take_text(&bytes);
    catalog_t catalog;
    hosted_open();
    const fcsl_vars_block_t block = hosted_block();
    FUZZ_CHECK(fcsl_catalog_open(&catalog, &block, 1, &hosted.history) == 0);
    const int status = evaluate(&catalog, text, first, sizeof first);
    FUZZ_CHECK(evaluate(&catalog, text, second, sizeof second) == status);
    if (status == 0) {
        FUZZ_CHECK(strcmp(first, second) == 0);
        FUZZ_CHECK(fcsl_json_parse(first, strlen(first), tokens, 4, &json) == NULL);
    }
    fcsl_catalog_free(&catalog);
    hosted_close();
    free(text);
    return 0;
}
