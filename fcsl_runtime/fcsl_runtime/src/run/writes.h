/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_WRITES_H
#define FCSL_WRITES_H

#include "record/recorder.h"

/* Records a host write that the coming tick will be the first to see. */
void fcsl_note_write(fcsl_run_t *run, const fcsl_write_t *write);

#endif /* FCSL_WRITES_H */
