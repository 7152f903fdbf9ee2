/* Where inside a stage a gap lies: on which variables the residuals of a diagnosis depend (locate.h).
 *
 * Residuals: r1 of each chamber; r2 of the tip, position and orientation, in the frame that moves with the bend. Variables: of
 * each chamber its pressure, rate and direction of loading; time since the start, cycles done, bend and its direction,
 * temperature where it was logged; and which chamber it is. All variables are the recalibrated model's, not the sensors': a
 * sensor's noise would stand on both sides. */
#ifndef TRIBEND_GAP_DEPENDENCE_H
#define TRIBEND_GAP_DEPENDENCE_H

#include <stdio.h>

#include "gap/locate.h"
#include "gap/search.h"

#define DEPENDENCE_MAX (2 * LOCATE_FOUND_MAX)

struct dependence {
    bool of_best;         /* what the best model leaves; else what recalibration leaves */
    const char *residual; /* r1_pressure, r2_position, r2_angle */
    const char *channel;
    const char *variable;
    size_t chamber;       /* of the variable; 0: none */
    const char *unit;     /* of `from` and `to` */
    double share;         /* of the residual's variance; for the chamber, how uneven the squares are (1: all in one) */
    double p;
    double q;
    double from;          /* where the variable is when the residual is farthest off */
    double to;
    double off;           /* the residual's mean there, or its rms where the variable is the chamber; in `off_unit` */
    const char *off_unit;
};

struct dependences {
    size_t count;
    size_t tested;
    struct dependence list[DEPENDENCE_MAX]; /* of recalibration first, then of the best model; strongest first */
};

/* `with_best`: what the best model leaves as well. False: out of memory. */
bool dependence_find(struct dependences *dependences, const struct search *search, bool with_best);
/* One line: each residual's strongest, at most three. `of_best` chooses the model. Returns how many were written; none, no line. */
size_t dependence_text(const struct dependences *dependences, bool of_best, FILE *out);
/* The section's table for the HTML report. */
void dependence_html(const struct dependences *dependences, FILE *out);

#endif
