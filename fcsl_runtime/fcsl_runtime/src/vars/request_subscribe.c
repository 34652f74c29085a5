/* SPDX-License-Identifier: Apache-2.0
 *
 * subscribe and unsubscribe; samples are sent by the server as publications come (subscription.h).
 */
#include <inttypes.h>
#include <string.h>

#include "protocol.h"

/* Fills the paths; -1 after a refusal. */
static int read_paths(request_t *request, subscription_t *subscription)
{
    uint32_t token = 0;
    uint32_t count = 0;
    if (fcsl_request_paths(request, SUBSCRIBED_MAX, &token, &count) != 0) {
        return -1;
    }
    for (uint32_t i = 0; i < count; i++) {
        if (fcsl_request_target(request, token, &subscription->targets[i]) != 0) {
            return -1;
        }
        strcpy(subscription->paths + (size_t)i * PATH_BYTES_MAX, request->protocol->text);
        token = request->json.tokens[token].next;
    }
    subscription->count = count;
    return 0;
}

static int read_format(request_t *request, int *binary)
{
    const uint32_t token = fcsl_json_member(&request->json, 0, "format");
    const char *format = token == 0 ? "json" : fcsl_request_text(request, "format", NAME_BYTES);
    if (format == NULL) {
        return -1;
    }
    *binary = strcmp(format, "binary") == 0;
    return *binary || strcmp(format, "json") == 0
               ? 0
               : fcsl_request_refuse(request, "bad_request", "json", "\"format\" must be \"json\" or \"binary\"");
}

int fcsl_handle_subscribe(request_t *request)
{
    subscription_t *subscription = NULL;
    uint32_t number = 0;
    for (uint32_t i = 0; i < SUBSCRIPTIONS_MAX && subscription == NULL; i++) {
        number = i + 1u;
        subscription = request->client->subscriptions[i].number == 0 ? &request->client->subscriptions[i] : NULL;
    }
    if (subscription == NULL) {
        return fcsl_request_refuse(request, "too_many_subscriptions", "unsubscribe",
                                   "a client has at most %d subscriptions", SUBSCRIPTIONS_MAX);
    }
    subscription->every = 1;
    subscription->lost = 0;
    if (read_paths(request, subscription) != 0 ||
        fcsl_request_number(request, "every", UINT32_MAX, &subscription->every) != 0 ||
        read_format(request, &subscription->binary) != 0 || fcsl_request_snapshot(request) != 0) {
        return -1;
    }
    subscription->bytes = fcsl_subscription_bytes(subscription);
    if (subscription->bytes > SAMPLE_BYTES_MAX) {
        return fcsl_request_refuse(request, "too_large", subscription->binary ? "" : "binary",
                                   "a sample may have %zu bytes, more than %d: divide the paths among subscriptions%s",
                                   subscription->bytes, SAMPLE_BYTES_MAX,
                                   subscription->binary ? "" : ", or ask for \"format\":\"binary\"");
    }
    fcsl_subscription_begin(subscription, request->protocol->moment.tick);
    subscription->number = number;
    fcsl_json_raw(request->out, ",\"tick\":%" PRIu64 ",\"subscription\":%" PRIu32, request->protocol->moment.tick,
                  number);
    return 0;
}

int fcsl_handle_unsubscribe(request_t *request)
{
    uint64_t number = 0;
    if (fcsl_request_number(request, "subscription", SUBSCRIPTIONS_MAX, &number) != 0) {
        return -1;
    }
    if (number == 0 || request->client->subscriptions[number - 1u].number == 0) {
        return fcsl_request_refuse(request, "bad_request", "", "this client has no such \"subscription\"");
    }
    request->client->subscriptions[number - 1u].number = 0;
    fcsl_json_raw(request->out, ",\"lost\":%" PRIu64, request->client->subscriptions[number - 1u].lost);
    return 0;
}
