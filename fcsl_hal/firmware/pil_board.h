/* SPDX-License-Identifier: Apache-2.0
 *
 * What a board gives to controller.c: a serial line, and a tick of its timer each millisecond. mps2-an500/ is an example.
 */
#ifndef FCSL_PIL_BOARD_H
#define FCSL_PIL_BOARD_H

#include <stdint.h>

/* Called once, before the others. */
void board_open(void);
/* 1 with the next byte of the line; 0 if none has come. An interrupt may have kept it until now. */
int board_receive(uint8_t *byte);
/* Waits until the line takes the byte. */
void board_send(uint8_t byte);
/* 1 once for each millisecond that has passed. */
int board_tick(void);
/* Sleeps until a byte or a tick comes; it may also return at once. */
void board_wait(void);
/* Text for who debugs the board: why the flight cannot begin, and the checksum at its end. It may do nothing. */
void board_print(const char *text);

/* The program; its result says how it went, 0 for well. The start-up code of the board calls it. */
int main(int argc, char **argv);

#endif /* FCSL_PIL_BOARD_H */
