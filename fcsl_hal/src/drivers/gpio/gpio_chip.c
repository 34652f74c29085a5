/* SPDX-License-Identifier: Apache-2.0
 *
 * Finds GPIO chips and claims their lines.
 */
#define _GNU_SOURCE
#include "gpio_chip.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "sysfs/sysfs.h"

static const char PREFIX[] = "gpiochip";
static const double ON = 0.5; /* the least value that is on */

/* A signal for each line; a level is 0 or 1. */
#define LINE(index_)                                                                                                   \
    [index_] = {.name = "line" #index_,                                                                                \
                .type = FCSL_F64,                                                                                      \
                .count = 1,                                                                                            \
                .offset = (index_) * (uint32_t)sizeof(double),                                                         \
                .unit = "",                                                                                            \
                .doc = "level of line " #index_ ": 1 is on, 0 is off"}

const fcsl_driver_signal_t gpio_signals[GPIO_LINES] = {
    LINE(0),  LINE(1),  LINE(2),  LINE(3),  LINE(4),  LINE(5),  LINE(6),  LINE(7),  LINE(8),  LINE(9),  LINE(10),
    LINE(11), LINE(12), LINE(13), LINE(14), LINE(15), LINE(16), LINE(17), LINE(18), LINE(19), LINE(20), LINE(21),
    LINE(22), LINE(23), LINE(24), LINE(25), LINE(26), LINE(27), LINE(28), LINE(29), LINE(30), LINE(31), LINE(32),
    LINE(33), LINE(34), LINE(35), LINE(36), LINE(37), LINE(38), LINE(39), LINE(40), LINE(41), LINE(42), LINE(43),
    LINE(44), LINE(45), LINE(46), LINE(47), LINE(48), LINE(49), LINE(50), LINE(51), LINE(52), LINE(53), LINE(54),
    LINE(55), LINE(56), LINE(57), LINE(58), LINE(59), LINE(60), LINE(61), LINE(62), LINE(63),
};

/* ---- the address -------------------------------------------------------------------------------------------------------- */

typedef struct {
    char chip[SYSFS_PATH_BYTES];
    uint64_t flags; /* GPIO_V2_LINE_FLAG_… */
} address_t;

static const struct {
    const char *name;
    uint64_t flag;
    uint64_t others; /* that exclude it */
    int outputs; /* 0: of inputs, 1: of outputs, -1: of both */
} OPTIONS[] = {
    {"active_low", GPIO_V2_LINE_FLAG_ACTIVE_LOW, 0, -1},
    {"pull_up", GPIO_V2_LINE_FLAG_BIAS_PULL_UP, GPIO_V2_LINE_FLAG_BIAS_PULL_DOWN, 0},
    {"pull_down", GPIO_V2_LINE_FLAG_BIAS_PULL_DOWN, GPIO_V2_LINE_FLAG_BIAS_PULL_UP, 0},
    {"open_drain", GPIO_V2_LINE_FLAG_OPEN_DRAIN, GPIO_V2_LINE_FLAG_OPEN_SOURCE, 1},
    {"open_source", GPIO_V2_LINE_FLAG_OPEN_SOURCE, GPIO_V2_LINE_FLAG_OPEN_DRAIN, 1},
};

/* Adds an option of so many characters. 0, or -1: there is none, or another one excludes it. */
static int add_option(const char *text, size_t length, int outputs, uint64_t *flags)
{
    for (size_t i = 0; i < sizeof OPTIONS / sizeof OPTIONS[0]; i++) {
        if (strlen(OPTIONS[i].name) == length && memcmp(OPTIONS[i].name, text, length) == 0 &&
            (OPTIONS[i].outputs < 0 || OPTIONS[i].outputs == outputs) && (*flags & OPTIONS[i].others) == 0u) {
            *flags |= OPTIONS[i].flag;
            return 0;
        }
    }
    return -1;
}

static fcsl_driver_status_t parse(const char *device, int outputs, address_t *address, char *why, size_t size)
{
    address->flags = outputs ? GPIO_V2_LINE_FLAG_OUTPUT : GPIO_V2_LINE_FLAG_INPUT;
    const size_t length = strcspn(device, ",");
    if (length == 0u || length >= sizeof address->chip) {
        (void)snprintf(why, size, "name the GPIO chip: its file, or its label as gpiodetect shows it");
        return device[0] == '\0' ? FCSL_DRIVER_ABSENT : FCSL_DRIVER_FAILED;
    }
    memcpy(address->chip, device, length);
    address->chip[length] = '\0';
    const char *at = device + length;
    while (*at == ',') {
        const char *option = at + 1;
        const size_t end = strcspn(option, ",");
        if (add_option(option, end, outputs, &address->flags) != 0) {
            (void)snprintf(why, size, "'%.40s' is no option here; there are %s", option,
                           outputs ? "active_low, and open_drain or open_source"
                                   : "active_low, and pull_up or pull_down");
            return FCSL_DRIVER_FAILED;
        }
        at = option + end;
    }
    return FCSL_DRIVER_OK;
}

/* ---- the chip ----------------------------------------------------------------------------------------------------------- */

/* Opens the file of a chip and asks it who it is. NOTHING: it is none. */
static fcsl_driver_status_t open_file(const char *path, int *file, struct gpiochip_info *info)
{
    *file = open(path, O_RDWR | O_CLOEXEC | O_NONBLOCK);
    if (*file < 0) {
        return errno == ENOENT || errno == ENODEV || errno == ENXIO ? FCSL_DRIVER_ABSENT : FCSL_DRIVER_FAILED;
    }
    memset(info, 0, sizeof *info);
    if (ioctl(*file, GPIO_GET_CHIPINFO_IOCTL, info) < 0) {
        (void)close(*file);
        return FCSL_DRIVER_NOTHING;
    }
    info->name[sizeof info->name - 1u] = '\0';
    info->label[sizeof info->label - 1u] = '\0';
    return FCSL_DRIVER_OK;
}

static fcsl_driver_status_t open_path(const char *path, int *file, uint32_t *lines, char *why, size_t size)
{
    struct gpiochip_info info;
    const fcsl_driver_status_t status = open_file(path, file, &info);
    if (status == FCSL_DRIVER_OK) {
        *lines = info.lines;
        return status;
    }
    (void)snprintf(why, size, "%s '%s': %s", status == FCSL_DRIVER_NOTHING ? "no GPIO chip is at" : "cannot open", path,
                   strerror(errno));
    return status == FCSL_DRIVER_NOTHING ? FCSL_DRIVER_FAILED : status;
}

/* Opens the only chip of this name or label among the files of `folder`. */
static fcsl_driver_status_t open_among(DIR *folder, const char *root, const char *chip, int *file, uint32_t *lines,
                                       char *why, size_t size)
{
    char path[SYSFS_PATH_BYTES];
    uint32_t found = 0;
    int refused = 0;
    for (uint32_t i = 0; i < SYSFS_ENTRIES_MAX; i++) {
        const struct dirent *entry = readdir(folder);
        struct gpiochip_info info;
        int opened = -1;
        if (entry == NULL) {
            break;
        }
        if (strncmp(entry->d_name, PREFIX, strlen(PREFIX)) != 0 || sysfs_join(path, root, entry->d_name) != 0) {
            continue;
        }
        const fcsl_driver_status_t status = open_file(path, &opened, &info);
        refused = status == FCSL_DRIVER_FAILED ? errno : refused;
        if (status != FCSL_DRIVER_OK) {
            continue;
        }
        if (strcmp(info.name, chip) != 0 && strcmp(info.label, chip) != 0) {
            (void)close(opened);
        } else if (found++ == 0u) {
            *file = opened;
            *lines = info.lines;
        } else {
            (void)close(opened);
        }
    }
    if (found == 1u) {
        return FCSL_DRIVER_OK;
    }
    if (found > 1u) {
        (void)close(*file);
        (void)snprintf(why, size, "%u GPIO chips are called '%.60s'; name the file of one", found, chip);
        return FCSL_DRIVER_FAILED;
    }
    (void)snprintf(why, size, "no GPIO chip is called '%.60s'%s%s", chip, refused != 0 ? "; one cannot be asked: " : "",
                   refused != 0 ? strerror(refused) : "; gpiodetect lists them");
    return refused != 0 ? FCSL_DRIVER_FAILED : FCSL_DRIVER_ABSENT;
}

static fcsl_driver_status_t open_chip(const char *chip, int *file, uint32_t *lines, char *why, size_t size)
{
    if (chip[0] == '/') {
        return open_path(chip, file, lines, why, size);
    }
    const char *root = sysfs_root("FCSL_DEV", "/dev");
    DIR *folder = opendir(root);
    if (folder == NULL) {
        (void)snprintf(why, size, "cannot open '%.100s': %s", root, strerror(errno));
        return FCSL_DRIVER_ABSENT;
    }
    const fcsl_driver_status_t status = open_among(folder, root, chip, file, lines, why, size);
    (void)closedir(folder);
    return status;
}

/* ---- lines -------------------------------------------------------------------------------------------------------------- */

/* Whether a line may be used; FAILED with a reason if not. What somebody drives is no input that is only looked at. */
static fcsl_driver_status_t check_line(int chip, uint32_t lines, uint32_t i, uint8_t use, char *why, size_t size)
{
    struct gpio_v2_line_info info = {.offset = i};
    if (i >= lines) {
        (void)snprintf(why, size, "line%u: the GPIO chip has %u lines", i, lines);
        return FCSL_DRIVER_FAILED;
    }
    if (ioctl(chip, GPIO_V2_GET_LINEINFO_IOCTL, &info) < 0) {
        (void)snprintf(why, size, "line%u: %s", i, strerror(errno));
        return FCSL_DRIVER_FAILED;
    }
    if ((info.flags & GPIO_V2_LINE_FLAG_USED) != 0u) {
        (void)snprintf(why, size, "line%u is in use, by '%.*s'", i, (int)sizeof info.consumer - 1, info.consumer);
        return FCSL_DRIVER_FAILED;
    }
    if (use == FCSL_DRIVER_OPTIONAL && (info.flags & GPIO_V2_LINE_FLAG_OUTPUT) != 0u) {
        (void)snprintf(why, size, "line%u is driven", i);
        return FCSL_DRIVER_FAILED;
    }
    return FCSL_DRIVER_OK;
}

/* Optional lines that may not be used are not used any more. */
static fcsl_driver_status_t check_lines(int chip, uint32_t lines, uint8_t *used, char *why, size_t size)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < GPIO_LINES; i++) {
        const fcsl_driver_status_t status =
            used[i] != FCSL_DRIVER_UNUSED ? check_line(chip, lines, i, used[i], why, size) : FCSL_DRIVER_NOTHING;
        if (status == FCSL_DRIVER_FAILED && used[i] == FCSL_DRIVER_NEEDED) {
            return status;
        }
        used[i] = status == FCSL_DRIVER_OK ? used[i] : FCSL_DRIVER_UNUSED;
        count += status == FCSL_DRIVER_OK;
    }
    if (count == 0u) {
        (void)snprintf(why, size, "no line of the GPIO chip can be used");
        return FCSL_DRIVER_FAILED;
    }
    why[0] = '\0';
    return FCSL_DRIVER_OK;
}

