/* SPDX-License-Identifier: Apache-2.0
 *
 * The variables of the model serial_link: a serial line between the plant and its controller. The simulator itself moves the
 * frames (fcsl_sim/src/controllers/serial_link.c); the model declares and checks what is said about the line.
 */
#ifndef FCSL_SERIAL_LINK_H
#define FCSL_SERIAL_LINK_H

#include <stdbool.h>
#include <stdint.h>

#define FCSL_SERIAL_LINK_NAME "serial_link"

typedef struct {
    struct {
        bool reliable;              /* else the newest message wins (port policy latest) */
        bool halts;                 /* no simulated time passes until a message has arrived */
        double drop_percent;        /* of frames */
        double corrupt_percent;     /* of frames: one bit of them is flipped */
        double bit_error_percent;   /* of bits */
        double delay_s;             /* s, one way */
        double baud;                /* bit/s, 10 bits a byte; 0: no time */
        uint32_t retransmit_ticks;  /* link ticks until a reliable port repeats what was not acknowledged */
    } parameters;
    struct {
        uint64_t frames;     /* put on the line, both ways */
        uint64_t dropped;    /* of them */
        uint64_t corrupted;  /* of them */
        uint64_t repeated;   /* of them: sent once more */
        uint64_t sensors;    /* messages that the controller got */
        uint64_t commands;   /* messages that the plant got */
        uint64_t lost;       /* messages: for which a newer one came, or which found no room */
        uint64_t refused;    /* messages whose CRC-32 is wrong */
    } outputs;
} fcsl_serial_link_t;

#endif /* FCSL_SERIAL_LINK_H */
