#include "blind_gap.h"

#include <math.h>

#define PRESSURE_FLOOR_PA 150.0
#define POSITION_FLOOR_M 4e-5
#define ANGLE_FLOOR_RAD (0.014 * M_PI / 180.0)

static double angle_square(const double a[4], const double b[4]) {
    const double back[4] = {a[0], -a[1], -a[2], -a[3]};
    double apart[4];
    blind_quaternion_product(back, b, apart);
    const double sine = sqrt(apart[1] * apart[1] + apart[2] * apart[2] + apart[3] * apart[3]);
    const double angle = 2.0 * atan2(sine, fabs(apart[0]));
    return angle * angle / 3.0; /* of one component */
}

void blind_gap_add(struct blind_gap *gap, const struct blind_record *with, const struct blind_record *without) {
    for (size_t i = 0; i <= with->steps; i++) {
        for (size_t c = 0; c < 3; c++) {
            const double apart = with->step[i].clean_pa[c] - without->step[i].clean_pa[c];
            gap->pressure_square += apart * apart;
            gap->pressures += 1.0;
        }
    }
    for (size_t i = 0; i < with->tips && i < without->tips; i++) {
        const struct blind_pose *a = &with->tip[i].clean, *b = &without->tip[i].clean;
        for (int d = 0; d < 3; d++) {
            gap->position_square += pow(a->position_m[d] - b->position_m[d], 2.0) / 3.0;
        }
        gap->angle_square += angle_square(a->quaternion, b->quaternion);
        gap->tips += 1.0;
    }
}

double blind_gap_ratio(const struct blind_gap *gap, bool orientation) {
    const double pressure = sqrt(gap->pressure_square / fmax(gap->pressures, 1.0)) / PRESSURE_FLOOR_PA;
    const double position = sqrt(gap->position_square / fmax(gap->tips, 1.0)) / POSITION_FLOOR_M;
    const double angle = sqrt(gap->angle_square / fmax(gap->tips, 1.0)) / ANGLE_FLOOR_RAD;
    return fmax(fmax(pressure, position), orientation ? angle : 0.0);
}
