/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `iio_buffer` with a tree of files that stands for sysfs, configfs and /dev. A FIFO is the character device.
 */
#define _GNU_SOURCE
#include <inttypes.h>
#include <stdint.h>

#include "drivers/iio/iio_scan.h"
#include "sysfs_rig.h"

#define DEVICES "bus/iio/devices/"
#define IMU     DEVICES "iio:device3/"
#define SCAN    IMU "scan_elements/"
#define FIFO    "dev/iio:device3"
#define TIMERS  "config/iio/triggers/hrtimer"

enum { SCAN_BYTES_MAX = 64, AXES = 3, WIDTHS = 4, TEXT_BYTES = 64, BYTE_BITS = 8 };

static const fcsl_driver_t *const iio_buffer = &fcsl_driver_iio_buffer;
static const char *const ACCEL[AXES] = {"in_accel_x", "in_accel_y", "in_accel_z"};
static const uint32_t BITS[WIDTHS] = {8, 16, 32, 64};
static int device; /* the end of the FIFO that the kernel writes */

/* ---- tree --------------------------------------------------------------------------------------------------------------- */

static void put_element(const char *name, uint32_t index, const char *type)
{
    char path[TREE_BYTES];
    char text[TEXT_BYTES];
    CHECK(snprintf(path, sizeof path, SCAN "%s_index", name) > 0);
    CHECK(snprintf(text, sizeof text, "%" PRIu32 "\n", index) > 0);
    put(path, text);
    CHECK(snprintf(path, sizeof path, SCAN "%s_type", name) > 0);
    CHECK(snprintf(text, sizeof text, "%s\n", type) > 0);
    put(path, text);
    CHECK(snprintf(path, sizeof path, SCAN "%s_en", name) > 0);
    put(path, "0\n");
}

static int is_enabled(const char *name)
{
    char path[TREE_BYTES];
    CHECK(snprintf(path, sizeof path, SCAN "%s_en", name) > 0);
    return has(path, "1");
}

