/* Trigonometry of our own in float32: built of additions, multiplications, divisions and square roots only, which IEEE
 * 754 rounds correctly, so that host and board give the same bits (a libm's sinf does not promise that). What takes less
 * than the call of a function is here for the compiler to see: a control step uses it a hundred times. */
#ifndef TRIBEND_REAL_MATH_H
#define TRIBEND_REAL_MATH_H

#include <stdbool.h>

#define REAL_PI 3.14159265f

static inline bool real_is_finite(float x) {
    return x - x == 0.0f;
}

static inline float real_abs(float x) {
    return x < 0.0f ? -x : x;
}

static inline float real_min(float a, float b) {
    return a < b ? a : b;
}

static inline float real_max(float a, float b) {
    return a > b ? a : b;
}

/* x kept within [low, high]; NaN goes to low. */
static inline float real_clamp(float x, float low, float high) {
    return x > low ? (x < high ? x : high) : low;
}

/* Zero for negative numbers and NaN. */
static inline float real_sqrt(float x) {
    return x > 0.0f ? __builtin_sqrtf(x) : 0.0f;
}

static inline float real_hypot(float x, float y) {
    return real_sqrt(x * x + y * y);
}

/* Errors under 2e-7 for |x| up to 100 rad; zero and one for what is not finite or over 1e4 rad. */
float real_sin(float x);
float real_cos(float x);
/* (-pi, pi], error under 4e-7 rad; zero for (0, 0). */
float real_atan2(float y, float x);
/* The same angle within (-pi, pi]. */
float real_wrap_angle(float angle_rad);

#endif
