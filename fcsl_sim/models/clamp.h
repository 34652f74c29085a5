/* SPDX-License-Identifier: Apache-2.0
 *
 * A number held within limits. What is no number stays so, and ends the run.
 */
#ifndef FCSL_SIM_MODELS_CLAMP_H
#define FCSL_SIM_MODELS_CLAMP_H

static inline double clamp(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

#endif /* FCSL_SIM_MODELS_CLAMP_H */
