/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `can`: its texts, the bits of signals against cantools, and the driver on an interface that is played here: this
 * program's socket, bind and ioctl give it a UDP socket, for which the kernel tells arrivals as it does for CAN.
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <math.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <netinet/in.h>
#include <stdarg.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "driver_rig.h"
#include "drivers/can/can_signal.h"
#include "drivers.h"

enum { FILTERS_MAX = 16, INDEX = 7 };

/* ---- the kernel's part -------------------------------------------------------------------------------------------------- */

static struct {
    int is_down;
    int fd; /* of the driver */
    struct sockaddr_in address; /* of its socket */
    struct can_filter filters[FILTERS_MAX];
    uint32_t filter_count;
    int takes_fd_frames;
    int index; /* of the interface */
    int error; /* of the next reception */
    int no_time; /* of arrival */
} kernel;

int socket(int domain, int type, int protocol)
{
    if (domain != AF_CAN) {
        return (int)syscall(SYS_socket, domain, type, protocol);
    }
    CHECK((type & ~(SOCK_NONBLOCK | SOCK_CLOEXEC)) == SOCK_RAW && protocol == CAN_RAW);
    socklen_t size = sizeof kernel.address;
    kernel.fd = (int)syscall(SYS_socket, AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    kernel.address = (struct sockaddr_in){.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    CHECK(kernel.fd >= 0 && syscall(SYS_bind, kernel.fd, &kernel.address, sizeof kernel.address) == 0);
    CHECK(syscall(SYS_getsockname, kernel.fd, &kernel.address, &size) == 0);
    return kernel.fd;
}

int bind(int fd, const struct sockaddr *address, socklen_t size)
{
    struct sockaddr_can can;
    CHECK(fd == kernel.fd && size == sizeof can && address->sa_family == AF_CAN);
    memcpy(&can, address, sizeof can);
    kernel.index = can.can_ifindex;
    return 0;
}

int setsockopt(int fd, int level, int name, const void *value, socklen_t size)
{
    if (level == SOL_CAN_RAW && name == CAN_RAW_FILTER) {
        CHECK(size <= sizeof kernel.filters && kernel.index == 0); /* set before a frame can come */
        memcpy(kernel.filters, value, size);
        kernel.filter_count = (uint32_t)(size / sizeof kernel.filters[0]);
        return 0;
    }
    if (level == SOL_CAN_RAW && name == CAN_RAW_FD_FRAMES) {
        memcpy(&kernel.takes_fd_frames, value, sizeof kernel.takes_fd_frames);
        return 0;
    }
    return kernel.no_time ? 0 : (int)syscall(SYS_setsockopt, fd, level, name, value, size);
}

int ioctl(int fd, unsigned long request, ...)
{
    va_list arguments;
    va_start(arguments, request);
    struct ifreq *interface = va_arg(arguments, struct ifreq *);
    va_end(arguments);
    if (strcmp(interface->ifr_name, "can0") != 0) {
        return (int)syscall(SYS_ioctl, fd, request, interface);
    }
    if (request == SIOCGIFHWADDR) {
        interface->ifr_hwaddr.sa_family = ARPHRD_CAN;
    } else if (request == SIOCGIFFLAGS) {
        interface->ifr_flags = kernel.is_down ? 0 : IFF_UP;
    } else {
        CHECK(request == SIOCGIFINDEX);
        interface->ifr_ifindex = INDEX;
    }
    return 0;
}

ssize_t recvmsg(int fd, struct msghdr *message, int flags)
{
    if (kernel.error != 0) {
        errno = kernel.error;
        return -1;
    }
    return syscall(SYS_recvmsg, fd, message, flags);
}

static void send_bytes(const void *bytes, size_t size)
{
    const int fd = (int)syscall(SYS_socket, AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    CHECK(fd >= 0);
    CHECK(syscall(SYS_sendto, fd, bytes, size, 0, &kernel.address, sizeof kernel.address) == (long)size);
    CHECK(close(fd) == 0);
}

static void send_frame(canid_t id, uint8_t length, uint8_t first)
{
    const struct can_frame frame = {.can_id = id, .len = length, .data = {first, 2, 3, 4, 5, 6, 7, 8}};
    send_bytes(&frame, sizeof frame);
}

/* ---- signals ------------------------------------------------------------------------------------------------------------ */

/* Made with cantools 45.1.0: random signals and frames; each as a DBC file `SG_ S : START|LENGTH@ORDER SIGN (SCALE,OFFSET)`, whose
 * message decodes the data to this value. */
static const struct {
    const char *text;
    const char *data;
    double value;
} VECTORS[] = {
    {"1A0/50:9@0+", "2530BB1D6D132CDE", 311.0},
    {"1A0/30:7@1+", "D91E3F721FCB1971", 125.0},
    {"1A0/37:9@0-*0.001", "493C9D5C3460BE31", -0.093},
    {"1A0/425:24@1-*-0.25+3.5",
     "C2764D2A5A4D767706F85D8690024AD6BDA3401BE9C8CBCCC935F6CD1F61226AE15338AE1A34004D33BA0D246AC04C81B1BAF23E3BF9EEF5F"
     "79F2B4934AF87F5",
     82468.5},
    {"1A0/18:33@0+*2+1000", "0D982E85BB55B672", 14006726338.0},
    {"1A0/228:32@1+*2+1000",
     "637ACD7466FCB60E0E8FF18463B0E4B2BA29703474F064AC68F700F5B02B3DC666F45BDEAA2CCAEDCD2B5157410E4DEE4AF2B34F430A07344"
     "7DE636C0E806C95",
     3636963678.0},
    {"1A0/333:16@0-*-0.25+3.5",
     "D6431FB5EAD7424D09E15D024C5848F23D1FA6F7361D7F618D1532E70E20E2A6668DE7F47E8467E546D53EC8E2A1257BDB256C9B3E4FBB498"
     "146EF7030CBF953",
     -5435.25},
    {"1A0/10:16@1-*0.001", "CEADD764B6", 13.803},
    {"1A0/46:7@0+", "ADEAE109C4A99720", 41.0},
    {"1A0/13:16@1+", "878B145C8A42D884", 57508.0},
    {"1A0/7:24@0-*0.1-40", "D92589082D852A71", -254669.5},
    {"1A0/15:24@1-*0.001", "05ADD58942167A38", -8055.893},
    {"1A0/6:24@0+*0.1-40", "679F9C6994E45B8A", 1358173.6},
    {"1A0/32:1@1+", "070961F37DE436DD", 1.0},
    {"1A0/11:7@0-*0.1-40", "86B8438F39BA76FE", -46.2},
    {"1A0/3:48@1-*0.1-40", "01FBE6CF9A48D5B0", -9557439749380.8},
    {"1A0/15:32@0+*-0.25+3.5", "00A6ADCB3D640694", -699101899.75},
    {"1A0/8:33@1+*0.001", "C727B8DB8C188F34", 2363209.767},
    {"1A0/19:31@0-*0.1-40", "88DFA161BFDB0ECC", 18546618.400000002},
    {"1A0/16:1@1-", "D9F2FA0025C8EFE5", 0.0},
    {"1A0/28:8@0+*0.1-40", "4D37EA2B14004077", -31.2},
    {"1A0/311:2@1+*0.1-40",
     "80DF3932249962C6857200059AEB8EA17CF3787E0ED29D1C0B63FFD7298374D9BD74FC11ADD7B9CA6503952269FD669F6376EE71879737FD5"
     "F72F8D51C4AC91B",
     -39.9},
    {"1A0/18:1@0-*0.001", "1A1E5EC9E6A03928", -0.001},
    {"1A0/24:32@1-*0.1-40", "EF109FC1BFA9E256", -49219220.7},
    {"1A0/10:1@0+*-0.25+3.5", "29B3D73F6AC2B69E", 3.5},
    {"1A0/6:7@1+*0.001", "64BEE462A5BAF20F", 0.121},
    {"1A0/4:48@0-*0.001", "201F836320ADB98B", 1082786383.213},
    {"1A0/33:2@1-*-0.25+3.5", "8D9801210C7736F3", 4.0},
    {"1A0/38:1@0+*0.1-40", "78A7A3EBB92865C8", -40.0},
    {"1A0/30:2@1+*2+1000", "A652DA3524", 1000.0},
    {"1A0/26:7@0-", "D7FFE4587744D5EB", 7.0},
    {"1A0/50:12@1-*-0.25+3.5", "D1919DD51A9FB6D4", -327.75},
    {"1A0/46:1@0+*0.1-40", "C8CF6803DE50D83A", -39.9},
    {"1A0/1:9@1+", "48CB2DBD574AB291", 420.0},
    {"1A0/8:12@0-", "C4FB659A4016F7A1", -1236.0},
    {"1A0/11:48@1-*2+1000", "5271CF64F25D6F15", -180493910198332.0},
    {"1A0/31:9@0+*0.1-40", "1513A53CC7E99CD7", -27.9},
    {"1A0/2:12@1+", "FAEE78E4EA5BF2CC", 3006.0},
    {"1A0/16:7@0-*-0.25+3.5", "DCBB2EE21414422A", -10.5},
    {"1A0/24:8@1-*0.1-40", "FB93547121B38151", -28.7},
    {"1A0/40:16@0+*-0.25+3.5", "12655DCE528EA7C0", -5364.5},
    {"1A0/14:24@1+*2+1000", "18B8E73581C9BE87", 635684.0},
    {"1A0/18:33@0-*-0.25+3.5", "A929E2755A189781", -659923333.75},
    {"1A0/0:32@1-", "714C94DDD5BA1843", -577483663.0},
    {"1A0/5:16@0+", "1B01B59B36B672D3", 27654.0},
    {"1A0/21:1@1+*-0.25+3.5", "786751A762C7A87A", 3.5},
    {"1A0/1:1@0-*0.001", "779D6CC827", -0.001},
    {"1A0/20:24@1-*-0.25+3.5", "6D76FF543829FB35", 1777327.75},
};

/* A frame with these hexadecimal bytes. */
static struct canfd_frame frame_of(canid_t id, const char *data)
{
    struct canfd_frame frame = {.can_id = id};
    for (const char *at = data; *at != '\0'; at += 2) {
        const char byte[] = {at[0], at[1], '\0'};
        CHECK(frame.len < CANFD_MAX_DLEN);
        frame.data[frame.len++] = (uint8_t)strtoul(byte, NULL, 16);
    }
    return frame;
}

static void check_vectors(void)
{
    for (size_t i = 0; i < sizeof VECTORS / sizeof VECTORS[0]; i++) {
        can_signal_t signal;
        double value = 0.0;
        const struct canfd_frame frame = frame_of(0x1A0, VECTORS[i].data);
        const char *end = can_signal_parse(VECTORS[i].text, &signal);
        CHECK(end != NULL && *end == '\0' && can_signal_take(&signal, &frame, &value) == 1);
        CHECK(fabs(value - VECTORS[i].value) <= 1e-15 * fabs(VECTORS[i].value));
    }
}

/* 64 bits, which a double does not hold to the last one, and the longest signals of the shortest frames. */
static void check_limits(void)
{
    static const struct {
        const char *text;
        const char *data;
        int taken;
        double value;
    } CASES[] = {{"1A0/0:64@1-", "0000000000000080", 1, -9223372036854775808.0},
                 {"1A0/0:64@1-", "FFFFFFFFFFFFFFFF", 1, -1.0},
                 {"1A0/0:64@1+", "FFFFFFFFFFFFFFFF", 1, 18446744073709551616.0},
                 {"1A0/7:64@0-", "8000000000000000", 1, -9223372036854775808.0},
                 {"1A0/7:64@0+", "0000000000000001", 1, 1.0},
                 {"1A0/7:64@0+", "00000000000001", 0, 0.0},
                 {"1A0/0:8@1+", "", 0, 0.0},
                 {"1A0/8:8@1+", "00FF", 1, 255.0},
                 {"1A0/8:9@1+", "00FF", 0, 0.0},
                 {"1A0/3:12@0+", "0123", 1, 291.0},
                 {"1A0/3:13@0+", "0123", 0, 0.0},
                 {"1A0/0:1@1-", "01", 1, -1.0},
                 {"1A1/0:1@1-", "01", 0, 0.0},
                 {"000001A0/0:1@1-", "01", 0, 0.0}};
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        can_signal_t signal;
        double value = 0.0;
        const struct canfd_frame frame = frame_of(0x1A0, CASES[i].data);
        CHECK(can_signal_parse(CASES[i].text, &signal) != NULL);
        CHECK(can_signal_take(&signal, &frame, &value) == CASES[i].taken && value == CASES[i].value);
    }
}

/* A length that no frame has reads nothing beyond it. */
static void check_wrong_length(void)
{
    can_signal_t signal;
    double value = 0.0;
    struct canfd_frame frame = {.can_id = 0x1A0, .len = 255};
    CHECK(can_signal_parse("1A0/511:1@1+", &signal) != NULL && can_signal_take(&signal, &frame, &value) == 0);
}

static void check_texts(void)
{
    can_signal_t signal;
    static const char *const WRONG[] = {"",
                                        "1A0",
                                        "1A0/",
                                        "1A0/0",
                                        "1A0/0:8",
                                        "1A0/0:8@",
                                        "1A0/0:8@1",
                                        "1A0/0:8@2+",
                                        "1A0/0:0@1+",
                                        "1A0/0:65@1+",
                                        "1A0/512:1@1+",
                                        "1A0/511:2@1+",
                                        "1A0/504:2@0+",
                                        "0x1A0/0:8@1+",
                                        "1A/0:8@1+",
                                        "1A00/0:8@1+",
                                        "800/0:8@1+",
                                        "20000000/0:8@1+",
                                        "1A0/-1:8@1+",
                                        "1A0/0:8@1+*",
                                        "1A0/0:8@1+*nan",
                                        "1A0/ 0:8@1+",
                                        "1A0/0:8@1+*inf",
                                        "1A0/0:8@1+*1e999",
                                        "1A0/0:8@1++",
                                        "1A0/0:8@1+- 1",
                                        "1A0|0:8@1+",
                                        "1A0/9999:8@1+"};
    for (size_t i = 0; i < sizeof WRONG / sizeof WRONG[0]; i++) {
        CHECK(can_signal_parse(WRONG[i], &signal) == NULL);
    }
    const char *text = "18FEF100/7:16@0-*-1e-3-40,";
    CHECK(can_signal_parse(text, &signal) == text + strlen(text) - 1);
    CHECK(signal.id == (0x18FEF100u | CAN_EFF_FLAG) && signal.start == 7u && signal.length == 16u);
    CHECK(signal.big_endian && signal.is_signed && signal.scale == -1e-3 && signal.offset == -40.0);
    text = "1a0/16:12@1++2.5";
    CHECK(can_signal_parse(text, &signal) == text + strlen(text));
    CHECK(signal.id == 0x1A0u && !signal.big_endian && !signal.is_signed && signal.scale == 1.0 &&
          signal.offset == 2.5);
}

/* ---- the driver --------------------------------------------------------------------------------------------------------- */

static void check_probe(void)
{
    const fcsl_driver_t *driver = &fcsl_driver_can;
    CHECK(rig_probes(driver, "can0:1A0/0:8@1+", FCSL_DRIVER_OK, ""));
    CHECK(rig_probes(driver, "", FCSL_DRIVER_ABSENT, "name the CAN interface"));
    CHECK(rig_probes(driver, "can9:1A0/0:8@1+", FCSL_DRIVER_ABSENT, "no interface 'can9'"));
    CHECK(rig_probes(driver, "lo:1A0/0:8@1+", FCSL_DRIVER_FAILED, "no CAN interface"));
    CHECK(rig_probes(driver, "can0", FCSL_DRIVER_FAILED, "behind a colon"));
    CHECK(rig_probes(driver, ":1A0/0:8@1+", FCSL_DRIVER_FAILED, "behind a colon"));
    CHECK(rig_probes(driver, "an_interface_name:1A0/0:8@1+", FCSL_DRIVER_FAILED, "behind a colon"));
    CHECK(rig_probes(driver, "can0:", FCSL_DRIVER_FAILED, "begins with no signal"));
    CHECK(rig_probes(driver, "can0:1A0/0:8@1+,", FCSL_DRIVER_FAILED, "'' begins with no signal"));
    CHECK(rig_probes(driver, "can0:1A0/0:8@1+;1A0/0:8@1+", FCSL_DRIVER_FAILED, "begins with no signal"));
    CHECK(rig_probes(driver,
                     "can0:1A0/0:1@1+,1A0/1:1@1+,1A0/2:1@1+,1A0/3:1@1+,1A0/4:1@1+,1A0/5:1@1+,1A0/6:1@1+,1A0/7:1@1+",
                     FCSL_DRIVER_OK, ""));
    CHECK(rig_probes(driver,
                     "can0:1A0/0:1@1+,1A0/1:1@1+,1A0/2:1@1+,1A0/3:1@1+,1A0/4:1@1+,1A0/5:1@1+,1A0/6:1@1+,1A0/7:1@1+,"
                     "1A0/8:1@1+",
                     FCSL_DRIVER_FAILED, "more than 8 signals"));
    kernel.is_down = 1;
    CHECK(rig_probes(driver, "can0:1A0/0:8@1+", FCSL_DRIVER_FAILED, "is down; ip link set can0 up"));
    kernel.is_down = 0;
}

static void open_device(rig_t *rig, const char *text, uint32_t needed)
{
    kernel.filter_count = 0;
    kernel.takes_fd_frames = 0;
    kernel.index = 0;
    CHECK(rig_open_needed(rig, &fcsl_driver_can, text, needed) == FCSL_DRIVER_OK);
    CHECK(kernel.index == INDEX && kernel.takes_fd_frames == 1);
}

static void check_open(void)
{
    static rig_t rig;
    CHECK(rig_open_needed(&rig, &fcsl_driver_can, "can0:1A0/0:8@1+,1A1/0:8@1+", 3) == FCSL_DRIVER_FAILED);
    CHECK(strstr(rig.why, "value2 is needed, and the device names 2 signals") != NULL);
    CHECK(rig_open_needed(&rig, &fcsl_driver_can, "can9:1A0/0:8@1+", 1) == FCSL_DRIVER_ABSENT);
    open_device(&rig, "can0:1A0/0:8@1+,18FEF100/0:8@1+", 2);
    CHECK(kernel.filter_count == 2);
    CHECK(kernel.filters[0].can_id == 0x1A0u);
    CHECK(kernel.filters[0].can_mask == (CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG));
    CHECK(kernel.filters[1].can_id == (0x18FEF100u | CAN_EFF_FLAG));
    CHECK(kernel.filters[1].can_mask == (CAN_EFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG));
    rig_close(&rig);
}

static int values_are(const rig_t *rig, double first, double second, double third)
{
    const double expected[] = {first, second, third};
    static const char *const NAMES[] = {"value0", "value1", "value2"};
    for (size_t i = 0; i < 3u; i++) {
        const double value = rig_value(rig, NAMES[i], 0);
        if (value != expected[i] && !(isnan(value) && isnan(expected[i]))) {
            return 0;
        }
    }
    return isnan(rig_value(rig, "value7", 0));
}

static void check_frames(void)
{
    static rig_t rig;
    const struct canfd_frame long_frame = {.can_id = 0x1A0, .len = 64, .data = {9, 2, 3}};
    const struct canfd_frame longer = {.can_id = 0x1A0, .len = 65, .data = {1, 1, 1}};
    open_device(&rig, "can0:1A0/0:8@1+,18FEF100/0:8@1-*0.5+1,1A0/16:8@1+", 3);
    CHECK(values_are(&rig, NAN, NAN, NAN));
    send_frame(0x1A0, 8, 255);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && values_are(&rig, 255.0, NAN, 3.0));
    send_frame(0x18FEF100u | CAN_EFF_FLAG, 1, 254);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && values_are(&rig, 255.0, 0.0, 3.0));
    /* None of these is a frame of the signals: others, a request, an error, one too short for value2, and odd messages. */
    send_frame(0x1A1, 8, 1);
    send_frame(0x18FEF100u, 8, 1);
    send_frame(0x1A0 | CAN_EFF_FLAG, 8, 1);
    send_frame(0x1A0 | CAN_RTR_FLAG, 8, 1);
    send_frame(0x1A0 | CAN_ERR_FLAG, 8, 1);
    send_frame(0x1A0, 2, 1);
    send_frame(0x1A0, 9, 1);
    send_bytes(&longer, sizeof longer);
    send_bytes(&long_frame, 20);
    send_bytes(&long_frame, 0);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING && values_are(&rig, 255.0, 0.0, 3.0));
    send_bytes(&long_frame, sizeof long_frame);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && values_are(&rig, 9.0, 0.0, 3.0));
    CHECK(rig_is_silent(&rig));
    rig_close(&rig);
}