/* Accelerations in 0.5 m/s^2 after an offset of 1, temperatures in 0.1 degrees. Its scan: x, y, z, temperature, timestamp. */
static void make_device(void)
{
    CHECK(setenv("FCSL_DEV", in_tree("dev"), 1) == 0 && setenv("FCSL_CONFIGFS", in_tree("config"), 1) == 0);
    put(IMU "name", "imu\n");
    put(IMU "current_timestamp_clock", "realtime\n");
    put(IMU "sampling_frequency", "12\n");
    put(IMU "in_accel_scale", "0.5\n");
    put(IMU "in_accel_offset", "1\n");
    put(IMU "in_temp_scale", "100\n");
    put(IMU "buffer/enable", "0\n");
    put(IMU "buffer/length", "2\n");
    put(IMU "buffer/watermark", "64\n");
    put(IMU "trigger/current_trigger", "\n");
    for (uint32_t i = 0; i < AXES; i++) {
        put_element(ACCEL[i], i, "le:s16/16>>0");
    }
    put_element("in_temp", AXES, "be:s12/16>>4");
    put_element("in_anglvel_z", AXES + 1, "le:s16/16>>0");
    put_element("in_timestamp", AXES + 2, "le:s64/64>>0");
    put(DEVICES "trigger0/name", "imu-dev3\n");
    put(FIFO, "");
    CHECK(unlink(in_tree(FIFO)) == 0 && mkfifo(in_tree(FIFO), 0644) == 0);
    device = open(in_tree(FIFO), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    CHECK(device >= 0);
}

/* ---- set-up ------------------------------------------------------------------------------------------------------------- */

static void check_set_up(void)
{
    rig_t rig;
    CHECK(probes(iio_buffer, "imu@200", FCSL_DRIVER_OK, ""));
    put(SCAN "in_anglvel_z_en", "1\n"); /* left by another program */
    put(IMU "buffer/enable", "1\n");
    CHECK(rig_open(&rig, iio_buffer, "imu@200", "accel temperature") == FCSL_DRIVER_OK);
    CHECK(has(IMU "current_timestamp_clock", "monotonic") && has(IMU "sampling_frequency", "200"));
    CHECK(has(IMU "trigger/current_trigger", "imu-dev3"));
    CHECK(has(IMU "buffer/length", "128") && has(IMU "buffer/watermark", "1") && has(IMU "buffer/enable", "1"));
    CHECK(is_enabled("in_accel_x") && is_enabled("in_accel_y") && is_enabled("in_accel_z"));
    CHECK(is_enabled("in_temp") && is_enabled("in_timestamp") && !is_enabled("in_anglvel_z"));
    rig_close(&rig);
    CHECK(has(IMU "buffer/enable", "0"));
    CHECK(rig_open(&rig, iio_buffer, "imu@12.5", "temperature") == FCSL_DRIVER_OK);
    CHECK(is_enabled("in_temp") && !is_enabled("in_accel_x") && has(IMU "sampling_frequency", "12.5"));
    rig_close(&rig);
}

static void check_triggers(void)
{
    rig_t rig;
    put(DEVICES "trigger1/name", "loop\n");
    CHECK(rig_open(&rig, iio_buffer, "imu@100,trigger=loop", "accel") == FCSL_DRIVER_OK);
    CHECK(has(IMU "trigger/current_trigger", "loop") && has(IMU "sampling_frequency", "100"));
    rig_close(&rig);
    put(DEVICES "trigger1/sampling_frequency", "1\n");
    CHECK(rig_open(&rig, iio_buffer, "imu@50,trigger=loop", "accel") == FCSL_DRIVER_OK);
    CHECK(has(DEVICES "trigger1/sampling_frequency", "50") && has(IMU "sampling_frequency", "100"));
    rig_close(&rig);
    CHECK(rig_open_fails(iio_buffer, "imu@50,trigger=none", "accel", FCSL_DRIVER_FAILED, "no IIO trigger is called"));
    put(DEVICES "trigger0/name", "imu-trigger\n");
    CHECK(rig_open(&rig, iio_buffer, "imu@60", "accel") == FCSL_DRIVER_OK);
    CHECK(has(IMU "trigger/current_trigger", "imu-trigger") && has(IMU "sampling_frequency", "60"));
    rig_close(&rig);
    remove_below(DEVICES "trigger1");
}

static void check_timers(void)
{
    rig_t rig;
    put(DEVICES "trigger0/name", "other-dev0\n");
    CHECK(rig_open_fails(iio_buffer, "imu@400", "accel", FCSL_DRIVER_FAILED, "iio-trig-hrtimer"));
    put(TIMERS "/x", "");
    CHECK(rig_open_fails(iio_buffer, "imu@400", "accel", FCSL_DRIVER_FAILED, "no IIO trigger is called 'fcsl-3'"));
    CHECK(rmdir(in_tree(TIMERS "/fcsl-3")) == 0);
    put(DEVICES "trigger7/name", "fcsl-3\n"); /* which the kernel makes */
    put(DEVICES "trigger7/sampling_frequency", "100\n");
    for (int i = 0; i < 2; i++) { /* made, and found */
        CHECK(rig_open(&rig, iio_buffer, "imu@400", "accel") == FCSL_DRIVER_OK);
        CHECK(has(IMU "trigger/current_trigger", "fcsl-3") && has(DEVICES "trigger7/sampling_frequency", "400"));
        CHECK(has(IMU "sampling_frequency", "60"));
        rig_close(&rig);
        CHECK(access(in_tree(TIMERS "/fcsl-3"), F_OK) == 0);
    }
    remove_below(DEVICES "trigger7");
    put(DEVICES "trigger0/name", "imu-dev3\n");
}

/* Devices with a FIFO take no trigger, and some have a rate for each type of channels. */
static void check_without_trigger(void)
{
    rig_t rig;
    CHECK(rename(in_tree(IMU "trigger"), in_tree("trigger")) == 0);
    CHECK(rig_open(&rig, iio_buffer, "imu@833", "accel") == FCSL_DRIVER_OK);
    CHECK(has(IMU "sampling_frequency", "833"));
    rig_close(&rig);
    CHECK(rig_open_fails(iio_buffer, "imu@833,trigger=imu-dev3", "accel", FCSL_DRIVER_FAILED, "takes no trigger"));
    CHECK(unlink(in_tree(IMU "sampling_frequency")) == 0);
    CHECK(rig_open_fails(iio_buffer, "imu@833", "accel", FCSL_DRIVER_FAILED, "no sampling_frequency"));
    put(IMU "in_accel_sampling_frequency", "1\n");
    put(IMU "in_anglvel_sampling_frequency", "1\n");
    CHECK(rig_open(&rig, iio_buffer, "imu@25", "accel") == FCSL_DRIVER_OK);
    CHECK(has(IMU "in_accel_sampling_frequency", "25") && has(IMU "in_anglvel_sampling_frequency", "1\n"));
    rig_close(&rig);
    CHECK(unlink(in_tree(IMU "in_accel_sampling_frequency")) == 0);
    put(IMU "sampling_frequency", "12\n");
    CHECK(rename(in_tree("trigger"), in_tree(IMU "trigger")) == 0);
}

static void check_refusals(void)
{
    static const struct {
        const char *text;
        const char *reason;
    } CASES[] = {{"monotonic", "current_timestamp_clock"},
                 {"imu-dev3", "trigger/current_trigger"},
                 {"200", "sampling_frequency"},
                 {"128", "buffer/length"},
                 {"1", "scan_elements/in_accel_x_en"},
                 {"0", "buffer/enable"}};
    for (uint32_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        refused = CASES[i].text;
        CHECK(rig_open_fails(iio_buffer, "imu@200", "accel", FCSL_DRIVER_FAILED, CASES[i].reason));
    }
    refused = NULL;
    CHECK(rename(in_tree(IMU "current_timestamp_clock"), in_tree("clock")) == 0);
    CHECK(rig_open_fails(iio_buffer, "imu@200", "accel", FCSL_DRIVER_FAILED, "no current_timestamp_clock"));
    CHECK(rename(in_tree("clock"), in_tree(IMU "current_timestamp_clock")) == 0);
    CHECK(rename(in_tree(FIFO), in_tree("fifo")) == 0);
    CHECK(rig_open_fails(iio_buffer, "imu@200", "accel", FCSL_DRIVER_FAILED, "cannot open"));
    CHECK(rename(in_tree("fifo"), in_tree(FIFO)) == 0);
    CHECK(rename(in_tree(SCAN "in_timestamp_index"), in_tree("index")) == 0);
    CHECK(rig_open_fails(iio_buffer, "imu@200", "accel", FCSL_DRIVER_FAILED, "no timestamps"));
    CHECK(rename(in_tree("index"), in_tree(SCAN "in_timestamp_index")) == 0);
    put_element("in_timestamp", AXES + 2, "le:u64/64>>0");
    CHECK(rig_open_fails(iio_buffer, "imu@200", "accel", FCSL_DRIVER_FAILED, "timestamp"));
    put_element("in_timestamp", AXES + 2, "le:s64/64>>0");
    CHECK(rig_open_fails(iio_buffer, "imu@200", "accel pressure", FCSL_DRIVER_FAILED, "no channel for pressure"));
    CHECK(has(IMU "buffer/enable", "0\n") || has(IMU "buffer/enable", "0"));
}

static void check_names(void)
{
    static const char *const BAD[] = {"",        "imu",     "imu@",     "imu@0",     "imu@-5",           "imu@nan",
                                      "imu@1e9", "imu@5Hz", "imu@0x10", "imu@1e400", "imu,trigger=x@200"};
    char path[TREE_BYTES];
    char long_name[2000];
    for (uint32_t i = 0; i < sizeof BAD / sizeof BAD[0]; i++) {
        CHECK(probes(iio_buffer, BAD[i], FCSL_DRIVER_FAILED, "rate"));
        CHECK(rig_open_fails(iio_buffer, BAD[i], "accel", FCSL_DRIVER_FAILED, "rate"));
    }
    memset(long_name, 'x', sizeof long_name);
    long_name[sizeof long_name - 1u] = '\0';
    CHECK(probes(iio_buffer, long_name, FCSL_DRIVER_FAILED, "DEVICE@HZ"));
    memcpy(long_name, "imu@200,trigger=", 16);
    CHECK(probes(iio_buffer, long_name, FCSL_DRIVER_FAILED, "DEVICE@HZ"));
    CHECK(probes(iio_buffer, "none@200", FCSL_DRIVER_ABSENT, "there are: imu"));
    /* A path may have @; the folder's true name has the number. */
    CHECK(mkdir(in_tree("soc@0"), 0755) == 0 && symlink(in_tree(DEVICES "iio:device3"), in_tree("soc@0/imu")) == 0);
    CHECK(snprintf(path, sizeof path, "%s@200", in_tree("soc@0/imu")) > 0);
    rig_t rig;
    CHECK(probes(iio_buffer, path, FCSL_DRIVER_OK, "") && rig_open(&rig, iio_buffer, path, "accel") == FCSL_DRIVER_OK);
    rig_close(&rig);
    CHECK(snprintf(path, sizeof path, "%s@200", in_tree("bus")) > 0);
    CHECK(rig_open_fails(iio_buffer, path, "accel", FCSL_DRIVER_FAILED, "no IIO device"));
}

/* ---- scans -------------------------------------------------------------------------------------------------------------- */

/* Puts the lowest `bytes` bytes of a word at `at`. */
static void store(uint8_t *at, uint64_t word, uint32_t bytes, int big_endian)
{
    for (uint32_t i = 0; i < bytes; i++) {
        at[big_endian ? bytes - 1u - i : i] = (uint8_t)(word >> (BYTE_BITS * i));
    }
}

static void send(const uint8_t *scan, uint32_t size)
{
    CHECK(write(device, scan, size) == (ssize_t)size);
}

/* A scan of accelerations and temperature as make_device describes it. */
static uint32_t fill(uint8_t *scan, int16_t x, int16_t y, int16_t z, int16_t temperature, int64_t time_ns)
{
    memset(scan, 0xA5, 16);
    store(scan, (uint16_t)x, 2, 0);
    store(scan + 2, (uint16_t)y, 2, 0);
    store(scan + 4, (uint16_t)z, 2, 0);
    store(scan + 6, (uint64_t)(temperature * 16) | 0x5u, 2, 1); /* 12 bits above 4 others */
    store(scan + 8, (uint64_t)time_ns, 8, 0);
    return 16;
}

static void check_values(void)
{
    uint8_t scan[SCAN_BYTES_MAX];
    rig_t rig;
    const int64_t now_ns = (int64_t)fcsl_monotonic_ns();
    CHECK(rig_open(&rig, iio_buffer, "imu@200", "accel temperature") == FCSL_DRIVER_OK);
    send(scan, fill(scan, 19, -21, INT16_MIN, -300, now_ns - 20));
    send(scan, fill(scan, 1, 2, 3, 2047, now_ns - 10));
    send(scan, fill(scan, 1, 2, 3, -2048, now_ns));
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig.sample_ns == (uint64_t)now_ns - 20u);
    CHECK(value_at(&rig, "accel", 0) == 10.0 && value_at(&rig, "accel", 1) == -10.0);
    CHECK(value_at(&rig, "accel", 2) == -16383.5 && is_near(value_at(&rig, "temperature", 0), -30.0));
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig.sample_ns == (uint64_t)now_ns - 10u); /* one scan per read */
    CHECK(is_near(value_at(&rig, "temperature", 0), 204.7));
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && is_near(value_at(&rig, "temperature", 0), -204.8));
    const uint64_t before_ns = fcsl_monotonic_ns();
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    CHECK(fcsl_monotonic_ns() - before_ns >= (uint64_t)FCSL_DRIVER_WAIT_MS * FCSL_NS_PER_MS - FCSL_NS_PER_MS);
    rig_close(&rig);
}

