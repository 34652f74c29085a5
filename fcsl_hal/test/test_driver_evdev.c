/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `evdev`: what events make of the channels, and the driver on an input device that is played here: a FIFO with the
 * events, and this program's ioctl in place of the system's.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <linux/input.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "driver_rig.h"
#include "drivers.h"
#include "drivers/evdev/evdev_sticks.h"

enum { PATH_BYTES = 256, AXES = 3, NS_PER_US = 1000 };

/* ---- the kernel's part -------------------------------------------------------------------------------------------------- */

static struct {
    uint8_t axes[ABS_CNT / 8];
    uint8_t keys[KEY_CNT / 8];
    uint8_t pressed[KEY_CNT / 8];
    struct input_absinfo axis[ABS_CNT];
    int clock;
    int gone;
} kernel;

static void set_bit(uint8_t *bits, uint32_t bit, int value)
{
    bits[bit / 8u] = (uint8_t)((bits[bit / 8u] & ~(1u << bit % 8u)) | (unsigned)value << bit % 8u);
}

static int copy_bits(uint8_t *to, uint32_t size, const uint8_t *bits, uint32_t have)
{
    const uint32_t count = size < have ? size : have;
    memcpy(to, bits, count);
    return (int)count;
}

static int answer(uint32_t number, uint32_t size, void *argument)
{
    if (kernel.gone) {
        errno = ENODEV;
        return -1;
    }
    if (number == _IOC_NR(EVIOCSCLOCKID)) {
        memcpy(&kernel.clock, argument, sizeof kernel.clock);
        return 0;
    }
    if (number == _IOC_NR(EVIOCGBIT(EV_ABS, 0))) {
        return copy_bits(argument, size, kernel.axes, sizeof kernel.axes);
    }
    if (number == _IOC_NR(EVIOCGBIT(EV_KEY, 0))) {
        return copy_bits(argument, size, kernel.keys, sizeof kernel.keys);
    }
    if (number == _IOC_NR(EVIOCGKEY(0))) {
        return copy_bits(argument, size, kernel.pressed, sizeof kernel.pressed);
    }
    CHECK(number >= _IOC_NR(EVIOCGABS(0)) && number < _IOC_NR(EVIOCGABS(0)) + ABS_CNT);
    memcpy(argument, &kernel.axis[number - _IOC_NR(EVIOCGABS(0))], sizeof kernel.axis[0]);
    return 0;
}

int ioctl(int fd, unsigned long request, ...)
{
    struct stat found;
    va_list arguments;
    va_start(arguments, request);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    if (_IOC_TYPE(request) == 'E' && fstat(fd, &found) == 0 && S_ISFIFO(found.st_mode)) {
        return answer((uint32_t)_IOC_NR(request), (uint32_t)_IOC_SIZE(request), argument);
    }
    return (int)syscall(SYS_ioctl, fd, request, argument);
}

/* ---- the channels alone ------------------------------------------------------------------------------------------------- */

static struct input_event event_of(uint16_t type, uint16_t code, int32_t value)
{
    return (struct input_event){.type = type, .code = code, .value = value};
}

static evdev_kind_t take(evdev_sticks_t *sticks, uint16_t type, uint16_t code, int32_t value)
{
    const struct input_event event = event_of(type, code, value);
    return evdev_take(sticks, &event);
}

