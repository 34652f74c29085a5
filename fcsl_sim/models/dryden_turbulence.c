/* SPDX-License-Identifier: Apache-2.0
 *
 * Continuous turbulence with the Dryden spectra of MIL-F-8785C, along the path through a frozen field.
 *
 * With spatial frequency W (rad/m), scale lengths Lu, Lv, Lw, deviations su, sv, sw and wingspan b:
 *
 * Su = su^2 (2 Lu / pi) / (1 + (Lu W)^2),  Sv = sv^2 (Lv / pi) (1 + 3 (Lv W)^2) / (1 + (Lv W)^2)^2,  Sw likewise
 * Sp = (sw^2 / Lw) 0.8 (pi Lw / (4 b))^(1/3) / (1 + (4 b W / pi)^2)
 * Sq = W^2 / (1 + (4 b W / pi)^2) Sw,  Sr = W^2 / (1 + (3 b W / pi)^2) Sv
 *
 * Each is one-sided: its integral over W from 0 is the variance. Height h in ft, wind speed W20 at 20 ft:
 * to 1000 ft:     Lw = h, Lu = Lv = h / (0.177 + 0.000823 h)^1.2, sw = 0.1 W20, su = sv = sw / (0.177 + 0.000823 h)^0.4
 * above 2000 ft:  Lu = Lv = Lw = 1750 ft, su = sv = sw given
 * Between these, lengths and deviations are interpolated linearly. Heights below 10 ft count as 10 ft.
 *
 * An update moves on by d = airspeed (time since the last update). White noise n drives linear filters in the path
 * length, dx/ds = F x + G n, solved exactly over d: x becomes exp(F d) x + C n with C C^T = P - exp(F d) P exp(F d)^T,
 * and P the covariance that does not change. So neither the rate nor changes of airspeed disturb variance or spectrum,
 * and nothing is divided by an airspeed. The first update draws from P.
 *
 * Source: MIL-F-8785C, Flying Qualities of Piloted Airplanes (1980), section 3.7. It leaves the sign of q and r open;
 * here they are the rotation of the air: q = -dw/dx, r = dv/dx. Limits: the axes are those of the body at all heights.
 */
#include <stdbool.h>

#include "fcsl/fcsl_model.h"

enum { LONGITUDINAL, LATERAL, VERTICAL, ROLL }; /* streams of noise */
enum { SHAPE = 3 }; /* states of a lateral or vertical filter */

static const double PI = 3.14159265358979323846;
static const double ROOT_3 = 1.7320508075688772;
static const double FOOT = 0.3048; /* m */
static const double LOWEST = 10.0; /* ft */
static const double LOW = 1000.0; /* ft */
static const double HIGH = 2000.0; /* ft */
static const double HIGH_LENGTH = 1750.0 * 0.3048; /* m */
static const double UNCORRELATED = 1e9; /* m, a path after which nothing is left of a state */
static const double SMALLEST_VARIANCE = 1e-15; /* of a step; smaller ones are rounding */

typedef struct {
    struct {
        double height, airspeed;
    } inputs;
    struct {
        double wind_speed_20ft, high_intensity, wingspan;
    } parameters;
    struct {
        double longitudinal, lateral[SHAPE], vertical[SHAPE], roll; /* for deviations of 1 */
        int64_t time_ns;
        bool is_started;
    } state;
    struct {
        double gust_body[3];
        double gust_rate_body[3];
    } outputs;
} dryden_turbulence_t;

typedef struct {
    double horizontal_length, vertical_length;       /* m */
    double horizontal_deviation, vertical_deviation; /* m/s */
} intensity_t;

static intensity_t low_altitude(double feet, double wind_speed_20ft)
{
    const double base = 0.177 + 0.000823 * feet;
    const double deviation = 0.1 * wind_speed_20ft;
    return (intensity_t){feet * FOOT / cr_pow(base, 1.2), feet * FOOT, deviation / cr_pow(base, 0.4), deviation};
}

static intensity_t intensity_at(const dryden_turbulence_t *air)
{
    const double feet = air->inputs.height / FOOT;
    const double low = feet < LOWEST ? LOWEST : feet > LOW ? LOW : feet;
    const intensity_t below = low_altitude(low, air->parameters.wind_speed_20ft);
    const double part = feet < LOW ? 0.0 : feet > HIGH ? 1.0 : (feet - LOW) / (HIGH - LOW);
    const double above = air->parameters.high_intensity;
    return (intensity_t){
        below.horizontal_length + part * (HIGH_LENGTH - below.horizontal_length),
        below.vertical_length + part * (HIGH_LENGTH - below.vertical_length),
        below.horizontal_deviation + part * (above - below.horizontal_deviation),
        below.vertical_deviation + part * (above - below.vertical_deviation),
    };
}