static void check_optional_signals(void)
{
    uint8_t scan[SCAN_BYTES_MAX];
    rig_t rig;
    CHECK(rig_open(&rig, iio_buffer, "imu@200", "accel temperature? pressure?") == FCSL_DRIVER_OK);
    send(scan, fill(scan, 1, 2, 3, 10, (int64_t)fcsl_monotonic_ns()));
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && value_at(&rig, "accel", 0) == 1.0);
    CHECK(is_near(value_at(&rig, "temperature", 0), 1.0) && isnan(value_at(&rig, "pressure", 0)));
    rig_close(&rig);
}

static void check_torn_scans(void)
{
    uint8_t scan[SCAN_BYTES_MAX];
    rig_t rig;
    const int64_t now_ns = (int64_t)fcsl_monotonic_ns();
    CHECK(rig_open(&rig, iio_buffer, "imu@200", "accel temperature") == FCSL_DRIVER_OK);
    for (uint32_t part = 1; part < 16u; part++) {
        CHECK(fill(scan, 1, 2, 3, 4, now_ns) == 16u);
        send(scan, part);
        CHECK(rig_read(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "instead of 16") != NULL);
    }
    send(scan, fill(scan, 5, 6, 7, 8, now_ns));
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && value_at(&rig, "accel", 0) == 3.0);
    rig_close(&rig);
}

