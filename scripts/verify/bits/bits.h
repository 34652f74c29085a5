/* SPDX-License-Identifier: Apache-2.0
 *
 * What bits.c asks of the platform it runs on: a hosted C library (hosted.c), or a bare processor (fcsl_hal/firmware/mps2-an500/start.c).
 */
#ifndef FCSL_VERIFY_BITS_H
#define FCSL_VERIFY_BITS_H

/* Writes text to where the caller of the program reads it. */
void board_print(const char *text);

int main(int argc, char **argv);

#endif /* FCSL_VERIFY_BITS_H */
