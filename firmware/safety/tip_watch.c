#include "safety/tip_watch.h"

#include "control/real_math.h"
#include "safety/supervisor.h"

#define NORM_TOLERANCE 0.1f /* of a unit quaternion's square */
#define STRETCH_MOST 2.0f   /* of the chamber's length; the reference module's greatest is 1.8 */
#define AGE_MOST_US 100000  /* an older comparison says nothing of now */
#define LEAST_SLOPE_RADPPA 1e-4f
#define FLATTENS 1.6f /* beyond 90 degrees the slope falls: the true error is up to so much larger than by the slope here */
#define PUSHES_FROM_PA 3000.0f /* a stiff chamber at low pressure bends the module too little to be judged by it */
#define NEVER_US (-1000000000)

void tip_watch_default_parameters(struct tip_watch_parameters *parameters) {
    *parameters = (struct tip_watch_parameters){
        .frozen_rad = 0.052f, /* 3 deg */
        .frozen_us = 100000,
        .jump_rad = 0.2f, /* the module turns by 0.02 rad between samples at full flow */
        .reach_m = 0.02f,
        .excess_rad = 0.8f, /* a module that lies down sags by up to half of it */
        .over_rad = 0.2f,
        .excess_us = 100000,
        .shown_us = 200000,
    };
}

void tip_watch_init(struct tip_watch *watch) {
    *watch = (struct tip_watch){.saturated_us = NEVER_US,
                                .out_us = NEVER_US,
                                .erratic_us = NEVER_US,
                                .sample_us = NEVER_US,
                                .within_us = NEVER_US};
}

static bool same(const float *a, const float *b, uint32_t count) {
    bool equal = true;
    for (uint32_t i = 0; i < count; i++) {
        equal = equal && a[i] == b[i];
    }
    return equal;
}

static bool within_reach(const struct tip_watch_parameters *parameters,
                         const struct bend_table_module *module, const float position_m[3]) {
    if (module == NULL) {
        return true;
    }
    const float reach_m = module->cap_proximal_m + module->cap_distal_m +
                          STRETCH_MOST * module->chamber_length_m + parameters->reach_m;
    const float squared =
        position_m[0] * position_m[0] + position_m[1] * position_m[1] + position_m[2] * position_m[2];
    return squared <= reach_m * reach_m; /* false for what is no number */
}

/* Is it a rotation, and near enough to the one before? The cosine of half the angle between two unit
 * quaternions is the size of their product. */
static bool is_steady(const struct tip_watch *watch, const struct tip_watch_parameters *parameters,
                      const float quaternion[4]) {
    float norm = 0.0f, product = 0.0f;
    for (uint32_t i = 0; i < 4u; i++) {
        norm += quaternion[i] * quaternion[i];
        product += quaternion[i] * watch->quaternion[i];
    }
    if (!(real_abs(norm - 1.0f) < NORM_TOLERANCE)) {
        return false;
    }
    const float least = 1.0f - 0.125f * parameters->jump_rad * parameters->jump_rad;
    return !watch->any || real_abs(product) > least * norm;
}

static void remember(struct tip_watch *watch, const struct tip_watch_sample *sample) {
    watch->equal = watch->any && same(sample->position_m, watch->position_m, 3u) &&
                   same(sample->quaternion, watch->quaternion, 4u);
    for (uint32_t i = 0; i < 3u; i++) {
        watch->position_m[i] = sample->position_m[i];
    }
    for (uint32_t i = 0; i < 4u; i++) {
        watch->quaternion[i] = sample->quaternion[i];
    }
    watch->frozen = watch->frozen && watch->equal;
    watch->any = true;
}