static void check_timestamps(void)
{
    uint8_t scan[SCAN_BYTES_MAX];
    rig_t rig;
    const int64_t now_ns = (int64_t)fcsl_monotonic_ns();
    const int64_t BAD[] = {0, -1, INT64_MIN, INT64_MAX, now_ns, now_ns - 1, now_ns + (int64_t)3600 * FCSL_NS_PER_S};
    CHECK(rig_open(&rig, iio_buffer, "imu@200", "accel temperature") == FCSL_DRIVER_OK);
    send(scan, fill(scan, 1, 2, 3, 4, now_ns));
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    for (uint32_t i = 0; i < sizeof BAD / sizeof BAD[0]; i++) {
        send(scan, fill(scan, 9, 9, 9, 9, BAD[i]));
        CHECK(rig_read(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "timestamp") != NULL);
    }
    send(scan, fill(scan, 1, 2, 3, 4, now_ns + 1));
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig.sample_ns == (uint64_t)now_ns + 1u);
    rig_close(&rig);
    put_element("in_timestamp", AXES + 2, "be:s64/64>>0");
    CHECK(rig_open(&rig, iio_buffer, "imu@200", "accel temperature") == FCSL_DRIVER_OK);
    CHECK(fill(scan, 1, 2, 3, 4, 0) == 16u);
    store(scan + 8, (uint64_t)now_ns, 8, 1);
    send(scan, 16);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig.sample_ns == (uint64_t)now_ns);
    rig_close(&rig);
    put_element("in_timestamp", AXES + 2, "le:s64/64>>0");
}

