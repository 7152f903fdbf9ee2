#include "blind_next.h"

#include <math.h>
#include <string.h>

#define CALMER 0.88 /* of the excitation, when a run went too far */
#define CALMINGS 10

static void draw_rig(const struct blind_case *blind, const char *what, double seconds, struct blind_rig *rig) {
    struct blind_random random;
    blind_random_open(&random, blind->rig[0].seed, what, 0);
    *rig = blind->rig[0];
    rig->seed = ((uint64_t)blind_random_u32(&random) << 32) | blind_random_u32(&random);
    rig->seconds = seconds;
    rig->drive = BLIND_DRIVE_CONTROLLER;
    memset(rig->target_shift_pa, 0, sizeof rig->target_shift_pa); /* a plan is followed to the letter */
}

static bool run(struct blind_case *blind, struct blind_field *field, const struct blind_rig *rig,
                const struct blind_excitation *excitation, struct blind_record *record) {
    struct blind_effect *pointer[BLIND_EFFECTS_MAX];
    for (size_t i = 0; i < blind->effects; i++) {
        pointer[i] = &blind->effect[i];
    }
    return blind_run(rig, field, pointer, blind->effects, excitation, NULL, record);
}

bool blind_next_planned(struct blind_case *blind, struct blind_field *field, const struct blind_excitation *plan, double seconds,
                        struct blind_record *record) {
    struct blind_rig rig;
    draw_rig(blind, "planned", seconds, &rig);
    return run(blind, field, &rig, plan, record);
}

bool blind_next_random(struct blind_case *blind, struct blind_field *field, double seconds, struct blind_record *record) {
    const double working_pa = (double)field->table->module.working_pressure_pa;
    double most_pa = fmin(blind_pressure_most_pa(field) * blind->rig[0].nominal.stiffness_scale, working_pa);
    struct blind_rig rig;
    bool ran = true, fits = false;
    draw_rig(blind, "random", seconds, &rig);
    for (int i = 0; i < CALMINGS && ran && !fits; i++, most_pa *= CALMER) {
        struct blind_excitation excitation;
        struct blind_random random;
        blind_record_close(record);
        blind_random_open(&random, rig.seed, "excitation", 0);
        ran = blind_excitation_open(&excitation, BLIND_EXCITE_ALL, &random, field, rig.nominal.stiffness_scale, most_pa, seconds);
        if (ran) {
            ran = run(blind, field, &rig, &excitation, record);
            blind_excitation_close(&excitation);
        }
        fits = ran && blind_record_fits(record, field->table);
    }
    return ran;
}