static void check_scale(void)
{
    static const struct {
        int32_t minimum;
        int32_t maximum;
        int32_t value;
        double pulse_us;
    } CASES[] = {{0, 2047, 0, 1000.0},
                 {0, 2047, 2047, 2000.0},
                 {0, 2048, 1024, 1500.0},
                 {-127, 127, 0, 1500.0},
                 {-32768, 32767, -32768, 1000.0},
                 {-1, 1, 1, 2000.0},
                 {INT32_MIN, INT32_MAX, INT32_MAX, 2000.0},
                 {INT32_MIN, INT32_MAX, INT32_MIN, 1000.0},
                 {0, 100, 110, 2100.0},
                 {0, 100, -10, 900.0},
                 {5, 5, 5, NAN},
                 {INT32_MAX, INT32_MIN, 0, NAN}};
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        evdev_sticks_t sticks;
        evdev_clear(&sticks);
        evdev_add(&sticks, (evdev_channel_t){EV_ABS, ABS_X, CASES[i].minimum, CASES[i].maximum});
        CHECK(isnan(sticks.pulse_us[0]));
        CHECK(take(&sticks, EV_ABS, ABS_X, CASES[i].value) == EVDEV_NOTHING);
        CHECK(isnan(CASES[i].pulse_us) ? isnan(sticks.pulse_us[0]) : sticks.pulse_us[0] == CASES[i].pulse_us);
        CHECK(isnan(sticks.pulse_us[1]));
    }
}

static void check_events(void)
{
    evdev_sticks_t sticks;
    evdev_clear(&sticks);
    evdev_add(&sticks, (evdev_channel_t){EV_ABS, ABS_RUDDER, 0, 10});
    evdev_add(&sticks, (evdev_channel_t){.type = EV_KEY, .code = BTN_TRIGGER});
    CHECK(take(&sticks, EV_ABS, ABS_RUDDER, 10) == EVDEV_NOTHING);
    CHECK(take(&sticks, EV_KEY, BTN_TRIGGER, 1) == EVDEV_NOTHING);
    CHECK(take(&sticks, EV_SYN, SYN_REPORT, 0) == EVDEV_REPORT);
    CHECK(sticks.pulse_us[0] == 2000.0 && sticks.pulse_us[1] == 2000.0);
    CHECK(take(&sticks, EV_KEY, BTN_TRIGGER, 2) == EVDEV_NOTHING && sticks.pulse_us[1] == 2000.0);
    CHECK(take(&sticks, EV_KEY, BTN_TRIGGER, 0) == EVDEV_NOTHING && sticks.pulse_us[1] == 1000.0);
    /* Others: of the same code but another type, of another code, of no type at all. */
    CHECK(take(&sticks, EV_KEY, ABS_RUDDER, 0) == EVDEV_NOTHING && take(&sticks, EV_ABS, ABS_X, 3) == EVDEV_NOTHING);
    CHECK(take(&sticks, EV_MSC, MSC_SCAN, 7) == EVDEV_NOTHING && take(&sticks, 0xFFFF, 0xFFFF, -1) == EVDEV_NOTHING);
    CHECK(take(&sticks, EV_SYN, SYN_MT_REPORT, 0) == EVDEV_NOTHING);
    CHECK(sticks.pulse_us[0] == 2000.0 && sticks.pulse_us[1] == 1000.0);
}

/* Events behind a loss belong to a report that is not whole. */
static void check_lost_events(void)
{
    evdev_sticks_t sticks;
    evdev_clear(&sticks);
    evdev_add(&sticks, (evdev_channel_t){EV_ABS, ABS_X, 0, 10});
    CHECK(take(&sticks, EV_ABS, ABS_X, 10) == EVDEV_NOTHING);
    CHECK(take(&sticks, EV_SYN, SYN_DROPPED, 0) == EVDEV_NOTHING);
    CHECK(take(&sticks, EV_ABS, ABS_X, 0) == EVDEV_NOTHING && sticks.pulse_us[0] == 2000.0);
    CHECK(take(&sticks, EV_SYN, SYN_DROPPED, 0) == EVDEV_NOTHING);
    CHECK(take(&sticks, EV_SYN, SYN_REPORT, 0) == EVDEV_LOST);
    CHECK(take(&sticks, EV_ABS, ABS_X, 0) == EVDEV_NOTHING && sticks.pulse_us[0] == 1000.0);
    CHECK(take(&sticks, EV_SYN, SYN_REPORT, 0) == EVDEV_REPORT);
}

