/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `iio_buffer`: a sensor of the kernel's industrial I/O whose samples come through its buffer, each with the time
 * at which it was taken. The device's character device is below /dev, or where the environment's FCSL_DEV says.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_driver.h"
#include "iio_trigger.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"

enum {
    ELEMENTS = IIO_VALUES + 1, /* and the timestamp */
    SCAN_BYTES = ELEMENTS * 8,
    RATE_BYTES = 32
};
static const double RATE_MIN_HZ = 0.001;
static const double RATE_MAX_HZ = 1e6;
static const char TRIGGER_OPTION[] = ",trigger=";
static const char TIMESTAMP[] = "in_timestamp";

/* What the user's text says. */
typedef struct {
    char device[SYSFS_PATH_BYTES];
    char trigger[SYSFS_TEXT_BYTES]; /* "": the driver chooses */
    char rate[RATE_BYTES];
} request_t;

typedef struct {
    iio_values_t values; /* the signals */
    iio_element_t elements[ELEMENTS]; /* in their order in the scan */
    uint32_t element_count;
    uint32_t scan_bytes;
    iio_mounts_t mounts;
    uint64_t last_ns; /* the time of the last sample */
    int file;
    char folder[SYSFS_PATH_BYTES];
} iio_buffer_t;

/* ---- NAME_OR_PATH@HZ[,trigger=NAME] ------------------------------------------------------------------------------------- */

/* Copies the first `length` bytes. 0, or -1: too long. */
static int copy(char *to, size_t size, const char *from, size_t length)
{
    if (length >= size) {
        return -1;
    }
    memcpy(to, from, length);
    to[length] = '\0';
    return 0;
}

static fcsl_driver_status_t parse(const char *text, request_t *request, char *why, size_t size)
{
    char rest[SYSFS_PATH_BYTES];
    double rate = 0.0;
    const char *option = strstr(text, TRIGGER_OPTION);
    const char *trigger = option != NULL ? option + strlen(TRIGGER_OPTION) : "";
    const int copied = copy(rest, sizeof rest, text, option != NULL ? (size_t)(option - text) : strlen(text)) == 0 &&
                       copy(request->trigger, sizeof request->trigger, trigger, strlen(trigger)) == 0;
    const char *at = copied ? strrchr(rest, '@') : NULL; /* paths have @, too: soc@0 */
    if (at == NULL || copy(request->device, sizeof request->device, rest, (size_t)(at - rest)) != 0) {
        (void)snprintf(why, size, "name the device and its rate: iio_buffer:DEVICE@HZ[,trigger=NAME]");
        return FCSL_DRIVER_FAILED;
    }
    if (sysfs_parse_number(at + 1, &rate) != 0 || !(rate >= RATE_MIN_HZ && rate <= RATE_MAX_HZ)) {
        (void)snprintf(why, size, "'%s' is no rate in Hz from %g to %g", at + 1, RATE_MIN_HZ, RATE_MAX_HZ);
        return FCSL_DRIVER_FAILED;
    }
    (void)snprintf(request->rate, sizeof request->rate, "%.9g", rate);
    return FCSL_DRIVER_OK;
}

static fcsl_driver_status_t probe_iio_buffer(const char *device, char *why, size_t size)
{
    request_t request;
    char path[SYSFS_PATH_BYTES];
    const fcsl_driver_status_t status = parse(device, &request, why, size);
    return status == FCSL_DRIVER_OK ? sysfs_find(&iio_devices, request.device, path, why, size) : status;
}

/* ---- elements ----------------------------------------------------------------------------------------------------------- */

