/* SPDX-License-Identifier: Apache-2.0
 *
 * When a client of the variable server is dropped: at the bounds of its times. The source is compiled in.
 */
#include "vars/client.c"

#include "fcsl_check.h"

#define SECOND UINT64_C(1000000000)

static client_t fresh(char *in)
{
    return (client_t){.fd = 3, .in = in, .unread_since_ns = 7u * SECOND};
}

static void test_what_is_not_read(void)
{
    char in[8] = "";
    client_t client = fresh(in);
    client.unread_since_ns = 0;
    client.out_to = 10;
    client.unsent_since_ns = 3u * SECOND;
    CHECK(fcsl_client_overdue(&client, 3u * SECOND) == NULL);
    CHECK(fcsl_client_overdue(&client, (3u + UNSENT_MAX_S) * SECOND) == NULL);
    CHECK(strstr(fcsl_client_overdue(&client, (3u + UNSENT_MAX_S) * SECOND + 1u), "left unread for 5 s") != NULL);
    client.unsent_since_ns = 0; /* all was sent */
    CHECK(fcsl_client_overdue(&client, 1000u * SECOND) == NULL);
}

static void test_what_does_not_come(void)
{
    const uint64_t last = (7u + UNREAD_MAX_S) * SECOND;
    char in[8] = "{\"cmd\"";
    client_t client = fresh(in);
    client.received = 6;
    CHECK(fcsl_client_overdue(&client, last) == NULL);
    CHECK(strstr(fcsl_client_overdue(&client, last + 1u), "no complete request came for 10 s") != NULL);
    in[5] = '\n'; /* the server has not come to it */
    CHECK(fcsl_client_overdue(&client, last + 1u) == NULL);
    in[5] = '"';
    in[6] = '\n'; /* of an earlier request */
    CHECK(fcsl_client_overdue(&client, last + 1u) != NULL);
}

/* As long as it is the server who keeps the client waiting. */
static void test_who_waits_for_the_server(void)
{
    const uint64_t late = (8u + UNREAD_MAX_S) * SECOND;
    char in[8] = "";
    client_t client = fresh(in);
    client.has_command = 1;
    CHECK(fcsl_client_overdue(&client, late) == NULL);
    client = fresh(in);
    client.blocked = 1;
    CHECK(fcsl_client_overdue(&client, late) == NULL);
    client = fresh(in);
    client.out_from = 5;
    client.out_to = 5u + SAMPLES_BYTES_MAX;
    CHECK(fcsl_client_overdue(&client, late) != NULL);
    client.out_to++; /* so much that no request is taken before it has read some */
    CHECK(fcsl_client_overdue(&client, late) == NULL);
    client = fresh(in);
    client.unread_since_ns = 0; /* it has said all that it began */
    CHECK(fcsl_client_overdue(&client, late) == NULL);
}

int main(void)
{
    test_what_is_not_read();
    test_what_does_not_come();
    test_who_waits_for_the_server();
    return 0;
}
