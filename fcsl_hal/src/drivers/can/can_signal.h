/* SPDX-License-Identifier: Apache-2.0
 *
 * Signals in CAN frames, numbered and packed as in a DBC file. The text of one is `ID/START:LENGTH@ORDER SIGN`, then optionally
 * `*SCALE` and an offset with its sign:
 *
 *   1A0/16:12@1-*0.1-40     of frame 0x1A0 the 12 bits from bit 16 on, signed, little-endian; value = raw * 0.1 - 40
 *   18FEF100/7:16@0+        of the extended frame 0x18FEF100 16 bits, big-endian, unsigned; bit 7 is the highest
 *
 * An id has 3 hexadecimal digits, an extended one 8. START, ORDER (1: Intel, 0: Motorola) and SIGN (+: unsigned) are those of a DBC file:
 * `SG_ name : 16|12@1- (0.1,-40)`.
 */
#ifndef FCSL_CAN_SIGNAL_H
#define FCSL_CAN_SIGNAL_H

#include <linux/can.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    canid_t id; /* with CAN_EFF_FLAG where it is extended */
    uint32_t start; /* bit: the lowest one (little-endian), the highest one (big-endian) */
    uint32_t length; /* bits, 1 to 64 */
    int big_endian;
    int is_signed;
    double scale;
    double offset;
} can_signal_t;

/* Reads the text of one signal. Returns where it ends, or null where it is none. */
const char *can_signal_parse(const char *text, can_signal_t *signal);

/* Returns 1 with the value when this is the frame of the signal and long enough for it, else 0. */
int can_signal_take(const can_signal_t *signal, const struct canfd_frame *frame, double *value);

#endif /* FCSL_CAN_SIGNAL_H */
