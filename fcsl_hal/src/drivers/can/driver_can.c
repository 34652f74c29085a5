/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `can`: values in the frames of a CAN interface of Linux (SocketCAN). Its device is
 * `IFACE:SIGNAL[,SIGNAL…]`, 8 signals at most (can_signal.h): `can0:1A0/0:16@1+*0.01,1A0/16:12@1-*0.1-40`.
 *
 * Each frame of one of the signals is a sample; values that other frames carry stay as they were, NaN before the first one. So signals
 * whose frames may stop independently belong to devices of their own.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_driver.h"

#include <errno.h>
#include <inttypes.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <math.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"
#include "can_signal.h"

enum { SIGNALS_MAX = 8 };

typedef struct {
    char interface[IFNAMSIZ];
    can_signal_t signals[SIGNALS_MAX];
    uint32_t count;
} device_t;

typedef struct {
    double values[SIGNALS_MAX];
    fcsl_driver_input_t input;
    device_t device;
    int fd;
    uint64_t last_ns; /* of the last sample */
} can_t;

#define VALUE(index_)                                                                                                  \
    {.name = "value" #index_,                                                                                          \
     .type = FCSL_F64,                                                                                                 \
     .count = 1,                                                                                                       \
     .offset = offsetof(can_t, values) + (index_) * sizeof(double),                                                    \
     .unit = "",                                                                                                       \
     .doc = "of signal " #index_ " in the device's text, counted from 0"}

static const fcsl_driver_signal_t signals[SIGNALS_MAX] = {VALUE(0), VALUE(1), VALUE(2), VALUE(3),
                                                          VALUE(4), VALUE(5), VALUE(6), VALUE(7)};

/* ---- the device's text -------------------------------------------------------------------------------------------------- */

static int parse_signals(const char *text, device_t *device, char *why, size_t size)
{
    for (const char *next = text; next != NULL; device->count++) {
        if (device->count == SIGNALS_MAX) {
            (void)snprintf(why, size, "more than %d signals: '%s'", SIGNALS_MAX, next);
            return -1;
        }
        const char *end = can_signal_parse(next, &device->signals[device->count]);
        if (end == NULL || (*end != '\0' && *end != ',')) {
            (void)snprintf(why, size, "'%s' begins with no signal; one is 1A0/16:12@1-*0.1-40", next);
            return -1;
        }
        next = *end == ',' ? end + 1 : NULL;
    }
    return 0;
}

static fcsl_driver_status_t parse(const char *text, device_t *device, char *why, size_t size)
{
    const size_t length = strcspn(text, ":");
    *device = (device_t){.count = 0};
    if (text[0] == '\0') {
        (void)snprintf(why, size, "name the CAN interface and the signals: can0:1A0/16:12@1-*0.1-40");
        return FCSL_DRIVER_ABSENT;
    }
    if (length == 0u || length >= sizeof device->interface || text[length] == '\0') {
        (void)snprintf(why, size, "'%s' is no CAN interface with signals behind a colon", text);
        return FCSL_DRIVER_FAILED;
    }
    memcpy(device->interface, text, length);
    return parse_signals(text + length + 1, device, why, size) == 0 ? FCSL_DRIVER_OK : FCSL_DRIVER_FAILED;
}

/* ---- the interface ------------------------------------------------------------------------------------------------------ */

static struct ifreq request_of(const char *interface)
{
    struct ifreq request = {.ifr_ifindex = 0};
    (void)snprintf(request.ifr_name, sizeof request.ifr_name, "%s", interface);
    return request;
}

/* Whether the interface is there, of the right kind, and up. Any socket answers. */
static fcsl_driver_status_t check_interface(int fd, const char *interface, char *why, size_t size)
{
    struct ifreq request = request_of(interface);
    if (ioctl(fd, SIOCGIFHWADDR, &request) != 0) {
        (void)snprintf(why, size, "there is no interface '%s': %s", interface, strerror(errno));
        return FCSL_DRIVER_ABSENT;
    }
    if (request.ifr_hwaddr.sa_family != ARPHRD_CAN) {
        (void)snprintf(why, size, "'%s' is no CAN interface", interface);
        return FCSL_DRIVER_FAILED;
    }
    request = request_of(interface);
    if (ioctl(fd, SIOCGIFFLAGS, &request) != 0 || (request.ifr_flags & IFF_UP) == 0) {
        (void)snprintf(why, size, "'%s' is down; ip link set %s up type can bitrate 500000", interface, interface);
        return FCSL_DRIVER_FAILED;
    }
    return FCSL_DRIVER_OK;
}

static fcsl_driver_status_t probe_can(const char *text, char *why, size_t size)
{
    device_t device;
    fcsl_driver_status_t status = parse(text, &device, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0); /* there may be no CAN in the kernel yet */
    if (fd < 0) {
        (void)snprintf(why, size, "no socket: %s", strerror(errno));
        return FCSL_DRIVER_FAILED;
    }
    status = check_interface(fd, device.interface, why, size);
    (void)close(fd);
    return status;
}

/* Lets through what carries a signal, data frames of 8 or of 64 bytes, each with the time of its arrival. 0, or -1 with errno. */
static int set_up(int fd, const device_t *device)
{
    struct can_filter filters[SIGNALS_MAX];
    const int on = 1;
    for (uint32_t i = 0; i < device->count; i++) {
        const canid_t id = device->signals[i].id;
        const canid_t mask = (id & CAN_EFF_FLAG) != 0u ? CAN_EFF_MASK : CAN_SFF_MASK;
        filters[i] = (struct can_filter){.can_id = id, .can_mask = mask | CAN_EFF_FLAG | CAN_RTR_FLAG};
    }
    const socklen_t filter_size = (socklen_t)(device->count * sizeof filters[0]);
    return setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters, filter_size) == 0 &&
                   setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) == 0 &&
                   setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) == 0
               ? 0
               : -1;
}

