/* SPDX-License-Identifier: Apache-2.0
 *
 * Zenoh's sockets (zenoh-link-tcp and -tls 1.10) linger for 10 s: closing one whose peer is frozen blocks one of the two threads
 * that read for all sessions of the process, and so a flight, when two observers freeze. There is no setting for it. The linker
 * sends every setsockopt of a program here (--wrap, in CMakeLists.txt), and those that ask for these 10 s are left out.
 * test_bus_observers.c shows the effect.
 */
#define _GNU_SOURCE
#include <string.h>
#include <sys/socket.h>

enum { ZENOH_LINGER_S = 10 };

int __real_setsockopt(int fd, int level, int name, const void *value, socklen_t size);
int __wrap_setsockopt(int fd, int level, int name, const void *value, socklen_t size);

int __wrap_setsockopt(int fd, int level, int name, const void *value, socklen_t size)
{
    struct linger linger = {0};
    if (level == SOL_SOCKET && name == SO_LINGER && size == sizeof linger) {
        memcpy(&linger, value, sizeof linger);
        if (linger.l_onoff != 0 && linger.l_linger == ZENOH_LINGER_S) {
            return 0;
        }
    }
    return __real_setsockopt(fd, level, name, value, size);
}
