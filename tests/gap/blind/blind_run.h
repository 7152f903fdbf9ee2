/* One recorded run of a blind plant: under the project's own controller, with duties of its own, or with those of another
 * run over again. */
#ifndef TRIBEND_BLIND_RUN_H
#define TRIBEND_BLIND_RUN_H

#include "blind_effect.h"
#include "blind_excitation.h"
#include "control/controller.h"

enum blind_drive { BLIND_DRIVE_CONTROLLER, BLIND_DRIVE_DUTIES, BLIND_DRIVE_AGAIN };

struct blind_rig {
    uint64_t seed;     /* of noise and of what effects draw while they run */
    double seconds;
    struct blind_nominal nominal;
    enum blind_drive drive;
    int64_t tip_period_us;
    int64_t tip_phase_us;
    bool supply_read;      /* the rig has a sensor at the supply */
    double warming_k[3];   /* the rubber's temperature: start, rise, time constant (s) */
    double target_shift_pa[3]; /* added to targets above zero: what an operator does whose sensor is off */
};

struct blind_step {
    double reading_pa[3]; /* with noise */
    double clean_pa[3];   /* without, within the sensor's range */
    double target_pa[3];
    double supply_pa;
    double temperature_k;
    enum supervisor_state state;
};

struct blind_tip {
    size_t step; /* of arrival */
    double position_m[3];
    double quaternion[4];
    struct blind_pose clean;
};

struct blind_record {
    size_t steps;
    struct blind_step *step;
    double (*duty)[3]; /* of each PWM period */
    struct blind_tip *tip;
    size_t tips;
    struct blind_measure measure;
    double bend_most_rad;
    double load_most_pa;
    bool faulted;
};

/* `again` only where the rig drives duties over again. False: out of memory. */
bool blind_run(const struct blind_rig *rig, struct blind_field *field, struct blind_effect *const *effect, size_t effects,
               const struct blind_excitation *excitation, const struct blind_record *again, struct blind_record *record);
void blind_record_close(struct blind_record *record);

#endif