bool tip_watch_take(struct tip_watch *watch, const struct tip_watch_parameters *parameters,
                    const struct bend_table_module *module, const struct tip_watch_sample *sample) {
    const bool steady = is_steady(watch, parameters, sample->quaternion);
    const bool saturated = (sample->status & TIP_WATCH_SATURATED) != 0u;
    const bool out = (sample->status & TIP_WATCH_OUT_OF_BOX) != 0u ||
                     !within_reach(parameters, module, sample->position_m);
    remember(watch, sample);
    watch->saturated_us = saturated ? sample->time_us : watch->saturated_us;
    watch->out_us = out ? sample->time_us : watch->out_us;
    watch->erratic_us = steady ? watch->erratic_us : sample->time_us;
    return sample->status == 0u && steady && !out && !watch->frozen;
}

static void follow_frozen(struct tip_watch *watch, const struct tip_watch_parameters *parameters,
                          const struct tip_watch_view *view, float correction_rad[2]) {
    if (!watch->equal) {
        watch->equal_us = view->time_us;
        for (uint32_t i = 0; i < 2u; i++) {
            watch->equal_rad[i] = view->gap_rad[i];
            watch->kept_rad[i] = correction_rad[i];
        }
    }
    const float moved_rad =
        real_hypot(view->gap_rad[0] - watch->equal_rad[0], view->gap_rad[1] - watch->equal_rad[1]);
    if (view->time_us - watch->equal_us >= parameters->frozen_us && moved_rad > parameters->frozen_rad) {
        watch->frozen = true;
        correction_rad[0] = watch->kept_rad[0];
        correction_rad[1] = watch->kept_rad[1];
    }
}

/* The error of this chamber's reading that would push the tip to where it is puts the chamber over its limit. */
static bool is_over(const struct tip_watch_parameters *parameters, const struct tip_watch_view *view, uint32_t c) {
    const float slope_radppa = real_max(view->slope_radppa[c], LEAST_SLOPE_RADPPA);
    const float pushed_rad =
        (view->gap_rad[0] * view->push_radppa[c][0] + view->gap_rad[1] * view->push_radppa[c][1]) / slope_radppa;
    return view->pressure_pa[c] > PUSHES_FROM_PA && pushed_rad > parameters->over_rad &&
           view->pressure_pa[c] + FLATTENS * pushed_rad / slope_radppa > view->working_pa;
}

static bool exceeds(const struct tip_watch_parameters *parameters, const struct tip_watch_view *view) {
    const float *measured = view->measured_rad, *gap = view->gap_rad;
    const float excess_rad =
        real_hypot(measured[0], measured[1]) - real_hypot(measured[0] - gap[0], measured[1] - gap[1]);
    return excess_rad > parameters->excess_rad || is_over(parameters, view, 0u) || is_over(parameters, view, 1u) ||
           is_over(parameters, view, 2u);
}

void tip_watch_follow(struct tip_watch *watch, const struct tip_watch_parameters *parameters,
                      const struct tip_watch_view *view, float correction_rad[2]) {
    follow_frozen(watch, parameters, view, correction_rad);
    if (!exceeds(parameters, view) || view->time_us - watch->sample_us > AGE_MOST_US) {
        watch->within_us = view->time_us;
    }
    watch->sample_us = view->time_us;
}

bool tip_watch_disagrees(const struct tip_watch *watch, const struct tip_watch_parameters *parameters,
                         int64_t time_us) {
    return time_us - watch->sample_us <= AGE_MOST_US &&
           watch->sample_us - watch->within_us >= parameters->excess_us && !watch->frozen;
}

uint32_t tip_watch_warnings(const struct tip_watch *watch, const struct tip_watch_parameters *parameters,
                            int64_t time_us) {
    const int64_t shown_us = parameters->shown_us;
    return (watch->frozen ? 1u << WARNING_TIP_FROZEN : 0u) |
           (time_us - watch->saturated_us < shown_us ? 1u << WARNING_TIP_SATURATED : 0u) |
           (time_us - watch->out_us < shown_us ? 1u << WARNING_TIP_OUT_OF_BOX : 0u) |
           (time_us - watch->erratic_us < shown_us ? 1u << WARNING_TIP_ERRATIC : 0u);
}
