#include "control/real_math.h"

#include <stddef.h>
#include <stdint.h>

#define ANGLE_MAX 1e4f

/* sin and cos on [-pi/4, pi/4] by their Taylor series, which end at x^9 and x^10 with remainders under 2e-9. */
static float short_sin(float x) {
    const float s = x * x;
    return x * (1.0f + s * (-1.66666667e-1f + s * (8.33333333e-3f + s * (-1.98412698e-4f + s * 2.75573192e-6f))));
}

static float short_cos(float x) {
    const float s = x * x;
    return 1.0f + s * (-0.5f + s * (4.16666667e-2f + s * (-1.38888889e-3f + s * (2.48015873e-5f - s * 2.75573192e-7f))));
}

/* Quadrant of x and the rest in [-pi/4, pi/4]: pi/2 in three parts (Cody and Waite 1980). */
static int32_t reduce(float x, float *rest) {
    const float turns = x * 0.636619772f;
    const int32_t quadrant = (int32_t)(turns < 0.0f ? turns - 0.5f : turns + 0.5f);
    const float q = (float)quadrant;
    *rest = ((x - q * 1.5703125f) - q * 4.83751297e-4f) - q * 7.54978942e-8f;
    return quadrant;
}

static float sin_of_quadrant(int32_t quadrant, float rest) {
    const uint32_t turn = (uint32_t)quadrant & 3u;
    const float value = (turn & 1u) != 0u ? short_cos(rest) : short_sin(rest);
    return (turn & 2u) != 0u ? -value : value;
}

float real_sin(float x) {
    float rest = 0.0f;
    if (!(real_abs(x) <= ANGLE_MAX)) {
        return 0.0f;
    }
    const int32_t quadrant = reduce(x, &rest);
    return sin_of_quadrant(quadrant, rest);
}

float real_cos(float x) {
    float rest = 0.0f;
    if (!(real_abs(x) <= ANGLE_MAX)) {
        return 1.0f;
    }
    const int32_t quadrant = reduce(x, &rest);
    return sin_of_quadrant(quadrant + 1, rest);
}

/* atan on [0, 1]: turned by pi/8 multiples so that the series' argument stays below tan(pi/8). */
static float short_atan(float x) {
    float offset = 0.0f;
    if (x > 0.414213562f) {
        offset = 0.785398163f;
        x = (x - 1.0f) / (x + 1.0f);
    }
    const float s = x * x;
    const float tail = 7.69230769e-2f + s * (-6.66666667e-2f + s * 5.88235294e-2f);
    const float series =
        -3.33333333e-1f + s * (0.2f + s * (-1.42857143e-1f + s * (1.11111111e-1f + s * (-9.09090909e-2f + s * tail))));
    return offset + (x + x * s * series);
}

float real_atan2(float y, float x) {
    const float ax = real_abs(x), ay = real_abs(y);
    if (!(ax + ay > 0.0f) || !real_is_finite(ax + ay)) {
        return 0.0f;
    }
    float angle = ay <= ax ? short_atan(ay / ax) : 1.57079633f - short_atan(ax / ay);
    if (x < 0.0f) {
        angle = REAL_PI - angle;
    }
    return y < 0.0f ? -angle : angle;
}

float real_wrap_angle(float angle_rad) {
    if (!(real_abs(angle_rad) <= ANGLE_MAX)) {
        return 0.0f;
    }
    const float turns = angle_rad * 0.159154943f;
    const float whole = (float)(int32_t)(turns < 0.0f ? turns - 0.5f : turns + 0.5f);
    const float angle = (angle_rad - whole * 6.28125f) - whole * 1.93530718e-3f;
    return angle > -REAL_PI ? angle : REAL_PI;
}