/* The request numbers the claimed lines in their order: bit 0 is the first. */
static fcsl_driver_status_t claim_lines(int chip, uint64_t flags, const uint8_t *used, const double *values, int *file,
                                        char *why, size_t size)
{
    struct gpio_v2_line_request request;
    memset(&request, 0, sizeof request);
    uint64_t mask = 0;
    uint64_t bits = 0;
    for (uint32_t i = 0; i < GPIO_LINES; i++) {
        if (used[i] != FCSL_DRIVER_UNUSED) {
            const uint64_t bit = 1ull << request.num_lines;
            mask |= bit;
            bits |= values != NULL && values[i] >= ON ? bit : 0u;
            request.offsets[request.num_lines++] = i;
        }
    }
    request.config.flags = flags;
    if (values != NULL) {
        request.config.num_attrs = 1;
        request.config.attrs[0].attr.id = GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES;
        request.config.attrs[0].attr.values = bits;
        request.config.attrs[0].mask = mask;
    }
    (void)snprintf(request.consumer, sizeof request.consumer, "fcsl");
    if (ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &request) < 0) {
        (void)snprintf(why, size, "the lines cannot be claimed: %s", strerror(errno));
        return FCSL_DRIVER_FAILED;
    }
    *file = request.fd;
    return FCSL_DRIVER_OK;
}

