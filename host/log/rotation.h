/* Rotations as unit quaternions (w, x, y, z) in double, for recorded poses. `rotation_apply(q, v)` turns v: q
 * takes a vector from the turned frame into the outer one. Outputs may be the inputs. */
#ifndef TRIBEND_ROTATION_H
#define TRIBEND_ROTATION_H

#include <stdbool.h>
#include <stddef.h>

void rotation_multiply(const double a[4], const double b[4], double product[4]);
void rotation_inverse(const double rotation[4], double inverse[4]);
void rotation_apply(const double rotation[4], const double vector[3], double turned[3]);
/* To length one; returns the length that it had. */
double rotation_normalise(double rotation[4]);
/* Of the frame whose axes stand in the rows of an orthonormal, right-handed `matrix`. */
void rotation_from_rows(const double matrix[3][3], double rotation[4]);
/* The rotation that lays the points `from` onto the points `to` best, in the least-squares sense, both about
 * their own centre (Horn 1987, Closed-form solution of absolute orientation using unit quaternions, section
 * 4). */
void rotation_between(const double (*from)[3], const double (*to)[3], size_t points, double rotation[4]);

#endif
