/* SPDX-License-Identifier: Apache-2.0
 *
 * HOST:PORT as a socket address.
 */
#ifndef FCSL_ADDRESS_H
#define FCSL_ADDRESS_H

#include <sys/socket.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Reads HOST:PORT, both numeric: "127.0.0.1:7500", "[::1]:7500"; `localhost` is 127.0.0.1, and no other name is looked up.
 * 0, or -1 when it is none. */
int fcsl_address_read(const char *text, struct sockaddr_storage *address, socklen_t *length);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_ADDRESS_H */
