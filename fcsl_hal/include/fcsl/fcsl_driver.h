/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver ABI: the interface between a host (fcsl-fc, fcsl-guard) and the code that talks to a device, a sensor or an actuator
 * (docs/hardware/hal.md).
 *
 * A driver is one constant descriptor. An opened device is one flat struct that the host allocates; the driver's functions get
 * it and nothing else. Its signals, the values that are exchanged, are members of this struct. A library of drivers exports
 * `fcsl_drivers`, ended by a null pointer.
 */
#ifndef FCSL_DRIVER_H
#define FCSL_DRIVER_H

#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

#define FCSL_DRIVER_ABI_VERSION 3u

enum { FCSL_DRIVER_WAIT_MS = 100 }; /* a read that waits does so for this long at most */

typedef enum {
    FCSL_DRIVER_OK = 0,
    FCSL_DRIVER_NOTHING = 1, /* read: no sample since the last one */
    FCSL_DRIVER_ABSENT =
        2,  /* there is no such device; read: it has gone, the host closes it and probes from time to time */
    FCSL_DRIVER_FAILED = 3   /* the device is there, and it or the system refused */
} fcsl_driver_status_t;

/* Whether the host exchanges the value of a signal. */
typedef enum {
    FCSL_DRIVER_UNUSED = 0,
    FCSL_DRIVER_NEEDED = 1,  /* open fails where the device does not have it */
    FCSL_DRIVER_OPTIONAL = 2 /* sensors: NaN where the device does not have it */
} fcsl_driver_use_t;

/* Why no sample comes of what a device sends. Of several the host tells the last one of this list, which is the nearest to a
 * sample. Its texts are the host's. */
typedef enum {
    FCSL_DRIVER_NOT_TOLD = 0,
    FCSL_DRIVER_NO_BYTES = 1, /* found by the host: nothing arrives */
    FCSL_DRIVER_NO_FRAMES = 2, /* what arrives is no frame of the protocol */
    FCSL_DRIVER_LINE_ENDS = 3, /* lines do not end as those of the protocol do */
    FCSL_DRIVER_NO_CHECKSUMS = 4, /* sentences have none */
    FCSL_DRIVER_OTHER_FRAMES = 5, /* frames, of none of the kinds that are read */
    FCSL_DRIVER_GGA_ALONE = 6, /* without an RMC of the same time */
    FCSL_DRIVER_RMC_ALONE = 7, /* without a GGA of the same time */
    FCSL_DRIVER_NO_TIME = 8, /* the receiver knows none yet */
    FCSL_DRIVER_REFUSED = 9, /* a field that cannot be */
    FCSL_DRIVER_REPEATED = 10, /* the values of the last frame once more: the receiver missed one */
    FCSL_DRIVER_SHORT_FRAMES = 11, /* frames that end before a signal does */
    FCSL_DRIVER_WHYS = 12
} fcsl_driver_why_t;

/* What a read of a stream took in. */
typedef struct {
    uint32_t bytes;
    uint32_t frames; /* whole ones of the protocol, of any kind */
    uint32_t rejected; /* bytes that belong to no frame, or to one that is too short */
    uint32_t why; /* fcsl_driver_why_t */
} fcsl_driver_input_t;

/* A value that a device takes or gives. */
typedef struct {
    const char *name;
    uint8_t type; /* fcsl_type_t, FCSL_BOOL to FCSL_F64 */
    uint32_t count; /* scalars, row by row; 1 for a scalar */
    uint32_t offset; /* of the value in the struct, in native byte order */
    const char *unit; /* "rad/s", or "" */
    const char *doc; /* one line */
} fcsl_driver_signal_t;

/* Every function but close may put a reason into `why` (a text of `size` bytes with its zero, empty before the call) when it
 * returns anything but OK or NOTHING. After open nothing is
 * allocated, except to look for a device that has gone. The host has a thread of its own for each device, so
 * read and write may take as long as the device does; two functions of an opened device never run at the same time. */