/* The end of what a file stands for is that of the device. */
static void check_end(void)
{
    uint8_t scan[SCAN_BYTES_MAX];
    rig_t rig;
    CHECK(rename(in_tree(FIFO), in_tree("fifo")) == 0);
    put_bytes(FIFO, scan, fill(scan, 3, 2, 1, 0, (int64_t)fcsl_monotonic_ns()));
    CHECK(rig_open(&rig, iio_buffer, "imu@200", "accel temperature") == FCSL_DRIVER_OK);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && value_at(&rig, "accel", 0) == 2.0);
    CHECK(rig_read(&rig) == FCSL_DRIVER_ABSENT && strstr(rig.why, "buffer: ") != NULL);
    rig_close(&rig);
    CHECK(rename(in_tree("fifo"), in_tree(FIFO)) == 0);
}

/* ---- layouts ------------------------------------------------------------------------------------------------------------ */

/* Three axes of any widths, in an order that is not that of their names; written one after the other. */
static void check_layout(const uint32_t *bits, const uint32_t *order)
{
    char type[TEXT_BYTES];
    uint8_t scan[SCAN_BYTES_MAX];
    uint32_t end = 0;
    rig_t rig;
    memset(scan, 0xA5, sizeof scan);
    for (uint32_t i = 0; i < AXES; i++) {
        const uint32_t axis = order[i];
        const uint32_t bytes = bits[axis] / BYTE_BITS;
        const int big_endian = axis == 1u;
        CHECK(snprintf(type, sizeof type, "%s:s%" PRIu32 "/%" PRIu32 ">>0", big_endian ? "be" : "le", bits[axis],
                       bits[axis]) > 0);
        put_element(ACCEL[axis], 2u * i, type);
        while (end % bytes != 0u) {
            end++;
        }
        store(scan + end, (uint64_t)(-100 + (int64_t)axis), bytes, big_endian);
        end += bytes;
    }
    while (end % 8u != 0u) {
        end++;
    }
    const uint64_t time_ns = fcsl_monotonic_ns();
    store(scan + end, time_ns, 8, 0);
    CHECK(rig_open(&rig, iio_buffer, "imu@200", "accel") == FCSL_DRIVER_OK);
    send(scan, end + 8u);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig.sample_ns == time_ns);
    for (uint32_t axis = 0; axis < AXES; axis++) {
        CHECK(value_at(&rig, "accel", axis) == (-100.0 + axis + 1.0) * 0.5);
    }
    rig_close(&rig);
}