/* Opens the chip of an address. */
static fcsl_driver_status_t open_address(const char *device, int outputs, int *chip, uint32_t *lines, uint64_t *flags,
                                         char *why, size_t size)
{
    address_t address;
    const fcsl_driver_status_t status = parse(device, outputs, &address, why, size);
    *flags = address.flags;
    return status == FCSL_DRIVER_OK ? open_chip(address.chip, chip, lines, why, size) : status;
}

fcsl_driver_status_t gpio_probe(const char *device, int outputs, char *why, size_t size)
{
    uint32_t lines = 0;
    uint64_t flags = 0;
    int chip = -1;
    const fcsl_driver_status_t status = open_address(device, outputs, &chip, &lines, &flags, why, size);
    if (status == FCSL_DRIVER_OK) {
        (void)close(chip);
    }
    return status;
}

fcsl_driver_status_t gpio_check(const char *device, int outputs, uint8_t *used, char *why, size_t size)
{
    return gpio_claim(device, outputs, used, NULL, NULL, why, size);
}

fcsl_driver_status_t gpio_claim(const char *device, int outputs, uint8_t *used, const double *values, int *file,
                                char *why, size_t size)
{
    uint32_t lines = 0;
    uint64_t flags = 0;
    int chip = -1;
    fcsl_driver_status_t status = open_address(device, outputs, &chip, &lines, &flags, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    status = check_lines(chip, lines, used, why, size);
    if (status == FCSL_DRIVER_OK && file != NULL) {
        status = claim_lines(chip, flags, used, values, file, why, size);
    }
    (void)close(chip);
    return status;
}

static fcsl_driver_status_t transfer(int file, unsigned long request, struct gpio_v2_line_values *values, char *why,
                                     size_t size)
{
    if (ioctl(file, request, values) >= 0) {
        return FCSL_DRIVER_OK;
    }
    const int code = errno;
    (void)snprintf(why, size, "%s", strerror(code));
    return code == ENODEV || code == ENXIO ? FCSL_DRIVER_ABSENT : FCSL_DRIVER_FAILED;
}

fcsl_driver_status_t gpio_get(int file, const uint8_t *used, double *values, char *why, size_t size)
{
    struct gpio_v2_line_values levels = {0};
    uint32_t count = 0;
    for (uint32_t i = 0; i < GPIO_LINES; i++) {
        levels.mask |= used[i] != FCSL_DRIVER_UNUSED ? 1ull << count++ : 0u;
    }
    const fcsl_driver_status_t status = transfer(file, GPIO_V2_LINE_GET_VALUES_IOCTL, &levels, why, size);
    count = 0;
    for (uint32_t i = 0; status == FCSL_DRIVER_OK && i < GPIO_LINES; i++) {
        if (used[i] != FCSL_DRIVER_UNUSED) {
            values[i] = (levels.bits >> count++ & 1u) != 0u ? 1.0 : 0.0;
        }
    }
    return status;
}

fcsl_driver_status_t gpio_set(int file, const uint8_t *used, const double *values, char *why, size_t size)
{
    struct gpio_v2_line_values levels = {0};
    uint32_t count = 0;
    for (uint32_t i = 0; i < GPIO_LINES; i++) {
        if (used[i] != FCSL_DRIVER_UNUSED) {
            const uint64_t bit = 1ull << count++;
            levels.mask |= bit;
            levels.bits |= values[i] >= ON ? bit : 0u;
        }
    }
    return transfer(file, GPIO_V2_LINE_SET_VALUES_IOCTL, &levels, why, size);
}