typedef struct {
    uint32_t abi_version;
    const char *name;
    const char *doc; /* one line: the device, and what its name is (a path, an address) */
    uint8_t direction; /* fcsl_direction_t: a driver reads or writes, never both */
    const fcsl_driver_signal_t *signals;
    uint32_t signal_count;
    uint32_t state_size; /* of the struct, bytes */
    uint32_t state_align;
    /* Sensors: 1 when read waits for the next sample (FCSL_DRIVER_WAIT_MS at most, then NOTHING) and so sets the pace; 0 when it takes
     * a sample at each call, and the host calls it at the rate that the user gave. */
    uint8_t waits;
    /* Sensors: where the struct has a fcsl_driver_input_t, which is zero before each read and which the read fills; 0: nowhere, so it is
     * not the first member. The host says that a device with one is silent when no sample comes for 2 s. */
    uint32_t input;

    /* Whether the device of this name is there; takes nothing into use and changes nothing. `device` is the text that the user gave, "" for none. */
    fcsl_driver_status_t (*probe)(const char *device, char *why, size_t size);
    /* Opens it. `self` is zeroed. `used` has one fcsl_driver_use_t per signal; leave those of the device alone that are not
     * used. An actuator keeps doing what it does until the first write. `device` lasts until close. After
     * another status than OK there is nothing to close. */
    fcsl_driver_status_t (*open)(void *self, const char *device, const uint8_t *used, char *why, size_t size);
    /* Sensors (else null): puts a sample into the used signals of `self`, and the monotonic time at which it was taken into
     * *sample_ns; or changes neither. Samples come in their order. A value that the device does not tell is NaN. */
    fcsl_driver_status_t (*read)(void *self, uint64_t *sample_ns, char *why, size_t size);
    /* Actuators (else null): drives the device with the used signals of `self`. Called again and again, with equal values too, and always
     * with the newest ones: those that came during a write are not kept. The host tells of a write that lasts for too long. */
    fcsl_driver_status_t (*write)(void *self, char *why, size_t size);
    /* The host has written an actuator's safe values before, if it could: close leaves the device as it is. */
    void (*close)(void *self);
} fcsl_driver_t;

/* Exported regardless of compiler flags. */
extern __attribute__((visibility("default"))) const fcsl_driver_t *const fcsl_drivers[];

/* The drivers that come with FCSL; ends with a null pointer. */
extern const fcsl_driver_t *const fcsl_drivers_built_in[];

/* A signal, from the member of the struct that holds its value: a scalar or an array of one axis (bool, int32_t … double).
 *
 *   FCSL_DRIVER_SIGNAL(winch_t, speed, "m/s", "speed of the rope, positive: out")
 */
#define FCSL_DRIVER_SIGNAL(struct_, member_, unit_, doc_)                                                              \
    {.name = #member_,                                                                                                 \
     .type = FCSL_DRIVER_TYPE(((struct_ *)0)->member_),                                                                \
     .count = sizeof(((struct_ *)0)->member_) / FCSL_DRIVER_SCALAR_BYTES(((struct_ *)0)->member_),                     \
     .offset = offsetof(struct_, member_),                                                                             \
     .unit = (unit_),                                                                                                  \
     .doc = (doc_)}
#define FCSL_DRIVER_TYPE(member_)                                                                                      \
    _Generic((member_),                                                                                                \
        _Bool: FCSL_BOOL,                                                                                              \
        _Bool *: FCSL_BOOL,                                                                                            \
        int32_t: FCSL_I32,                                                                                             \
        int32_t *: FCSL_I32,                                                                                           \
        int64_t: FCSL_I64,                                                                                             \
        int64_t *: FCSL_I64,                                                                                           \
        uint32_t: FCSL_U32,                                                                                            \
        uint32_t *: FCSL_U32,                                                                                          \
        uint64_t: FCSL_U64,                                                                                            \
        uint64_t *: FCSL_U64,                                                                                          \
        float: FCSL_F32,                                                                                               \
        float *: FCSL_F32,                                                                                             \
        double: FCSL_F64,                                                                                              \
        double *: FCSL_F64)
#define FCSL_DRIVER_SCALAR_BYTES(member_)                                                                              \
    _Generic((member_),                                                                                                \
        _Bool: 1u,                                                                                                     \
        _Bool *: 1u,                                                                                                   \
        int32_t: 4u,                                                                                                   \
        int32_t *: 4u,                                                                                                 \
        uint32_t: 4u,                                                                                                  \
        uint32_t *: 4u,                                                                                                \
        float: 4u,                                                                                                     \
        float *: 4u,                                                                                                   \
        default: 8u)

#ifdef __cplusplus
}
#endif

#endif /* FCSL_DRIVER_H */