/* What arrives is counted as the kernel hands it over; frames of others are not. */
static void check_counts(void)
{
    static rig_t rig;
    const struct canfd_frame long_frame = {.can_id = 0x1A0, .len = 64, .data = {9, 2, 3}};
    open_device(&rig, "can0:1A0/0:8@1+,1A0/16:8@1+,1A1/0:8@1+", 3);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING && rig.input.bytes == 0u && rig.input.why == FCSL_DRIVER_NOT_TOLD);
    send_frame(0x1A0, 8, 1);
    send_bytes(&long_frame, sizeof long_frame);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig_read(&rig) == FCSL_DRIVER_OK);
    CHECK(rig.input.bytes == CAN_MTU + CANFD_MTU && rig.input.frames == 2u);
    CHECK(rig.input.rejected == 0u && rig.input.why == FCSL_DRIVER_NOT_TOLD);
    send_frame(0x1A2, 0, 1);
    send_bytes(&long_frame, 20);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    CHECK(rig.input.bytes == CAN_MTU + CANFD_MTU + 20u && rig.input.rejected == 20u);
    CHECK(rig.input.why == FCSL_DRIVER_NO_FRAMES);
    send_frame(0x1A0, 2, 5); /* long enough for value0 alone */
    send_frame(0x1A1, 0, 5);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING && values_are(&rig, 9.0, 3.0, NAN));
    CHECK(rig.input.frames == 2u && rig.input.rejected == 20u + 2u * CAN_MTU);
    CHECK(rig.input.why == FCSL_DRIVER_SHORT_FRAMES);
    rig_close(&rig);
}