/* y of variance 1 and L y' + y = white noise. */
static double step_first_order(double y, double path, double length, const fcsl_model_context_t *context,
                               uint32_t stream)
{
    const double e = path / length;
    return cr_exp(-e) * y + sqrt(-cr_expm1(-2.0 * e)) * context->gaussian(context->noise, stream);
}

/* (exp(g) - 1) / g and (exp(g) - 1 - g) / g^2, times exp(-e), with g = (1 - ratio) e. */
static void exponential_means(double e, double ratio, double *first, double *second)
{
    const double g = (1.0 - ratio) * e;
    const double decay = cr_exp(-e);
    if (fabs(g) > 0.5) {
        const double rise = cr_exp(-ratio * e) - decay;
        *first = rise / g;
        *second = (rise - g * decay) / (g * g);
        return;
    }
    double sum1 = 0.0, sum2 = 0.0, term = 1.0; /* term = g^k / k! */
    for (int k = 0; k < 14; k++) {
        sum1 += term / (k + 1);
        sum2 += term / ((k + 1) * (k + 2));
        term *= g / (k + 1);
    }
    *first = decay * sum1;
    *second = decay * sum2;
}

/* The filter of v or w with the low-pass of its rate, over the path in units of L; `ratio` is L over the length of the
 * low-pass: x0' = -x0 + n, x1' = -x1 + x0, y = sqrt(3) x0 + (1 - sqrt(3)) x1, x2' = ratio (y - x2). y has variance 1.
 */
static double shape_value(const double *x)
{
    return ROOT_3 * x[0] + (1.0 - ROOT_3) * x[1];
}

static void shape_transition(double e, double ratio, double a[SHAPE][SHAPE])
{
    double first, second;
    exponential_means(e, ratio, &first, &second);
    const double decay = cr_exp(-e);
    const double from_y0 = ratio * e * first, from_y1 = ratio * e * e * second;
    const double rows[SHAPE][SHAPE] = {
        {decay, 0.0, 0.0},
        {e * decay, decay, 0.0},
        {ROOT_3 * from_y0 + (1.0 - ROOT_3) * from_y1, (1.0 - ROOT_3) * from_y0, cr_exp(-ratio * e)},
    };
    for (int i = 0; i < SHAPE; i++) {
        for (int j = 0; j < SHAPE; j++) {
            a[i][j] = rows[i][j];
        }
    }
}

/* P of F P + P F^T + G G^T = 0 */
static void shape_covariance(double ratio, double p[SHAPE][SHAPE])
{
    const double p02 = ratio / (1.0 + ratio) * 0.25 * (1.0 + ROOT_3);
    const double p12 = (p02 + 0.25 * ratio) / (1.0 + ratio);
    p[0][0] = 0.5;
    p[0][1] = p[1][0] = p[1][1] = 0.25;
    p[0][2] = p[2][0] = p02;
    p[1][2] = p[2][1] = p12;
    p[2][2] = ROOT_3 * p02 + (1.0 - ROOT_3) * p12;
}

/* c of c c^T = P - A P A^T, by Cholesky's method. */
static void shape_noise(const double a[SHAPE][SHAPE], const double p[SHAPE][SHAPE], double c[SHAPE][SHAPE])
{
    for (int i = 0; i < SHAPE; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = p[i][j];
            for (int k = 0; k < SHAPE; k++) {
                for (int l = 0; l < SHAPE; l++) {
                    sum -= a[i][k] * p[k][l] * a[j][l];
                }
            }
            for (int k = 0; k < j; k++) {
                sum -= c[i][k] * c[j][k];
            }
            if (i == j) {
                c[i][j] = sum > SMALLEST_VARIANCE ? sqrt(sum) : 0.0;
            } else {
                c[i][j] = c[j][j] > 0.0 ? sum / c[j][j] : 0.0;
            }
        }
    }
}