static void check_many_channels(void)
{
    evdev_sticks_t sticks;
    evdev_clear(&sticks);
    for (uint16_t i = 0; i < 100u; i++) {
        evdev_add(&sticks, (evdev_channel_t){.type = EV_KEY, .code = (uint16_t)(BTN_JOYSTICK + i)});
        CHECK(take(&sticks, EV_KEY, (uint16_t)(BTN_JOYSTICK + i), 1) == EVDEV_NOTHING);
    }
    CHECK(sticks.count == EVDEV_CHANNELS_MAX);
    for (uint32_t i = 0; i < EVDEV_CHANNELS_MAX; i++) {
        CHECK(sticks.pulse_us[i] == 2000.0);
    }
}

/* ---- the driver --------------------------------------------------------------------------------------------------------- */

static char root[] = "/tmp/fcsl_evdev_XXXXXX";
static char fifo[PATH_BYTES];

static void make_attribute(int number, const char *name, const char *text)
{
    char path[PATH_BYTES];
    CHECK(snprintf(path, sizeof path, "%s/class/input/event%d/device/%s", root, number, name) < PATH_BYTES);
    FILE *file = fopen(path, "w");
    CHECK(file != NULL && fprintf(file, "%s\n", text) > 0 && fclose(file) == 0);
}

static void make_folders(void)
{
    static const char *const FOLDERS[] = {"class",
                                          "class/input",
                                          "class/input/mouse0",
                                          "class/input/event3",
                                          "class/input/event3/device",
                                          "class/input/event12",
                                          "class/input/event12/device",
                                          "input"};
    char path[PATH_BYTES];
    for (size_t i = 0; i < sizeof FOLDERS / sizeof FOLDERS[0]; i++) {
        CHECK(snprintf(path, sizeof path, "%s/%s", root, FOLDERS[i]) < PATH_BYTES && mkdir(path, S_IRWXU) == 0);
    }
}

/* Two input devices in a sysfs of our own; the second one has a file. */
static void make_root(void)
{
    CHECK(mkdtemp(root) != NULL && setenv("FCSL_SYSFS", root, 1) == 0 && setenv("FCSL_DEV", root, 1) == 0);
    make_folders();
    make_attribute(3, "name", "Power Button");
    make_attribute(3, "phys", "LNXPWRBN/button/input0");
    make_attribute(3, "uniq", "");
    make_attribute(12, "name", "OpenTX Radio Joystick");
    make_attribute(12, "phys", "usb-0000:00:14.0-2/input0");
    make_attribute(12, "uniq", "00000000001B");
    CHECK(snprintf(fifo, sizeof fifo, "%s/input/event12", root) < PATH_BYTES && mkfifo(fifo, S_IRUSR | S_IWUSR) == 0);
}

static int remove_entry(const char *path, const struct stat *status, int kind, struct FTW *place)
{
    (void)status;
    (void)kind;
    (void)place;
    return remove(path);
}

static void remove_root(void)
{
    CHECK(nftw(root, remove_entry, 8, FTW_DEPTH | FTW_PHYS) == 0);
}

static void make_kernel(void)
{
    static const uint16_t CODES[AXES] = {ABS_X, ABS_RZ, ABS_HAT0X};
    memset(&kernel, 0, sizeof kernel);
    kernel.clock = -1;
    for (size_t i = 0; i < AXES; i++) {
        set_bit(kernel.axes, CODES[i], 1);
        kernel.axis[CODES[i]] = (struct input_absinfo){.value = 512, .minimum = 0, .maximum = 1024};
    }
    set_bit(kernel.axes, ABS_MT_SLOT, 1); /* none of these three is a stick */
    set_bit(kernel.keys, KEY_POWER, 1);
    set_bit(kernel.keys, BTN_TOUCH, 1);
    set_bit(kernel.keys, BTN_JOYSTICK, 1);
    set_bit(kernel.keys, BTN_TRIGGER_HAPPY40, 1);
    set_bit(kernel.pressed, BTN_TRIGGER_HAPPY40, 1);
}