/* 0, or -1 with errno. */
static int bind_to(int fd, const char *interface)
{
    struct ifreq request = request_of(interface);
    if (ioctl(fd, SIOCGIFINDEX, &request) != 0) {
        return -1;
    }
    const struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = request.ifr_ifindex};
    return bind(fd, (const struct sockaddr *)&address, sizeof address);
}

static int needs_missing(const device_t *device, const uint8_t *used, char *why, size_t size)
{
    for (uint32_t i = device->count; i < SIGNALS_MAX; i++) {
        if (used[i] == FCSL_DRIVER_NEEDED) {
            (void)snprintf(why, size, "value%" PRIu32 " is needed, and the device names %" PRIu32 " signals", i,
                           device->count);
            return 1;
        }
    }
    return 0;
}

static fcsl_driver_status_t open_can(void *self, const char *text, const uint8_t *used, char *why, size_t size)
{
    can_t *can = self;
    fcsl_driver_status_t status = parse(text, &can->device, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    if (needs_missing(&can->device, used, why, size)) {
        return FCSL_DRIVER_FAILED;
    }
    can->fd = socket(AF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (can->fd < 0) {
        (void)snprintf(why, size, "no CAN socket: %s", strerror(errno));
        return FCSL_DRIVER_FAILED;
    }
    status = check_interface(can->fd, can->device.interface, why, size);
    if (status == FCSL_DRIVER_OK &&
        (set_up(can->fd, &can->device) != 0 || bind_to(can->fd, can->device.interface) != 0)) {
        (void)snprintf(why, size, "cannot listen to '%s': %s", can->device.interface, strerror(errno));
        status = FCSL_DRIVER_FAILED;
    }
    if (status != FCSL_DRIVER_OK) {
        (void)close(can->fd);
        return status;
    }
    for (uint32_t i = 0; i < SIGNALS_MAX; i++) {
        can->values[i] = (double)NAN;
    }
    return FCSL_DRIVER_OK;
}

/* ---- read --------------------------------------------------------------------------------------------------------------- */

static uint64_t ns_of(const struct timespec *time)
{
    return (uint64_t)time->tv_sec * FCSL_NS_PER_S + (uint64_t)time->tv_nsec;
}

/* The kernel tells arrivals in CLOCK_REALTIME: the frame's age in it gives the monotonic time. A clock that was set back meanwhile
 * gives no age. */
static uint64_t arrival_ns(struct msghdr *message)
{
    struct timespec arrived = {0};
    struct timespec real = {0};
    const uint64_t now_ns = fcsl_monotonic_ns();
    const struct cmsghdr *header = CMSG_FIRSTHDR(message);
    if (header == NULL || header->cmsg_level != SOL_SOCKET || header->cmsg_type != SCM_TIMESTAMPNS ||
        header->cmsg_len < CMSG_LEN(sizeof arrived)) {
        return now_ns;
    }
    memcpy(&arrived, CMSG_DATA(header), sizeof arrived);
    (void)clock_gettime(CLOCK_REALTIME, &real);
    const uint64_t age_ns = ns_of(&real) > ns_of(&arrived) ? ns_of(&real) - ns_of(&arrived) : 0u;
    return age_ns < now_ns ? now_ns - age_ns : 0u;
}

static void reject(fcsl_driver_input_t *input, uint32_t bytes, uint32_t why)
{
    input->rejected += bytes;
    input->why = why > input->why ? why : input->why;
}

/* The bytes of a message, with its frame and time; 0 where none came, -1 with errno. Short or odd messages are no frames. */
static int receive(can_t *can, struct canfd_frame *frame, uint64_t *time_ns)
{
    union {
        struct cmsghdr header;
        uint8_t bytes[CMSG_SPACE(sizeof(struct timespec))];
    } control = {.bytes = {0}};
    struct iovec part = {.iov_base = frame, .iov_len = sizeof *frame};
    struct msghdr message = {
        .msg_iov = &part, .msg_iovlen = 1, .msg_control = &control, .msg_controllen = sizeof control};
    const ssize_t size = recvmsg(can->fd, &message, MSG_DONTWAIT);
    if (size < 0) {
        return errno == EAGAIN || errno == EINTR ? 0 : -1;
    }
    *time_ns = arrival_ns(&message);
    const int is_classic = size == CAN_MTU && frame->len <= CAN_MAX_DLEN;
    if (is_classic || (size == CANFD_MTU && frame->len <= CANFD_MAX_DLEN)) {
        return (int)size;
    }
    can->input.bytes += (uint32_t)size;
    reject(&can->input, (uint32_t)size, FCSL_DRIVER_NO_FRAMES);
    return 0;
}

/* Whether the frame, a message of so many bytes, carries one of the signals. A frame that is too short for one of its signals is
 * dropped, and counted. */
static int take_frame(can_t *can, const struct canfd_frame *frame, uint32_t bytes)
{
    double values[SIGNALS_MAX];
    int is_ours = 0;
    int is_short = 0;
    memcpy(values, can->values, sizeof values);
    for (uint32_t i = 0; i < can->device.count; i++) {
        const can_signal_t *signal = &can->device.signals[i];
        if (signal->id == frame->can_id) {
            is_ours = 1;
            is_short = is_short || !can_signal_take(signal, frame, &values[i]);
        }
    }
    if (!is_ours) {
        return 0;
    }
    can->input.bytes += bytes;
    if (is_short) {
        reject(&can->input, bytes, FCSL_DRIVER_SHORT_FRAMES);
        return 0;
    }
    can->input.frames++;
    memcpy(can->values, values, sizeof values);
    return 1;
}

static fcsl_driver_status_t judge_error(const can_t *can, char *why, size_t size)
{
    const int code = errno;
    (void)snprintf(why, size, "cannot read '%s': %s", can->device.interface, strerror(code));
    return code == ENODEV || code == ENXIO ? FCSL_DRIVER_ABSENT : FCSL_DRIVER_FAILED;
}

static fcsl_driver_status_t read_can(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    can_t *can = self;
    const uint64_t deadline_ns = fcsl_monotonic_ns() + (uint64_t)FCSL_DRIVER_WAIT_MS * FCSL_NS_PER_MS;
    while (fcsl_monotonic_ns() < deadline_ns) {
        struct canfd_frame frame = {0};
        uint64_t time_ns = 0;
        struct pollfd wait = {.fd = can->fd, .events = POLLIN};
        const struct timespec left = fcsl_time_left(deadline_ns);
        const int ready = ppoll(&wait, 1, &left, NULL);
        const int got = ready > 0 ? receive(can, &frame, &time_ns) : ready;
        if (got < 0 && errno != EINTR) {
            return judge_error(can, why, size);
        }
        if (got > 0 && take_frame(can, &frame, (uint32_t)got)) {
            can->last_ns = time_ns > can->last_ns ? time_ns : can->last_ns + 1u; /* samples keep their order */
            *sample_ns = can->last_ns;
            return FCSL_DRIVER_OK;
        }
    }
    return FCSL_DRIVER_NOTHING;
}

static void close_can(void *self)
{
    (void)close(((can_t *)self)->fd);
}

const fcsl_driver_t fcsl_driver_can = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "can",
    .doc = "values in CAN frames, as in a DBC file: can:IFACE:SIGNAL[,SIGNAL...], a signal is 1A0/16:12@1-*0.1-40",
    .direction = FCSL_SENSOR,
    .signals = signals,
    .signal_count = SIGNALS_MAX,
    .state_size = sizeof(can_t),
    .state_align = _Alignof(can_t),
    .waits = 1,
    .input = offsetof(can_t, input),
    .probe = probe_can,
    .open = open_can,
    .read = read_can,
    .close = close_can,
};