static void check_layouts(void)
{
    static const uint32_t ORDERS[][AXES] = {{0, 1, 2}, {2, 0, 1}, {2, 1, 0}};
    put_element("in_timestamp", 100, "le:s64/64>>0");
    for (uint32_t i = 0; i < WIDTHS * WIDTHS * WIDTHS; i++) {
        const uint32_t bits[AXES] = {BITS[i % WIDTHS], BITS[i / WIDTHS % WIDTHS], BITS[i / WIDTHS / WIDTHS]};
        for (uint32_t k = 0; k < sizeof ORDERS / sizeof ORDERS[0]; k++) {
            check_layout(bits, ORDERS[k]);
        }
    }
    for (uint32_t i = 0; i < AXES; i++) {
        put_element(ACCEL[i], i, "le:s16/16>>0");
    }
    put_element("in_timestamp", AXES + 2, "le:s64/64>>0");
}

/* Without a timestamp, the scan is padded to its largest element. */
static void check_padding(void)
{
    iio_element_t elements[] = {{.index = 7, .bytes = 1}, {.index = 2, .bytes = 4}, {.index = 3, .bytes = 2}};
    CHECK(iio_lay_out(elements, 3) == 8u);
    CHECK(elements[0].offset == 0u && elements[1].offset == 4u && elements[2].offset == 6u && elements[2].index == 7u);
    iio_element_t other[] = {{.index = 0, .bytes = 2}, {.index = 1, .bytes = 8}, {.index = 2, .bytes = 1}};
    CHECK(iio_lay_out(other, 3) == 24u && other[1].offset == 8u && other[2].offset == 16u);
}

/* ---- numbers ------------------------------------------------------------------------------------------------------------ */

