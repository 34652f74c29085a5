/* SPDX-License-Identifier: Apache-2.0
 *
 * The drivers `gpio` and `gpio_out` with GPIO chips that are played here: files in a tree, and this program's ioctl in place of the
 * system's.
 */
#define _GNU_SOURCE
#include <linux/gpio.h>
#include <stdarg.h>
#include <sys/ioctl.h>

#include "drivers/gpio/gpio_chip.h"
#include "sysfs_rig.h"

enum { CHIPS = 3, LINES = 70, REQUEST_FILE = 900, REQUESTS = 16 };

/* ---- the kernel's part -------------------------------------------------------------------------------------------------- */

typedef struct {
    int chip;
    struct gpio_v2_line_request asked;
} request_t;

static struct {
    const char *label[CHIPS];
    uint32_t lines[CHIPS];
    uint64_t levels[CHIPS]; /* as they are on the wires, of lines 0 to 63 */
    uint64_t hogged[CHIPS]; /* in use by somebody else */
    uint64_t driven[CHIPS]; /* free, and outputs */
    int gone[CHIPS];
    request_t requests[REQUESTS];
    int next;
    int sets;
} kernel = {.label = {"pinctrl-test", "expander", "expander"}, .lines = {LINES, 8, 8}};

/* The number of the chip that a file is, or -1. */
static int chip_of(int file)
{
    char path[TREE_BYTES] = "";
    char link[64];
    CHECK(snprintf(link, sizeof link, "/proc/self/fd/%d", file) > 0);
    if (readlink(link, path, sizeof path - 1) <= 0) {
        return -1;
    }
    const char *name = strstr(path, "/gpiochip");
    return name != NULL && name[9] >= '0' && name[9] < '0' + CHIPS ? name[9] - '0' : -1;
}

static int answer_chip(int chip, unsigned long request, void *data)
{
    if (request == GPIO_GET_CHIPINFO_IOCTL) {
        struct gpiochip_info *info = data;
        (void)snprintf(info->name, sizeof info->name, "gpiochip%d", chip);
        (void)snprintf(info->label, sizeof info->label, "%s", kernel.label[chip]);
        info->lines = kernel.lines[chip];
        return 0;
    }
    if (request == GPIO_V2_GET_LINEINFO_IOCTL) {
        struct gpio_v2_line_info *info = data;
        CHECK(info->offset < kernel.lines[chip]);
        const int hogged = (kernel.hogged[chip] >> info->offset & 1u) != 0u;
        const int driven = (kernel.driven[chip] >> info->offset & 1u) != 0u;
        info->flags = (hogged ? GPIO_V2_LINE_FLAG_USED : 0u) | (driven ? GPIO_V2_LINE_FLAG_OUTPUT : 0u);
        (void)snprintf(info->consumer, sizeof info->consumer, "%s", hogged ? "sysfs" : "");
        return 0;
    }
    CHECK(request == GPIO_V2_GET_LINE_IOCTL && kernel.next < REQUESTS);
    request_t *made = &kernel.requests[kernel.next];
    made->chip = chip;
    made->asked = *(const struct gpio_v2_line_request *)data;
    CHECK(strcmp(made->asked.consumer, "fcsl") == 0 && made->asked.num_lines > 0u);
    for (uint32_t i = 0; i < made->asked.num_lines && made->asked.config.num_attrs > 0u; i++) {
        const uint64_t bit = 1ull << made->asked.offsets[i];
        const int high = (made->asked.config.attrs[0].attr.values >> i & 1u) != 0u;
        CHECK((made->asked.config.attrs[0].mask >> i & 1u) != 0u);
        kernel.levels[chip] = high ? kernel.levels[chip] | bit : kernel.levels[chip] & ~bit;
    }
    const int file = open("/dev/null", O_RDWR | O_CLOEXEC);
    CHECK(file >= 0 && dup2(file, REQUEST_FILE + kernel.next) >= 0 && close(file) == 0);
    ((struct gpio_v2_line_request *)data)->fd = REQUEST_FILE + kernel.next++;
    return 0;
}

