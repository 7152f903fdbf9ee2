/* How far two runs of the same duties lie apart, in noise floors. */
#ifndef TRIBEND_BLIND_GAP_H
#define TRIBEND_BLIND_GAP_H

#include "blind_run.h"

struct blind_gap {
    double pressure_square;
    double pressures;
    double position_square;
    double angle_square;
    double tips;
};

void blind_gap_add(struct blind_gap *gap, const struct blind_record *with, const struct blind_record *without);
/* The greatest over pressure, tip position and tip angle of the rms difference over the channel's noise. `orientation`:
 * angles are logged. */
double blind_gap_ratio(const struct blind_gap *gap, bool orientation);

#endif
