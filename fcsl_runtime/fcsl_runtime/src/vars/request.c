/* SPDX-License-Identifier: Apache-2.0
 *
 * Members of a request, and how it is refused.
 */
#include "request.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>

#include "value.h"

int fcsl_request_refuse(request_t *request, const char *code, const char *hint, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(request->error_message, sizeof request->error_message, format, arguments);
    va_end(arguments);
    (void)snprintf(request->error_code, sizeof request->error_code, "%s", code);
    (void)snprintf(request->error_hint, sizeof request->error_hint, "%.255s", hint);
    return -1;
}

const char *fcsl_request_text(request_t *request, const char *key, size_t capacity)
{
    const uint32_t token = fcsl_json_member(&request->json, 0, key);
    if (token == 0 || fcsl_json_string(&request->json, token, request->commander->text, capacity) != 0) {
        (void)fcsl_request_refuse(request, "bad_request", "", "this command needs a string \"%s\"", key);
        return NULL;
    }
    return request->commander->text;
}

int fcsl_request_number(request_t *request, const char *key, uint64_t max, uint64_t *number)
{
    const uint32_t index = fcsl_json_member(&request->json, 0, key);
    if (index == 0) {
        return 0;
    }
    const json_token_t *token = &request->json.tokens[index];
    uint64_t value = 0;
    for (uint32_t i = token->start; token->type == JSON_NUMBER && i < token->end && value <= max; i++) {
        const char c = request->json.text[i];
        const uint64_t digit = (uint64_t)(c - '0');
        value = c >= '0' && c <= '9' && value <= (UINT64_MAX - digit) / 10u ? value * 10u + digit : UINT64_MAX;
    }
    if (value == 0 || value > max) {
        return fcsl_request_refuse(request, "bad_request", "", "\"%s\" must be an integer from 1 to %" PRIu64, key,
                                   max);
    }
    *number = value;
    return 0;
}

int fcsl_request_flag(request_t *request, const char *key, int *flag)
{
    const uint32_t index = fcsl_json_member(&request->json, 0, key);
    const json_type_t type = index == 0 ? JSON_FALSE : request->json.tokens[index].type;
    *flag = type == JSON_TRUE;
    return type == JSON_TRUE || type == JSON_FALSE
               ? 0
               : fcsl_request_refuse(request, "bad_request", "", "\"%s\" must be true or false", key);
}

int fcsl_request_target(request_t *request, uint32_t token, target_t *target)
{
    const char *path = request->commander->text;
    const catalog_t *catalog = &request->commander->catalog;
    if (fcsl_json_string(&request->json, token, request->commander->text, PATH_BYTES_MAX) != 0) {
        return fcsl_request_refuse(request, "bad_request", "", "a path is a string of less than %d bytes",
                                   PATH_BYTES_MAX);
    }
    switch (fcsl_catalog_find(catalog, path, target)) {
    case TARGET_OK:
        return 0;
    case TARGET_INDEX: {
        char type[NAME_BYTES];
        fcsl_value_type(target->field, &target->view, type, sizeof type);
        return fcsl_request_refuse(request, "bad_index", target->entry->path, "'%s' does not name a part of %s", path,
                                   type);
    }
    default:
        return fcsl_request_refuse(request, "unknown_path", fcsl_catalog_nearest(catalog, path), "no field '%s'", path);
    }
}

int fcsl_request_paths(request_t *request, uint32_t max, uint32_t *token, uint32_t *count)
{
    *token = fcsl_json_member(&request->json, 0, "paths");
    *count = request->json.tokens[*token].count;
    if (*token == 0 || request->json.tokens[*token].type != JSON_ARRAY || *count == 0 || *count > max) {
        return fcsl_request_refuse(request, "bad_request", "",
                                   "this command needs \"paths\": a list of 1 to %" PRIu32 " paths", max);
    }
    *token += 1;
    return 0;
}
