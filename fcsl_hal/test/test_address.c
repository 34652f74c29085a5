/* SPDX-License-Identifier: Apache-2.0
 *
 * What is taken for HOST:PORT, and which address it is.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_address.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <stdio.h>
#include <string.h>

#include "fcsl_check.h"

typedef struct {
    const char *text;
    const char *host; /* null: refused */
    uint16_t port;
} case_t;

static const case_t CASES[] = {
    {"127.0.0.1:7500", "127.0.0.1", 7500},
    {"0.0.0.0:0", "0.0.0.0", 0},
    {"10.1.2.3:65535", "10.1.2.3", 65535},
    {"10.1.2.3:00080", "10.1.2.3", 80},
    {"localhost:1", "127.0.0.1", 1},
    {"[::1]:7500", "::1", 7500},
    {"[fe80:1111:2222:3333:4444:5555:6666:7777]:65535", "fe80:1111:2222:3333:4444:5555:6666:7777", 65535},
    {"::1:7500", "::1", 7500},
    {"", NULL, 0},
    {":", NULL, 0},
    {":80", NULL, 0},
    {"[]:80", NULL, 0},
    {"[:80", NULL, 0},
    {"]:80", NULL, 0},
    {"127.0.0.1", NULL, 0},
    {"127.0.0.1:", NULL, 0},
    {"127.0.0.1:65536", NULL, 0},
    {"127.0.0.1:000080", NULL, 0},
    {"127.0.0.1:-1", NULL, 0},
    {"127.0.0.1:+1", NULL, 0},
    {"127.0.0.1: 1", NULL, 0},
    {"127.0.0.1:80x", NULL, 0},
    {"127.0.0.1:0x50", NULL, 0},
    {"127.0.0.1:http", NULL, 0},
    {"127.0.0.256:80", NULL, 0},
    {"[127.0.0.1:80", NULL, 0},
    {"[::1:80", NULL, 0},
    {"::1]:80", NULL, 0},
    {"localhost.:80", NULL, 0},
    {"example.com:80", NULL, 0},
};

static void test_cases(void)
{
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        const case_t *it = &CASES[i];
        struct sockaddr_storage address;
        socklen_t length = 0;
        char host[INET6_ADDRSTRLEN] = "";
        char port[8] = "";
        const int status = fcsl_address_read(it->text, &address, &length);
        if (status == 0) {
            CHECK(getnameinfo((struct sockaddr *)&address, length, host, sizeof host, port, sizeof port,
                              NI_NUMERICHOST | NI_NUMERICSERV) == 0);
        }
        if ((status == 0) != (it->host != NULL) ||
            (status == 0 && (strcmp(host, it->host) != 0 || strtol(port, NULL, 10) != it->port))) {
            (void)fprintf(stderr, "'%s' is read as '%s' port '%s'\n", it->text, host, port);
            CHECK(0);
        }
    }
}

int main(void)
{
    test_cases();
    return 0;
}
