/* SPDX-License-Identifier: Apache-2.0
 *
 * The least that a server can do: whatever comes over the connection, so many bytes go back, and a newline.
 *
 *   echo SOCKET BYTES
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>

static int fail(const char *what)
{
    perror(what);
    return 1;
}

int main(int argc, char **argv)
{
    static char bytes[4096];
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const size_t size = argc == 3 ? strtoul(argv[2], NULL, 10) : 0;
    if (size == 0 || size > sizeof bytes || strlen(argv[1]) >= sizeof address.sun_path) {
        (void)fprintf(stderr, "usage: echo SOCKET BYTES\n");
        return 2;
    }
    (void)strcpy(address.sun_path, argv[1]);
    const int listening = socket(AF_UNIX, SOCK_STREAM, 0);
    if (listening < 0 || bind(listening, (struct sockaddr *)&address, sizeof address) != 0 ||
        listen(listening, 1) != 0) {
        return fail(argv[1]);
    }
    const int client = accept(listening, NULL, NULL);
    while (client >= 0 && recv(client, bytes, sizeof bytes, 0) > 0) {
        bytes[size - 1] = '\n';
        if (send(client, bytes, size, MSG_NOSIGNAL) < 0) {
            return fail("echo");
        }
    }
    return client >= 0 ? 0 : fail("accept");
}
