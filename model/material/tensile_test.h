/* A tensile test: engineering strain and nominal stress. */
#ifndef TRIBEND_TENSILE_TEST_H
#define TRIBEND_TENSILE_TEST_H

#include <stdbool.h>
#include <stddef.h>

#include "material/material_stability.h"

#define TENSILE_POINTS_LEAST 10

struct tensile_test {
    size_t count;
    double *strain;    /* engineering */
    double *stress_pa; /* nominal */
    enum deformation_mode mode; /* uniaxial unless the caller says otherwise */
};

/* Semicolon-separated text in latin-1: header lines, then time s; true strain; true stress MPa; engineering strain;
 * engineering stress MPa (as in the Soft Robotics Materials Database). False: `error` names file and line. */
bool tensile_test_read(const char *path, struct tensile_test *test, char *error, size_t error_bytes);
void tensile_test_free(struct tensile_test *test);

#endif
