/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_ADDRESS_H
#define FCSL_ADDRESS_H

#include <sys/socket.h>

/* Reads HOST:PORT, both numeric: "127.0.0.1:7500", "[::1]:7500"; `localhost` is 127.0.0.1, and no other name is looked up.
 * 0, or -1 when it is none. */
int fcsl_address_read(const char *text, struct sockaddr_storage *address, socklen_t *length);

#endif /* FCSL_ADDRESS_H */