static void step_shape(double *x, double path, double length, double low_pass, const fcsl_model_context_t *context,
                       uint32_t stream)
{
    double a[SHAPE][SHAPE], p[SHAPE][SHAPE], c[SHAPE][SHAPE], noise[SHAPE], next[SHAPE];
    shape_transition(path / length, length / low_pass, a);
    shape_covariance(length / low_pass, p);
    shape_noise((const double (*)[SHAPE])a, (const double (*)[SHAPE])p, c);
    for (int i = 0; i < SHAPE; i++) {
        noise[i] = context->gaussian(context->noise, stream);
        next[i] = 0.0;
        for (int j = 0; j < SHAPE; j++) {
            next[i] += a[i][j] * x[j];
        }
        for (int j = 0; j <= i; j++) {
            next[i] += c[i][j] * noise[j];
        }
    }
    for (int i = 0; i < SHAPE; i++) {
        x[i] = next[i];
    }
}

static const char *init(void *self, const fcsl_model_context_t *context)
{
    dryden_turbulence_t *air = self;
    (void)context;
    if (!(air->parameters.wind_speed_20ft >= 0.0)) {
        return "parameters.wind_speed_20ft must not be negative";
    }
    if (!(air->parameters.high_intensity >= 0.0)) {
        return "parameters.high_intensity must not be negative";
    }
    if (!(air->parameters.wingspan > 0.0)) {
        return "parameters.wingspan must be positive";
    }
    air->state.is_started = false;
    return NULL;
}

static void update(void *self, const fcsl_model_context_t *context)
{
    dryden_turbulence_t *air = self;
    const double seconds = (double)(context->time_ns - air->state.time_ns) * 1e-9;
    const double path = air->state.is_started ? fabs(air->inputs.airspeed) * seconds : UNCORRELATED;
    air->state.is_started = true;
    air->state.time_ns = context->time_ns;

    const intensity_t at = intensity_at(air);
    const double wingspan = air->parameters.wingspan;
    const double vertical_low_pass = 4.0 * wingspan / PI, lateral_low_pass = 3.0 * wingspan / PI; /* m */
    double *v = air->state.lateral, *w = air->state.vertical;
    air->state.longitudinal =
        step_first_order(air->state.longitudinal, path, at.horizontal_length, context, LONGITUDINAL);
    step_shape(v, path, at.horizontal_length, lateral_low_pass, context, LATERAL);
    step_shape(w, path, at.vertical_length, vertical_low_pass, context, VERTICAL);
    air->state.roll = step_first_order(air->state.roll, path, vertical_low_pass, context, ROLL);

    air->outputs.gust_body[0] = at.horizontal_deviation * air->state.longitudinal;
    air->outputs.gust_body[1] = at.horizontal_deviation * shape_value(v);
    air->outputs.gust_body[2] = at.vertical_deviation * shape_value(w);
    /* the integral of Sp over W */
    const double roll_variance =
        0.8 * cr_cbrt(PI * at.vertical_length / (4.0 * wingspan)) / at.vertical_length * (PI * PI / (8.0 * wingspan));
    air->outputs.gust_rate_body[0] = at.vertical_deviation * sqrt(roll_variance) * air->state.roll;
    air->outputs.gust_rate_body[1] = -at.vertical_deviation * (shape_value(w) - w[2]) / vertical_low_pass;
    air->outputs.gust_rate_body[2] = at.horizontal_deviation * (shape_value(v) - v[2]) / lateral_low_pass;
}

#define SCALAR(role, path, unit, doc) FCSL_MODEL_SCALAR(dryden_turbulence_t, FCSL_ROLE_##role, path, unit, doc)
#define VECTOR(role, path, unit, doc) FCSL_MODEL_VECTOR(dryden_turbulence_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    SCALAR(INPUT, inputs.height, "m", "above ground"),
    SCALAR(INPUT, inputs.airspeed, "m/s", ""),
    SCALAR(PARAMETER, parameters.wind_speed_20ft, "m/s", "wind at 6.1 m above ground, for heights to 305 m"),
    SCALAR(PARAMETER, parameters.high_intensity, "m/s", "deviation of each component, for heights from 610 m"),
    SCALAR(PARAMETER, parameters.wingspan, "m", ""),
    VECTOR(OUTPUT, outputs.gust_body, "m/s", "velocity of the air in the steady wind"),
    VECTOR(OUTPUT, outputs.gust_rate_body, "rad/s", "rotation of the air"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "dryden_turbulence",
    .doc = "continuous turbulence with the Dryden spectra of MIL-F-8785C",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(dryden_turbulence_t),
    .align = _Alignof(dryden_turbulence_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