static int answer_lines(const request_t *made, unsigned long request, struct gpio_v2_line_values *values)
{
    if (kernel.gone[made->chip]) {
        errno = ENODEV;
        return -1;
    }
    kernel.sets += request == GPIO_V2_LINE_SET_VALUES_IOCTL;
    values->bits = request == GPIO_V2_LINE_SET_VALUES_IOCTL ? values->bits : 0u;
    for (uint32_t i = 0; i < made->asked.num_lines; i++) {
        const uint64_t bit = 1ull << made->asked.offsets[i];
        CHECK((values->mask >> i & 1u) != 0u);
        if (request == GPIO_V2_LINE_GET_VALUES_IOCTL) {
            values->bits |= (kernel.levels[made->chip] & bit) != 0u ? 1ull << i : 0u;
        } else if ((values->bits >> i & 1u) != 0u) {
            kernel.levels[made->chip] |= bit;
        } else {
            kernel.levels[made->chip] &= ~bit;
        }
    }
    return 0;
}

int ioctl(int file, unsigned long request, ...)
{
    va_list arguments;
    va_start(arguments, request);
    void *data = va_arg(arguments, void *);
    va_end(arguments);
    if (file >= REQUEST_FILE && file < REQUEST_FILE + kernel.next) {
        return answer_lines(&kernel.requests[file - REQUEST_FILE], request, data);
    }
    const int chip = chip_of(file);
    errno = chip < 0 ? ENOTTY : ENODEV;
    return chip < 0 || kernel.gone[chip] ? -1 : answer_chip(chip, request, data);
}

static void plug(int chip)
{
    char name[16];
    CHECK(snprintf(name, sizeof name, "gpiochip%d", chip) > 0);
    kernel.gone[chip] = 0;
    put(name, "");
}

static void unplug(int chip)
{
    char name[16];
    CHECK(snprintf(name, sizeof name, "gpiochip%d", chip) > 0);
    kernel.gone[chip] = 1;
    remove_below(name);
}

static uint64_t flags_of_last(void)
{
    return kernel.requests[kernel.next - 1].asked.config.flags;
}

/* Opens a device with these lines. */
static fcsl_driver_status_t open_lines(rig_t *rig, const fcsl_driver_t *driver, const char *device,
                                       const uint32_t *lines, uint32_t count)
{
    uint8_t used[GPIO_LINES] = {0};
    CHECK(driver->abi_version == FCSL_DRIVER_ABI_VERSION && driver->state_size <= STATE_BYTES);
    for (uint32_t i = 0; i < count; i++) {
        used[lines[i]] = FCSL_DRIVER_NEEDED;
    }
    memset(rig, 0, sizeof *rig);
    rig->driver = driver;
    const fcsl_driver_status_t status = driver->open(rig->self, device, used, rig->why, sizeof rig->why);
    CHECK(status != FCSL_DRIVER_NOTHING && (status == FCSL_DRIVER_OK) == (rig->why[0] == '\0'));
    return status;
}

/* ---- inputs ------------------------------------------------------------------------------------------------------------- */

static void check_inputs(void)
{
    rig_t rig;
    kernel.levels[0] = 1ull << 4 | 1ull << 63;
    CHECK(open_lines(&rig, &fcsl_driver_gpio, "pinctrl-test", (const uint32_t[]){3, 4, 63}, 3) == FCSL_DRIVER_OK);
    CHECK(flags_of_last() == GPIO_V2_LINE_FLAG_INPUT);
    const uint64_t before_ns = fcsl_monotonic_ns();
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig.sample_ns >= before_ns);
    CHECK(value_at(&rig, "line3", 0) == 0.0 && value_at(&rig, "line4", 0) == 1.0 && value_at(&rig, "line63", 0) == 1.0);
    kernel.levels[0] = 1ull << 3;
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && value_at(&rig, "line3", 0) == 1.0 && value_at(&rig, "line4", 0) == 0.0);
    unplug(0);
    CHECK(rig_read(&rig) == FCSL_DRIVER_ABSENT && value_at(&rig, "line3", 0) == 1.0);
    rig_close(&rig);
    CHECK(open_lines(&rig, &fcsl_driver_gpio, "pinctrl-test", (const uint32_t[]){3}, 1) == FCSL_DRIVER_ABSENT);
    plug(0);
    CHECK(open_lines(&rig, &fcsl_driver_gpio, "gpiochip0,active_low,pull_up", (const uint32_t[]){3}, 1) ==
          FCSL_DRIVER_OK);
    CHECK(flags_of_last() == (GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_ACTIVE_LOW | GPIO_V2_LINE_FLAG_BIAS_PULL_UP));
    rig_close(&rig);
}