/* Reads index and type of a scan element. NOTHING, without a reason: the buffer does not have it. */
static fcsl_driver_status_t get_element(const char *folder, const char *name, iio_element_t *element, char *why,
                                        size_t size)
{
    char attribute[IIO_ATTRIBUTE_BYTES];
    char text[SYSFS_TEXT_BYTES];
    double index = 0.0;
    (void)snprintf(attribute, sizeof attribute, "scan_elements/%s_index", name);
    fcsl_driver_status_t status = sysfs_get_number(folder, attribute, &index, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    (void)snprintf(attribute, sizeof attribute, "scan_elements/%s_type", name);
    status = sysfs_get_text(folder, attribute, text, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    if (!(index >= 0.0 && index <= UINT16_MAX) || iio_parse_type(text, element) != 0) {
        (void)snprintf(why, size, "element %s with the index %g and the type '%s' is not supported", name, index, text);
        return FCSL_DRIVER_FAILED;
    }
    element->index = (uint32_t)index;
    return FCSL_DRIVER_OK;
}

static fcsl_driver_status_t add_element(void *self, const iio_channel_t *channel, char *why, size_t size)
{
    iio_buffer_t *buffer = self;
    iio_element_t *element = &buffer->elements[buffer->element_count];
    fcsl_driver_status_t status = get_element(buffer->folder, channel->name, element, why, size);
    if (status == FCSL_DRIVER_OK) {
        status = iio_get_conversion(buffer->folder, channel, &element->conversion, why, size);
    }
    if (status == FCSL_DRIVER_OK) {
        element->channel = channel;
        buffer->element_count++;
    }
    return status;
}

static fcsl_driver_status_t add_timestamp(iio_buffer_t *buffer, char *why, size_t size)
{
    iio_element_t *element = &buffer->elements[buffer->element_count];
    const fcsl_driver_status_t status = get_element(buffer->folder, TIMESTAMP, element, why, size);
    if (status == FCSL_DRIVER_NOTHING) {
        (void)snprintf(why, size, "the device gives no timestamps");
        return FCSL_DRIVER_FAILED;
    }
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    if (element->bits != 64u || element->is_signed == 0u) {
        (void)snprintf(why, size, "the timestamp is no signed number of 64 bits");
        return FCSL_DRIVER_FAILED;
    }
    element->channel = NULL;
    buffer->element_count++;
    return FCSL_DRIVER_OK;
}

static fcsl_driver_status_t add_elements(iio_buffer_t *buffer, const uint8_t *used, char *why, size_t size)
{
    fcsl_driver_status_t status = iio_get_mounts(buffer->folder, used, &buffer->mounts, why, size);
    if (status == FCSL_DRIVER_OK) {
        status = iio_add_channels(buffer, used, add_element, &buffer->values, why, size);
    }
    if (status == FCSL_DRIVER_OK) {
        status = add_timestamp(buffer, why, size);
    }
    if (status == FCSL_DRIVER_OK) {
        buffer->scan_bytes = iio_lay_out(buffer->elements, buffer->element_count);
    }
    return status;
}

/* ---- set-up ------------------------------------------------------------------------------------------------------------- */

/* Writes an attribute that the device must have. */
static fcsl_driver_status_t put_text(const char *folder, const char *attribute, const char *text, char *why,
                                     size_t size)
{
    const fcsl_driver_status_t status = sysfs_put_text(folder, attribute, text, why, size);
    if (status == FCSL_DRIVER_NOTHING) {
        (void)snprintf(why, size, "the device has no %s", attribute);
        return FCSL_DRIVER_FAILED;
    }
    return status;
}

static int is_enable(const char *entry)
{
    const size_t length = strlen(entry);
    return length > 3u && length < IIO_ATTRIBUTE_BYTES && strcmp(entry + length - 3u, "_en") == 0;
}

/* Elements that another program has left enabled would be in the scan. */
static fcsl_driver_status_t disable_elements(const iio_buffer_t *buffer, char *why, size_t size)
{
    char path[SYSFS_PATH_BYTES];
    DIR *folder = sysfs_join(path, buffer->folder, "scan_elements") == 0 ? opendir(path) : NULL;
    if (folder == NULL) {
        (void)snprintf(why, size, "scan_elements: %s", strerror(errno));
        return FCSL_DRIVER_FAILED;
    }
    fcsl_driver_status_t status = FCSL_DRIVER_OK;
    for (uint32_t i = 0; i < SYSFS_ENTRIES_MAX && status == FCSL_DRIVER_OK; i++) {
        const struct dirent *entry = readdir(folder);
        if (entry == NULL) {
            break;
        }
        if (is_enable(entry->d_name)) {
            status = put_text(path, entry->d_name, "0", why, size);
        }
    }
    (void)closedir(folder);
    return status;
}

static fcsl_driver_status_t enable_elements(const iio_buffer_t *buffer, char *why, size_t size)
{
    fcsl_driver_status_t status = disable_elements(buffer, why, size);
    for (uint32_t i = 0; i < buffer->element_count && status == FCSL_DRIVER_OK; i++) {
        char attribute[IIO_ATTRIBUTE_BYTES];
        const iio_channel_t *channel = buffer->elements[i].channel;
        (void)snprintf(attribute, sizeof attribute, "scan_elements/%s_en", channel != NULL ? channel->name : TIMESTAMP);
        status = put_text(buffer->folder, attribute, "1", why, size);
    }
    return status;
}

/* Every scan wakes its reader. Kernels without watermarks do so anyway. */
static fcsl_driver_status_t set_watermark(const char *folder, char *why, size_t size)
{
    const fcsl_driver_status_t status = sysfs_put_text(folder, "buffer/watermark", "1", why, size);
    return status == FCSL_DRIVER_NOTHING ? FCSL_DRIVER_OK : status;
}

static fcsl_driver_status_t set_up(const iio_buffer_t *buffer, const request_t *request, uint32_t number, char *why,
                                   size_t size)
{
    const iio_setup_t setup = {.folder = buffer->folder,
                               .number = number,
                               .elements = buffer->elements,
                               .element_count = buffer->element_count,
                               .rate = request->rate,
                               .trigger = request->trigger};
    /* A program that was killed leaves the buffer on, and then nothing can be set. */
    fcsl_driver_status_t status = put_text(buffer->folder, "buffer/enable", "0", why, size);
    if (status == FCSL_DRIVER_OK) {
        status = put_text(buffer->folder, "current_timestamp_clock", "monotonic", why, size);
    }
    if (status == FCSL_DRIVER_OK) {
        status = iio_set_trigger(&setup, why, size);
    }
    if (status == FCSL_DRIVER_OK) {
        status = enable_elements(buffer, why, size);
    }
    if (status == FCSL_DRIVER_OK) {
        status = put_text(buffer->folder, "buffer/length", "128", why, size);
    }
    if (status == FCSL_DRIVER_OK) {
        status = set_watermark(buffer->folder, why, size);
    }
    return status == FCSL_DRIVER_OK ? put_text(buffer->folder, "buffer/enable", "1", why, size) : status;
}

/* ---- open --------------------------------------------------------------------------------------------------------------- */

/* The number of iio:deviceN. 0, or -1: the folder is no IIO device. */
static int get_number(const char *folder, uint32_t *number)
{
    char path[PATH_MAX];
    int end = 0;
    if (realpath(folder, path) == NULL) {
        return -1;
    }
    const char *name = strrchr(path, '/');
    const int parsed = name != NULL && sscanf(name, "/iio:device%5" SCNu32 "%n", number, &end) == 1;
    return parsed && name[end] == '\0' ? 0 : -1;
}

/* The kernel lets one program open it. */
static fcsl_driver_status_t open_device(uint32_t number, int *file, char *why, size_t size)
{
    char name[IIO_ATTRIBUTE_BYTES];
    char path[SYSFS_PATH_BYTES];
    (void)snprintf(name, sizeof name, "iio:device%" PRIu32, number);
    const int joined = sysfs_join(path, sysfs_root("FCSL_DEV", "/dev"), name) == 0;
    *file = joined ? open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC) : -1;
    if (*file >= 0) {
        return FCSL_DRIVER_OK;
    }
    const int code = errno;
    const char *hint = code == EBUSY ? "; another program reads it" : "";
    (void)snprintf(why, size, "cannot open '%s': %s%s", path, strerror(code), hint);
    return code == ENODEV || code == ENXIO ? FCSL_DRIVER_ABSENT : FCSL_DRIVER_FAILED;
}

static fcsl_driver_status_t open_iio_buffer(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    iio_buffer_t *buffer = self;
    request_t request;
    uint32_t number = 0;
    fcsl_driver_status_t status = parse(device, &request, why, size);
    if (status == FCSL_DRIVER_OK) {
        status = sysfs_find(&iio_devices, request.device, buffer->folder, why, size);
    }
    if (status == FCSL_DRIVER_OK && get_number(buffer->folder, &number) != 0) {
        (void)snprintf(why, size, "'%s' is no IIO device", buffer->folder);
        status = FCSL_DRIVER_FAILED;
    }
    if (status == FCSL_DRIVER_OK) {
        status = add_elements(buffer, used, why, size);
    }
    if (status == FCSL_DRIVER_OK) {
        status = open_device(number, &buffer->file, why, size);
    }
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    status = set_up(buffer, &request, number, why, size);
    if (status != FCSL_DRIVER_OK) {
        (void)close(buffer->file);
    }
    return status;
}

static void close_iio_buffer(void *self)
{
    iio_buffer_t *buffer = self;
    char ignored[1];
    (void)sysfs_put_text(buffer->folder, "buffer/enable", "0", ignored, sizeof ignored);
    (void)close(buffer->file);
}

/* ---- read --------------------------------------------------------------------------------------------------------------- */

/* Reads one scan. The kernel gives whole ones: a part is dropped, and its rest cannot come. */
static fcsl_driver_status_t read_scan(const iio_buffer_t *buffer, uint8_t *scan, char *why, size_t size)
{
    struct pollfd waiting = {.fd = buffer->file, .events = POLLIN};
    if (poll(&waiting, 1, FCSL_DRIVER_WAIT_MS) < 0 && errno != EINTR) {
        (void)snprintf(why, size, "poll: %s", strerror(errno));
        return FCSL_DRIVER_FAILED;
    }
    /* Also after a wait in vain: poll does not tell that the device has gone, read does. */
    const ssize_t count = read(buffer->file, scan, buffer->scan_bytes);
    if (count == (ssize_t)buffer->scan_bytes) {
        return FCSL_DRIVER_OK;
    }
    if (count > 0) {
        (void)snprintf(why, size, "a scan has %zd bytes instead of %" PRIu32, count, buffer->scan_bytes);
        return FCSL_DRIVER_FAILED;
    }
    const int code = count < 0 ? errno : ENODEV; /* at its end there is no device */
    if (code == EAGAIN || code == EINTR) {
        return FCSL_DRIVER_NOTHING;
    }
    (void)snprintf(why, size, "buffer: %s", strerror(code));
    return code == ENODEV ? FCSL_DRIVER_ABSENT : FCSL_DRIVER_FAILED;
}

/* Whether a sample can have this time: after the last one, and not in the future, as the times of other clocks are. */
static int is_plausible(const iio_buffer_t *buffer, int64_t time_ns)
{
    return time_ns > 0 && (uint64_t)time_ns > buffer->last_ns &&
           (uint64_t)time_ns <= fcsl_monotonic_ns() + FCSL_NS_PER_S;
}

static fcsl_driver_status_t read_iio_buffer(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    iio_buffer_t *buffer = self;
    iio_values_t values = buffer->values;
    uint8_t scan[SCAN_BYTES];
    int64_t time_ns = 0;
    const fcsl_driver_status_t status = read_scan(buffer, scan, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    for (uint32_t i = 0; i < buffer->element_count; i++) {
        const iio_element_t *element = &buffer->elements[i];
        if (element->channel == NULL) {
            time_ns = iio_scan_integer(element, scan);
        } else {
            iio_put_value(&values, element->channel, &element->conversion, iio_scan_number(element, scan));
        }
    }
    if (!is_plausible(buffer, time_ns)) {
        (void)snprintf(why, size, "the timestamp %" PRId64 " ns is not after %" PRIu64 " ns, or in the future", time_ns,
                       buffer->last_ns);
        return FCSL_DRIVER_FAILED;
    }
    iio_turn(&buffer->mounts, &values);
    buffer->values = values;
    buffer->last_ns = (uint64_t)time_ns;
    *sample_ns = (uint64_t)time_ns;
    return FCSL_DRIVER_OK;
}

const fcsl_driver_t fcsl_driver_iio_buffer = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "iio_buffer",
    .doc = "sensor of Linux IIO, through its buffer; iio_buffer:DEVICE@HZ[,trigger=NAME], DEVICE as of iio",
    .direction = FCSL_SENSOR,
    .signals = iio_signals,
    .signal_count = IIO_SIGNALS,
    .state_size = sizeof(iio_buffer_t),
    .state_align = _Alignof(iio_buffer_t),
    .waits = 1,
    .probe = probe_iio_buffer,
    .open = open_iio_buffer,
    .read = read_iio_buffer,
    .close = close_iio_buffer,
};
