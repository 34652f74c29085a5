/* SPDX-License-Identifier: Apache-2.0
 *
 * Every limit of the variable server that a client can meet. docs/reference/variables.md shows this table (test/test_limits.py).
 */
#ifndef FCSL_VARS_LIMITS_H
#define FCSL_VARS_LIMITS_H

enum {
    CLIENTS_MAX = 64, /* clients at a time */
    UNTRUSTED_MAX = 16, /* clients that have not sent the token yet: of more the oldest is dropped */
    REQUEST_BYTES_MAX = 64 * 1024, /* bytes of a request */
    REPLY_BYTES_MAX = 512 * 1024, /* bytes of a reply */
    REQUESTS_PER_TURN = 4, /* requests of one client before the others have their turn */
    BAD_IN_A_ROW_MAX = 16, /* requests in a row that are no JSON: then the client is dropped */
    UNREAD_MAX_S = 10, /* seconds for a client's first request, and for the rest of one that it has begun */
    UNSENT_MAX_S = 5, /* seconds in which a client takes nothing of what is sent to it */
    SILENCE_MAX_S = 20, /* seconds after which a TCP client whose computer is gone is dropped */
    JSON_DEPTH_MAX = 16, /* lists and objects of a request inside each other */
    ID_BYTES = 64, /* bytes of an `id`, as written */
    PATH_BYTES_MAX = 256, /* bytes of a path, with the 0 that ends it */
    PATHS_MAX = 256, /* paths of one `get` */
    WRITES_MAX = 1024, /* separate pieces of memory that one `set` writes */
    TICKS_MAX = 1000000, /* ticks of one `tick` */
    SUBSCRIPTIONS_MAX = 4, /* subscriptions of a client */
    SUBSCRIBED_MAX = 64, /* paths of a subscription */
    SAMPLE_BYTES_MAX = 16 * 1024, /* bytes of a sample */
    SAMPLES_BYTES_MAX = 64 * 1024, /* bytes of samples that a client has not read yet */
    FILE_BYTES = 128 /* bytes of the name of a checkpoint's file, with the 0 that ends it */
};

#endif /* FCSL_VARS_LIMITS_H */
