/* SPDX-License-Identifier: Apache-2.0
 *
 * HOST:PORT as a socket address.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_address.h"

#include <netdb.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { HOST_BYTES = 64, PORT_DIGITS = 5 };

int fcsl_address_read(const char *text, struct sockaddr_storage *address, socklen_t *length)
{
    const struct addrinfo hints = {.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV, .ai_socktype = SOCK_STREAM};
    struct addrinfo *found = NULL;
    char host[HOST_BYTES];
    const char *colon = strrchr(text, ':');
    size_t size = colon != NULL ? (size_t)(colon - text) : 0;
    const size_t digits = colon != NULL ? strspn(colon + 1, "0123456789") : 0;
    if (size >= 2 && text[0] == '[' && text[size - 1] == ']') {
        text++;
        size -= 2;
    }
    if (size == 0 || size >= sizeof host || digits == 0 || digits > PORT_DIGITS || colon[1 + digits] != '\0' ||
        strtol(colon + 1, NULL, 10) > UINT16_MAX) {
        return -1;
    }
    memcpy(host, text, size);
    host[size] = '\0';
    if (getaddrinfo(strcmp(host, "localhost") == 0 ? "127.0.0.1" : host, colon + 1, &hints, &found) != 0) {
        return -1;
    }
    memset(address, 0, sizeof *address);
    memcpy(address, found->ai_addr, found->ai_addrlen);
    *length = found->ai_addrlen;
    freeaddrinfo(found);
    return 0;
}