/* Frames that waited have the times of their arrival, not of their reading. */
static void check_arrival(void)
{
    enum { WAIT_MS = 30 };
    static rig_t rig;
    open_device(&rig, "can0:1A0/0:8@1+", 1);
    const uint64_t first_ns = fcsl_monotonic_ns();
    send_frame(0x1A0, 8, 1);
    const uint64_t between_ns = fcsl_monotonic_ns();
    fcsl_monotonic_wait(between_ns + WAIT_MS * FCSL_NS_PER_MS);
    const uint64_t second_ns = fcsl_monotonic_ns();
    send_frame(0x1A0, 8, 2);
    const uint64_t end_ns = fcsl_monotonic_ns();
    fcsl_monotonic_wait(end_ns + WAIT_MS * FCSL_NS_PER_MS);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig_value(&rig, "value0", 0) == 1.0);
    CHECK(rig.sample_ns + FCSL_NS_PER_MS > first_ns && rig.sample_ns < second_ns);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig_value(&rig, "value0", 0) == 2.0);
    CHECK(rig.sample_ns + FCSL_NS_PER_MS > second_ns && rig.sample_ns < end_ns + WAIT_MS * FCSL_NS_PER_MS);
    rig_close(&rig);
}

/* A kernel that tells no arrival. */
static void check_no_arrival(void)
{
    static rig_t rig;
    kernel.no_time = 1;
    open_device(&rig, "can0:1A0/0:8@1+", 1);
    kernel.no_time = 0;
    send_frame(0x1A0, 8, 1);
    const uint64_t before_ns = fcsl_monotonic_ns();
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig.sample_ns > before_ns && rig.sample_ns <= fcsl_monotonic_ns());
    rig_close(&rig);
}

static void check_errors(void)
{
    static rig_t rig;
    open_device(&rig, "can0:1A0/0:8@1+", 1);
    send_frame(0x1A0, 8, 1);
    kernel.error = ENETDOWN;
    CHECK(rig_read(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "Network is down") != NULL);
    kernel.error = ENODEV;
    CHECK(rig_read(&rig) == FCSL_DRIVER_ABSENT && strstr(rig.why, "No such device") != NULL);
    kernel.error = EAGAIN;
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    kernel.error = 0;
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    rig_close(&rig);
}

int main(void)
{
    check_vectors();
    check_limits();
    check_wrong_length();
    check_texts();
    check_probe();
    check_open();
    check_frames();
    check_counts();
    check_arrival();
    check_no_arrival();
    check_errors();
    return 0;
}
