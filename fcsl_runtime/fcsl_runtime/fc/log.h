/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FC_LOG_H
#define FC_LOG_H

/* Before anything is opened: what is opened from here on does not get the numbers that are printed to. */
void log_fill_standard(void);

/* Writes the program's name, ": ", the text and a newline, or leaves them out where that would wait: whoever holds the other end of a
 * pipe and does not read, or has stopped the terminal, must keep the program neither from flying nor from ending. */
__attribute__((format(printf, 1, 2))) void log_info(const char *format, ...); /* on standard output */
__attribute__((format(printf, 1, 2))) void log_error(const char *format, ...);   /* on standard error */

#endif /* FC_LOG_H */