/* Numbers of all bits at all places, among others that are all 0 or all 1. */
static void check_number(uint32_t storage, uint32_t bits, uint32_t shift, int is_signed, int big_endian)
{
    char text[TEXT_BYTES];
    const uint64_t mask = UINT64_MAX >> (64u - bits);
    const uint64_t top = UINT64_C(1) << (bits - 1u);
    const uint64_t words[] = {0, 1, mask, top, top - 1u, 0x123456789ABCDEF0u & mask};
    iio_element_t element = {.offset = 3};
    CHECK(snprintf(text, sizeof text, "%s:%c%" PRIu32 "/%" PRIu32 ">>%" PRIu32, big_endian ? "be" : "le",
                   is_signed ? 's' : 'u', bits, storage, shift) > 0);
    CHECK(iio_parse_type(text, &element) == 0 && element.bytes == storage / BYTE_BITS);
    for (uint32_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        const int negative = is_signed && (words[i] & top) != 0u;
        const double expected = negative ? -(double)(mask - words[i] + 1u) : (double)words[i];
        const double full = bits == 64u && negative ? -(double)(~words[i]) - 1.0 : expected;
        for (int others = 0; others < 2; others++) {
            uint8_t scan[SCAN_BYTES_MAX] = {0};
            const uint64_t around = others ? ~(mask << shift) : 0u;
            store(scan + 3, words[i] << shift | around, storage / BYTE_BITS, big_endian);
            CHECK(iio_scan_number(&element, scan) == full);
        }
    }
}

static void check_numbers(void)
{
    for (uint32_t i = 0; i < WIDTHS; i++) {
        for (uint32_t bits = 1; bits <= BITS[i]; bits++) {
            for (uint32_t shift = 0; shift + bits <= BITS[i]; shift++) {
                for (int kind = 0; kind < 4; kind++) {
                    check_number(BITS[i], bits, shift, kind & 1, kind >> 1);
                }
            }
        }
    }
}

static void check_types(void)
{
    static const char *const BAD[] = {"",
                                      "le",
                                      "le:",
                                      "le:s",
                                      "le:s16",
                                      "le:s16/",
                                      "le:s0/16>>0",
                                      "le:s17/16>>0",
                                      "le:s16/16>>1",
                                      "le:s16/24>>0",
                                      "le:s16/0",
                                      "xe:s16/16",
                                      "le:x16/16",
                                      "le:f32/32>>0",
                                      "le:s16/16>>",
                                      "le:s16/16>",
                                      "le:s16/16 ",
                                      " le:s16/16",
                                      "le:s16/16X3>>0",
                                      "le:s-1/16>>0",
                                      "le:s16/16>>-1",
                                      "le:s99999999999999999999/16",
                                      "le:s16/128>>0",
                                      "LE:s16/16"};
    iio_element_t element = {0};
    for (uint32_t i = 0; i < sizeof BAD / sizeof BAD[0]; i++) {
        CHECK(iio_parse_type(BAD[i], &element) != 0);
    }
    CHECK(iio_parse_type("be:u24/32", &element) == 0 && element.bits == 24 && element.shift == 0);
    put_element("in_accel_y", 1, "le:s16/16X3>>0");
    CHECK(rig_open_fails(iio_buffer, "imu@200", "accel", FCSL_DRIVER_FAILED, "'le:s16/16X3>>0' is not supported"));
    put_element("in_accel_y", 1, "le:s16/16>>0");
    put(SCAN "in_accel_y_index", "-1\n");
    CHECK(rig_open_fails(iio_buffer, "imu@200", "accel", FCSL_DRIVER_FAILED, "in_accel_y"));
    put(SCAN "in_accel_y_index", "1\n");
}

int main(void)
{
    make_tree();
    make_device();
    const int files = count_files();
    check_set_up();
    check_triggers();
    check_timers();
    check_without_trigger();
    check_refusals();
    check_names();
    check_values();
    check_optional_signals();
    check_torn_scans();
    check_timestamps();
    check_end();
    check_layouts();
    check_padding();
    check_numbers();
    check_types();
    CHECK(count_files() == files);
    CHECK(close(device) == 0);
    remove_tree();
    return 0;
}
