/* cmocka and the headers that it asks for, and comparisons of reals that name the numbers. */
#ifndef TRIBEND_TEST_H
#define TRIBEND_TEST_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#define assert_close(actual, expected, tolerance)                                                                   \
    do {                                                                                                            \
        const double actual_ = (actual), expected_ = (expected), tolerance_ = (tolerance);                           \
        if (!(fabs(actual_ - expected_) <= tolerance_)) {                                                           \
            fail_msg("%s = %.9g, expected %.9g +- %.3g", #actual, actual_, expected_, tolerance_);                   \
        }                                                                                                           \
    } while (0)
#define assert_relative(actual, expected, share)                                                                    \
    assert_close(actual, expected, (share) * fabs((double)(expected)))
#define assert_under(actual, bound)                                                                                 \
    do {                                                                                                            \
        const double actual_ = (actual), bound_ = (bound);                                                           \
        if (!(actual_ < bound_)) {                                                                                  \
            fail_msg("%s = %.9g, must be under %.9g", #actual, actual_, bound_);                                     \
        }                                                                                                           \
    } while (0)

#endif