static int sticks_are(const rig_t *rig, double x, double rz, double hat, double button, double last)
{
    return rig_value(rig, "sticks", 0) == x && rig_value(rig, "sticks", 1) == rz &&
           rig_value(rig, "sticks", 2) == hat && rig_value(rig, "sticks", 3) == button &&
           rig_value(rig, "sticks", 4) == last && isnan(rig_value(rig, "sticks", 5)) &&
           rig_value(rig, "failsafe", 0) == 0.0;
}

static void check_probe(void)
{
    const fcsl_driver_t *driver = &fcsl_driver_evdev;
    CHECK(rig_probes(driver, "OpenTX Radio Joystick", FCSL_DRIVER_OK, ""));
    CHECK(rig_probes(driver, "00000000001B", FCSL_DRIVER_OK, "") && rig_probes(driver, fifo, FCSL_DRIVER_OK, ""));
    CHECK(rig_probes(driver, "usb-0000:00:14.0-2/input0", FCSL_DRIVER_OK, ""));
    CHECK(rig_probes(driver, "", FCSL_DRIVER_ABSENT, "name the input device"));
    CHECK(rig_probes(driver, "OpenTX", FCSL_DRIVER_ABSENT, "no input device is called 'OpenTX'"));
    CHECK(rig_probes(driver, "Power Button", FCSL_DRIVER_ABSENT, "input/event3': No such file"));
    CHECK(rig_probes(driver, "/dev/input/event99", FCSL_DRIVER_ABSENT, "No such file"));
    make_attribute(3, "uniq", "00000000001B");
    CHECK(rig_probes(driver, "00000000001B", FCSL_DRIVER_FAILED, "2 input devices are called"));
    make_attribute(3, "uniq", "");
}

static void check_open(void)
{
    static rig_t rig;
    make_kernel();
    CHECK(rig_open(&rig, &fcsl_driver_evdev, "Power Button") == FCSL_DRIVER_ABSENT && rig.why[0] != '\0');
    CHECK(rig_open(&rig, &fcsl_driver_evdev, "/dev/null") == FCSL_DRIVER_FAILED && rig.why[0] != '\0');
    memset(kernel.axes, 0, sizeof kernel.axes);
    CHECK(rig_open(&rig, &fcsl_driver_evdev, fifo) == FCSL_DRIVER_FAILED && strstr(rig.why, "no joystick") != NULL);
    kernel.gone = 1;
    CHECK(rig_open(&rig, &fcsl_driver_evdev, fifo) == FCSL_DRIVER_ABSENT && rig.why[0] != '\0');
}

static void send_event(int device, uint16_t type, uint16_t code, int32_t value, uint64_t time_us)
{
    struct input_event event = event_of(type, code, value);
    event.input_event_sec = (__typeof__(event.input_event_sec))(time_us / 1000000u);
    event.input_event_usec = (__typeof__(event.input_event_usec))(time_us % 1000000u);
    CHECK(write(device, &event, sizeof event) == (ssize_t)sizeof event);
}

static void check_reports(rig_t *rig, int device)
{
    const uint64_t now_us = fcsl_monotonic_ns() / NS_PER_US;
    send_event(device, EV_ABS, ABS_X, 1024, now_us - 30u);
    send_event(device, EV_KEY, BTN_JOYSTICK, 1, now_us - 30u);
    send_event(device, EV_SYN, SYN_REPORT, 0, now_us - 30u);
    send_event(device, EV_ABS, ABS_RZ, 0, now_us - 20u);
    send_event(device, EV_SYN, SYN_REPORT, 0, now_us - 20u);
    send_event(device, EV_ABS, ABS_HAT0X, 0, now_us - 10u); /* its report comes later */
    CHECK(rig_read(rig) == FCSL_DRIVER_OK && sticks_are(rig, 2000.0, 1500.0, 1500.0, 2000.0, 2000.0));
    CHECK(rig->sample_ns == (now_us - 30u) * NS_PER_US);
    CHECK(rig_read(rig) == FCSL_DRIVER_OK && sticks_are(rig, 2000.0, 1000.0, 1500.0, 2000.0, 2000.0));
    CHECK(rig->sample_ns == (now_us - 20u) * NS_PER_US);
    send_event(device, EV_SYN, SYN_REPORT, 0, now_us - 25u); /* time goes back */
    CHECK(rig_read(rig) == FCSL_DRIVER_OK && sticks_are(rig, 2000.0, 1000.0, 1000.0, 2000.0, 2000.0));
    CHECK(rig->sample_ns == (now_us - 20u) * NS_PER_US + 1u);
}