/* Who looks at all lines gets those that are free inputs, and changes no other one. */
static void check_optional_lines(void)
{
    rig_t rig;
    uint8_t used[GPIO_LINES];
    memset(used, FCSL_DRIVER_OPTIONAL, sizeof used);
    memset(&rig, 0, sizeof rig);
    rig.driver = &fcsl_driver_gpio;
    kernel.hogged[1] = 1u << 6;
    kernel.driven[1] = 1u << 2;
    kernel.levels[1] = 0xff;
    CHECK(rig.driver->open(rig.self, "gpiochip1", used, rig.why, sizeof rig.why) == FCSL_DRIVER_OK);
    CHECK(kernel.requests[kernel.next - 1].asked.num_lines == 6u && rig.why[0] == '\0');
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    for (uint32_t i = 0; i < GPIO_LINES; i++) {
        const double value = value_at(&rig, gpio_signals[i].name, 0);
        CHECK(i < 8u && i != 6u && i != 2u ? value == 1.0 : isnan(value) != 0);
    }
    rig_close(&rig);
    kernel.hogged[1] = 0xff;
    memset(&rig, 0, sizeof rig);
    CHECK(fcsl_driver_gpio.open(rig.self, "gpiochip1", used, rig.why, sizeof rig.why) == FCSL_DRIVER_FAILED);
    CHECK(strstr(rig.why, "no line of the GPIO chip can be used") != NULL);
    kernel.hogged[1] = 0;
    kernel.driven[1] = 0;
}

/* ---- outputs ------------------------------------------------------------------------------------------------------------ */

static void set(rig_t *rig, uint32_t line, double value)
{
    memcpy(rig->self + gpio_signals[line].offset, &value, sizeof value);
}

static fcsl_driver_status_t write_lines(rig_t *rig)
{
    rig->why[0] = '\0';
    const fcsl_driver_status_t status = rig->driver->write(rig->self, rig->why, sizeof rig->why);
    CHECK((status == FCSL_DRIVER_OK) == (rig->why[0] == '\0'));
    return status;
}

/* Nothing moves before the first write, and that one claims the lines with their levels, not with others before. */
static void check_outputs(void)
{
    rig_t rig;
    const int claimed = kernel.next;
    kernel.levels[0] = 1ull << 2 | 1ull << 9;
    CHECK(open_lines(&rig, &fcsl_driver_gpio_out, "pinctrl-test,open_drain", (const uint32_t[]){2, 5}, 2) ==
          FCSL_DRIVER_OK);
    CHECK(kernel.next == claimed && kernel.levels[0] == (1ull << 2 | 1ull << 9));
    set(&rig, 5, 1.0);
    CHECK(write_lines(&rig) == FCSL_DRIVER_OK && kernel.next == claimed + 1 && kernel.sets == 0);
    CHECK(kernel.levels[0] == (1ull << 5 | 1ull << 9));
    CHECK(flags_of_last() == (GPIO_V2_LINE_FLAG_OUTPUT | GPIO_V2_LINE_FLAG_OPEN_DRAIN));
    set(&rig, 2, 0.5);
    set(&rig, 5, 0.499);
    CHECK(write_lines(&rig) == FCSL_DRIVER_OK && kernel.levels[0] == (1ull << 2 | 1ull << 9));
    set(&rig, 2, NAN); /* no number is off */
    CHECK(write_lines(&rig) == FCSL_DRIVER_OK && kernel.levels[0] == 1ull << 9);
    rig_close(&rig);
}