/* Lost events: the state comes from the device. */
static void check_resync(rig_t *rig, int device)
{
    const uint64_t now_us = fcsl_monotonic_ns() / NS_PER_US;
    kernel.axis[ABS_X].value = 256;
    kernel.axis[ABS_RZ].value = 768;
    set_bit(kernel.pressed, BTN_TRIGGER_HAPPY40, 0);
    send_event(device, EV_SYN, SYN_DROPPED, 0, now_us);
    send_event(device, EV_ABS, ABS_X, 1, now_us);
    send_event(device, EV_SYN, SYN_REPORT, 0, now_us);
    CHECK(rig_read(rig) == FCSL_DRIVER_OK && sticks_are(rig, 1250.0, 1750.0, 1500.0, 1000.0, 1000.0));
    CHECK(rig->sample_ns == now_us * NS_PER_US);
}

/* A joystick at rest: the same values, with the time of now, while it is there. */
static void check_rest(rig_t *rig)
{
    enum { REST_MS = 90, SILENT_MS = 200, TRIES = 5 };
    uint64_t shortest_ns = UINT64_MAX;
    for (int i = 0; i < TRIES && shortest_ns >= (uint64_t)SILENT_MS * FCSL_NS_PER_MS; i++) {
        const uint64_t before_ns = fcsl_monotonic_ns();
        CHECK(rig_read(rig) == FCSL_DRIVER_OK && sticks_are(rig, 1250.0, 1750.0, 1500.0, 1000.0, 1000.0));
        CHECK(rig->sample_ns - before_ns >= (uint64_t)REST_MS * FCSL_NS_PER_MS &&
              rig->sample_ns <= fcsl_monotonic_ns());
        shortest_ns = rig->took_ns < shortest_ns ? rig->took_ns : shortest_ns;
    }
    CHECK(shortest_ns < (uint64_t)SILENT_MS * FCSL_NS_PER_MS);
}

static void check_driver(void)
{
    static rig_t rig;
    make_kernel();
    CHECK(rig_open(&rig, &fcsl_driver_evdev, "OpenTX Radio Joystick") == FCSL_DRIVER_OK);
    CHECK(kernel.clock == CLOCK_MONOTONIC && sticks_are(&rig, 1500.0, 1500.0, 1500.0, 1000.0, 2000.0));
    const int device = open(fifo, O_WRONLY | O_CLOEXEC);
    CHECK(device >= 0);
    check_reports(&rig, device);
    check_resync(&rig, device);
    check_rest(&rig);
    kernel.gone = 1; /* unplugged while nothing moves */
    CHECK(rig_read(&rig) == FCSL_DRIVER_ABSENT && strstr(rig.why, "No such device") != NULL);
    CHECK(close(device) == 0); /* and while it is read */
    CHECK(rig_read(&rig) == FCSL_DRIVER_ABSENT && rig.took_ns < (uint64_t)FCSL_DRIVER_WAIT_MS * FCSL_NS_PER_MS);
    rig_close(&rig);
}

int main(void)
{
    check_scale();
    check_events();
    check_lost_events();
    check_many_channels();
    make_root();
    check_probe();
    check_open();
    check_driver();
    remove_root();
    return 0;
}