/* A chip that comes back gets the levels again. */
static void check_return(void)
{
    rig_t rig;
    CHECK(open_lines(&rig, &fcsl_driver_gpio_out, "pinctrl-test", (const uint32_t[]){1}, 1) == FCSL_DRIVER_OK);
    set(&rig, 1, 1.0);
    CHECK(write_lines(&rig) == FCSL_DRIVER_OK);
    unplug(0);
    CHECK(write_lines(&rig) == FCSL_DRIVER_FAILED);
    CHECK(write_lines(&rig) == FCSL_DRIVER_FAILED && strstr(rig.why, "pinctrl-test") != NULL);
    plug(0);
    kernel.levels[0] = 0;
    fcsl_driver_status_t status = FCSL_DRIVER_FAILED;
    for (int i = 0; i < 500 && status != FCSL_DRIVER_OK; i++) {
        fcsl_monotonic_wait(fcsl_monotonic_ns() + 10u * FCSL_NS_PER_MS);
        status = write_lines(&rig);
    }
    CHECK(status == FCSL_DRIVER_OK && kernel.levels[0] == 1ull << 1);
    rig_close(&rig);
}

/* ---- what is refused ---------------------------------------------------------------------------------------------------- */

static int refuses(const fcsl_driver_t *driver, const char *device, uint32_t line, fcsl_driver_status_t status,
                   const char *text)
{
    rig_t rig;
    const int files = count_files();
    const int refused = open_lines(&rig, driver, device, &line, 1) == status && strstr(rig.why, text) != NULL;
    if (!refused) {
        (void)fprintf(stderr, "%s: '%s'\n", device, rig.why);
    }
    return refused && count_files() == files;
}

static void check_refusals(void)
{
    const fcsl_driver_t *in = &fcsl_driver_gpio;
    const fcsl_driver_t *out = &fcsl_driver_gpio_out;
    CHECK(refuses(in, "expander", 1, FCSL_DRIVER_FAILED, "2 GPIO chips are called 'expander'"));
    CHECK(refuses(in, "gpiochip1", 8, FCSL_DRIVER_FAILED, "line8: the GPIO chip has 8 lines"));
    CHECK(refuses(in, "no_such", 1, FCSL_DRIVER_ABSENT, "no GPIO chip is called 'no_such'"));
    CHECK(refuses(in, "", 1, FCSL_DRIVER_ABSENT, "name the GPIO chip"));
    CHECK(refuses(in, "gpiochip1,pullup", 1, FCSL_DRIVER_FAILED,
                  "'pullup' is no option here; there are active_low, and pull_up"));
    CHECK(refuses(out, "gpiochip1,pull_up", 1, FCSL_DRIVER_FAILED,
                  "'pull_up' is no option here; there are active_low, and open"));
    CHECK(refuses(in, "gpiochip1,", 1, FCSL_DRIVER_FAILED, "is no option"));
    CHECK(refuses(in, "gpiochip1,pull_up,pull_down", 1, FCSL_DRIVER_FAILED, "'pull_down' is no option here"));
    CHECK(refuses(out, "gpiochip1,open_source,open_drain", 1, FCSL_DRIVER_FAILED, "'open_drain' is no option here"));
    CHECK(refuses(in, ",pull_up", 1, FCSL_DRIVER_FAILED, "name the GPIO chip"));
    CHECK(refuses(in, in_tree("plain"), 1, FCSL_DRIVER_FAILED, "no GPIO chip is at"));
    CHECK(refuses(in, in_tree("none"), 1, FCSL_DRIVER_ABSENT, "cannot open"));
    kernel.hogged[1] = 1u << 6;
    CHECK(refuses(in, "gpiochip1", 6, FCSL_DRIVER_FAILED, "line6 is in use, by 'sysfs'"));
    CHECK(refuses(out, "gpiochip1", 6, FCSL_DRIVER_FAILED, "line6 is in use, by 'sysfs'"));
    CHECK(probes(in, "gpiochip2", FCSL_DRIVER_OK, "") && probes(out, in_tree("gpiochip2"), FCSL_DRIVER_OK, ""));
    CHECK(probes(out, "gpiochip9", FCSL_DRIVER_ABSENT, "gpiochip9"));
}

int main(void)
{
    make_tree();
    CHECK(setenv("FCSL_DEV", tree, 1) == 0);
    for (int i = 0; i < CHIPS; i++) {
        plug(i);
    }
    put("plain", "no chip\n");
    const int files = count_files();
    check_inputs();
    check_optional_lines();
    check_outputs();
    check_return();
    check_refusals();
    CHECK(count_files() == files);
    remove_tree();
    return 0;
}
