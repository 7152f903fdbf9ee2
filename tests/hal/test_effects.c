/* The catalogue of effects: each one against its closed form or a limit, and all of them against what an
 * effect promises. */
#include "support/test.h"

#include <stdlib.h>

#include "program/table_file.h"
#include "sim/plant.h"
#include "sim/random.h"
#include "support/synthetic_table.h"

#define GRAVITY_MPS2 9.80665
#define DEG (M_PI / 180.0)

static struct table_file reference; /* the reference table, between the group's set-up and tear-down */

static int open_reference(void **state) {
    (void)state;
    return table_file_open(&reference, "tables/paper-semicircle.tbt", NULL);
}

static int close_reference(void **state) {
    (void)state;
    table_file_close(&reference);
    return 0;
}

static struct effect make(const char *text) {
    struct effect effect;
    char error[512];
    if (!effect_parse(text, &effect, error, sizeof error)) {
        fail_msg("%s", error);
    }
    return effect;
}

/* --- the catalogue --- */

static const struct {
    const char *name;
    enum effect_stage stage;
} catalogue[] = {{"chamber_asymmetry", EFFECT_STAGE_BODY},
                 {"chamber_leak", EFFECT_STAGE_VALVE},
                 {"contact", EFFECT_STAGE_BODY},
                 {"creep", EFFECT_STAGE_BODY},
                 {"cross_coupling", EFFECT_STAGE_VALVE},
                 {"end_restraint", EFFECT_STAGE_BODY},
                 {"gravity", EFFECT_STAGE_BODY},
                 {"hysteresis", EFFECT_STAGE_BODY},
                 {"line_resistance", EFFECT_STAGE_VALVE},
                 {"line_volume", EFFECT_STAGE_VALVE},
                 {"mullins", EFFECT_STAGE_BODY},
                 {"pressure_gain", EFFECT_STAGE_PRESSURE_SENSOR},
                 {"pressure_lag", EFFECT_STAGE_PRESSURE_SENSOR},
                 {"pressure_offset", EFFECT_STAGE_PRESSURE_SENSOR},
                 {"supply_droop", EFFECT_STAGE_SUPPLY},
                 {"temperature_stiffness", EFFECT_STAGE_BODY},
                 {"tip_distortion", EFFECT_STAGE_TIP_SENSOR},
                 {"tip_freeze", EFFECT_STAGE_TIP_SENSOR},
                 {"tip_latency", EFFECT_STAGE_TIP_SENSOR},
                 {"tip_lever_arm", EFFECT_STAGE_TIP_SENSOR},
                 {"tip_misalignment", EFFECT_STAGE_TIP_SENSOR},
                 {"tip_offset", EFFECT_STAGE_TIP_SENSOR},
                 {"tip_payload", EFFECT_STAGE_BODY},
                 {"valve_dead_band", EFFECT_STAGE_VALVE},
                 {"valve_dead_time", EFFECT_STAGE_VALVE},
                 {"valve_sluggish", EFFECT_STAGE_VALVE}};

static void the_catalogue_is_whole(void **state) {
    (void)state;
    const size_t count = sizeof catalogue / sizeof catalogue[0];
    for (size_t i = 0; i < count; i++) {
        const struct effect_kind *kind = effect_kind_find(catalogue[i].name);
        assert_non_null(kind);
        assert_int_equal(kind->stage, catalogue[i].stage);
    }
    assert_int_equal(effect_kind_count(), count);
}

static void every_effect_says_what_it_is(void **state) {
    (void)state;
    for (size_t i = 0; i < effect_kind_count(); i++) {
        const struct effect_kind *kind = effect_kind_at(i);
        size_t hooks = 0, decisive = 0;
        assert_true(strlen(kind->what) > 20 && strlen(kind->signature) > 60);
        assert_in_range(kind->parameter_count, 1, EFFECT_PARAMETERS_MAX);
        for (size_t p = 0; p < kind->parameter_count; p++) {
            const struct effect_parameter *parameter = &kind->parameter[p];
            assert_true(strlen(parameter->name) > 0 && strlen(parameter->unit) > 0);
            assert_true(parameter->least < parameter->most);
            assert_true(parameter->least <= parameter->typical && parameter->typical <= parameter->most);
            assert_true(isnan(parameter->none) ||
                        (parameter->least <= parameter->none && parameter->none <= parameter->most));
            decisive += !isnan(parameter->none) && parameter->none != parameter->typical;
        }
        for (int hook = EFFECT_HOOK_COMMAND; hook <= EFFECT_HOOK_POSE; hook++) {
            hooks += effect_has(kind, (enum effect_hook_kind)hook);
        }
        assert_true(hooks > 0 && decisive > 0);
        assert_true(!kind->by_chance || (kind->parameter[0].least >= 0.0 && kind->parameter[0].most <= 1.0));
    }
}

/* --- all of them in one run of the plant --- */

enum { RUN_MS = 8000, RUN_TIPS = RUN_MS / 10, READINGS = 3 * RUN_MS, POSES = 7 * RUN_TIPS };

struct record {
    double reading_pa[READINGS];
    double pose[POSES];
};

/* Three chambers between nothing and near the working pressure, one after the other and each at a pace of its
 * own. */
static double duty_at(size_t chamber, double time_s) {
    static const double pace_hz[3] = {0.25, 0.27, 0.29};
    const double turn = pace_hz[chamber] * time_s - 0.25 - (double)chamber / 3.0;
    return 0.12 + 0.6 * pow(cos(M_PI * turn), 4.0);
}

static void run_plant(const struct effect *effect, struct record *record) {
    struct plant_parameters parameters;
    struct plant plant;
    struct random_stream random;
    plant_default_parameters(&parameters);
    plant_init(&plant, &reference.table, &parameters);
    random_seed(&random, 1, 5);
    assert_true(effect == NULL || plant_add_effect(&plant, effect));
    for (int ms = 0; ms < RUN_MS; ms++) {
        const double duty[3] = {duty_at(0, 1e-3 * ms), duty_at(1, 1e-3 * ms), duty_at(2, 1e-3 * ms)};
        if (ms % 10 == 0) {
            plant_start_period(&plant, 1000 * ms, duty);
        }
        plant_step(&plant, true, 1000 * ms, 1000 * (ms + 1));
        memcpy(record->reading_pa + 3 * ms, plant.reading_pa, sizeof plant.reading_pa);
        if (ms % 10 == 9) {
            plant_sample_tip(&plant, NULL, 1e-3 * (ms + 1), 0.01, random_uniform(&random));
            memcpy(record->pose + (size_t)(7 * (ms / 10)), &plant.pose, sizeof plant.pose);
        }
    }
}

static void at_none_nothing_changes(void **state) {
    (void)state;
    static struct record nominal, changed;
    run_plant(NULL, &nominal);
    for (size_t i = 0; i < effect_kind_count(); i++) {
        const struct effect_kind *kind = effect_kind_at(i);
        struct effect effect;
        effect_init(&effect, kind);
        for (size_t p = 0; p < kind->parameter_count; p++) {
            effect.parameter[p] =
                isnan(kind->parameter[p].none) ? kind->parameter[p].typical : kind->parameter[p].none;
        }
        run_plant(&effect, &changed);
        for (size_t k = 0; k < READINGS; k++) {
            if (nominal.reading_pa[k] != changed.reading_pa[k]) {
                fail_msg("%s changes reading %zu by %g Pa", kind->name, k,
                         changed.reading_pa[k] - nominal.reading_pa[k]);
            }
        }
        for (size_t k = 0; k < POSES; k++) {
            if (nominal.pose[k] != changed.pose[k]) {
                fail_msg("%s changes pose %zu by %g", kind->name, k, changed.pose[k] - nominal.pose[k]);
            }
        }
    }
}

/* Root mean squares over the noise floors of a reading, 150 Pa, and of a pose, 0.02 mm and 0.012 deg. */
struct size {
    double reading;
    double position;
    double angle;
};

static struct size size_of(const struct record *a, const struct record *b, double scale) {
    struct size size = {0.0, 0.0, 0.0};
    for (size_t k = 0; k < READINGS; k++) {
        size.reading += pow(scale * (a->reading_pa[k] - b->reading_pa[k]) / 150.0, 2.0) / READINGS;
    }
    for (size_t k = 0; k < POSES; k++) {
        const double difference = scale * (a->pose[k] - b->pose[k]);
        if (k % 7 < 3) {
            size.position += pow(difference / 2e-5, 2.0) / (3.0 * RUN_TIPS);
        } else {
            size.angle += pow(2.0 * difference / (0.012 * DEG), 2.0) / (3.0 * RUN_TIPS);
        }
    }
    return (struct size){sqrt(size.reading), sqrt(size.position), sqrt(size.angle)};
}

static double greatest(const struct size *size) {
    return fmax(size->reading, fmax(size->position, size->angle));
}

/* Only what lies after an effect may show it. */
static void typical_values_show_where_they_should(void **state) {
    (void)state;
    static struct record nominal, changed, again;
    run_plant(NULL, &nominal);
    for (size_t i = 0; i < effect_kind_count(); i++) {
        const struct effect_kind *kind = effect_kind_at(i);
        struct effect effect;
        effect_init(&effect, kind);
        run_plant(&effect, &changed);
        run_plant(&effect, &again);
        assert_memory_equal(&changed, &again, sizeof changed);
        const struct size size = size_of(&changed, &nominal, 1.0);
        assert_true(kind->stage < EFFECT_STAGE_BODY ? size.reading > 0.1 : size.reading == 0.0);
        assert_true(kind->stage == EFFECT_STAGE_PRESSURE_SENSOR ? size.position == 0.0 && size.angle == 0.0
                                                                : fmax(size.position, size.angle) > 1.0);
    }
}

static void before_its_onset_an_effect_does_nothing(void **state) {
    (void)state;
    static struct record nominal, changed;
    const size_t onset_ms = 3000;
    run_plant(NULL, &nominal);
    for (size_t i = 0; i < effect_kind_count(); i++) {
        struct effect effect;
        effect_init(&effect, effect_kind_at(i));
        effect.onset_s = 1e-3 * (double)onset_ms + 1e-9;
        run_plant(&effect, &changed);
        assert_memory_equal(&nominal.reading_pa, &changed.reading_pa, 3 * onset_ms * sizeof(double));
        assert_memory_equal(&nominal.pose, &changed.pose, 7 * onset_ms / 10 * sizeof(double));
        const struct size size = size_of(&changed, &nominal, 1.0);
        assert_true(greatest(&size) > 0.1);
    }
}

/* What it remembers before, it does not show before; from then on it acts as if it always had. */
static void before_its_onset_a_latent_effect_only_remembers(void **state) {
    (void)state;
    static struct record nominal, late, always;
    const size_t onset_ms = 3000;
    size_t kinds = 0;
    run_plant(NULL, &nominal);
    for (size_t i = 0; i < effect_kind_count(); i++) {
        struct effect effect;
        effect_init(&effect, effect_kind_at(i));
        if (!effect.kind->remembers) {
            continue;
        }
        kinds++;
        run_plant(&effect, &always);
        effect_init(&effect, effect_kind_at(i));
        effect.onset_s = 1e-3 * (double)onset_ms + 1e-9;
        effect.latent = true;
        run_plant(&effect, &late);
        const size_t before = 7 * onset_ms / 10, all = sizeof late.pose / sizeof(double);
        assert_memory_equal(&nominal.pose, &late.pose, before * sizeof(double));
        assert_memory_equal((const double *)&always.pose + before + 7, (const double *)&late.pose + before + 7,
                            (all - before - 7) * sizeof(double));
    }
    assert_true(kinds >= 4);
}

/* All hooks once, the other chambers' signals untouched. */
static void an_effect_on_one_chamber_stays_there(void **state) {
    (void)state;
    size_t kinds = 0;
    for (size_t i = 0; i < effect_kind_count(); i++) {
        struct effect effect;
        effect_init(&effect, effect_kind_at(i));
        if (effect.kind->scope == EFFECT_GLOBAL) {
            continue;
        }
        kinds++;
        for (size_t chamber = 1; chamber <= 3; chamber++) {
            const double pressure_pa[3] = {5e3, 4e3, 3e3}, opening[3] = {0.3, 0.2, 0.1};
            double duty[3] = {opening[0], opening[1], opening[2]}, late_s[3] = {0.0};
            double reading_pa[3] = {5e3, 4e3, 3e3}, load_pa[3] = {5e3, 4e3, 3e3};
            struct chamber_influence influence = {.conductance_scale = {1.0, 1.0, 1.0}, .supply_pa = 4e4};
            struct effect_signals signals = {.step_s = 0.001,
                                             .table = &reference.table,
                                             .stiffness_scale = 1.0,
                                             .pressure_pa = pressure_pa,
                                             .duty = duty,
                                             .late_s = late_s,
                                             .influence = &influence,
                                             .reading_pa = reading_pa,
                                             .load_pa = load_pa};
            effect.chamber = chamber;
            effect.form = strcmp(effect.kind->name, "mullins") == 0 ? 1 : 0; /* form 0 shows on reloading only */
            memset(effect.state, 0, sizeof effect.state);
            for (int step = 0; step < 3; step++) {
                for (int hook = EFFECT_HOOK_COMMAND; hook <= EFFECT_HOOK_LOAD; hook++) {
                    effects_run(&effect, 1, (enum effect_hook_kind)hook, &signals);
                }
                signals.time_s += signals.step_s;
                reading_pa[chamber - 1] += 500.0;
            }
            for (size_t c = 0; c < 3; c++) {
                double coupled = 0.0;
                for (size_t d = 0; d < 3; d++) {
                    coupled += influence.coupling[c][d];
                }
                const bool untouched =
                    duty[c] == opening[c] && late_s[c] == 0.0 && coupled == 0.0 &&
                    load_pa[c] == pressure_pa[c] && influence.conductance_scale[c] == 1.0 &&
                    influence.leak_conductance[c] == 0.0 && influence.extra_volume_m3[c] == 0.0 &&
                    reading_pa[c] == pressure_pa[c] + (c + 1 == chamber ? 1500.0 : 0.0);
                const bool spared = strcmp(effect.kind->name, "valve_dead_band") == 0 && opening[c] > 0.25;
                if (untouched != (c + 1 != chamber || spared)) {
                    fail_msg("%s on chamber %zu: chamber %zu is %schanged", effect.kind->name, chamber, c + 1,
                             untouched ? "not " : "");
                }
            }
        }
    }
    assert_int_equal(kinds, 12);
}

/* The steps by which a fit varies a parameter; inside its bounds. */
static struct record *vary(struct effect *effect, size_t parameter, double by, struct record *room) {
    const double before = effect->parameter[parameter];
    effect->parameter[parameter] += by;
    run_plant(effect, room);
    effect->parameter[parameter] = before;
    return room;
}

/* Differences over two lengths of step give the same derivative: what a fit by finite differences needs. */
static void effects_are_smooth_in_their_parameters(void **state) {
    (void)state;
    static struct record wide[2], narrow[2];
    for (size_t i = 0; i < effect_kind_count(); i++) {
        const struct effect_kind *kind = effect_kind_at(i);
        /* pulses are a hundred a second and whole: a threshold for them is as smooth as their number allows
         */
        const double tolerance = strcmp(kind->name, "valve_dead_band") == 0 ? 0.3 : 0.06;
        struct effect effect;
        effect_init(&effect, kind);
        for (size_t p = 0; p < kind->parameter_count && !kind->by_chance; p++) {
            const struct effect_parameter *parameter = &kind->parameter[p];
            const double away = isnan(parameter->none) ? 0.0 : fabs(parameter->typical - parameter->none);
            const double typical = effect.parameter[p], range = parameter->most - parameter->least;
            const double step = (away > 0.0       ? away
                                 : typical != 0.0 ? 0.5 * fabs(typical)
                                                  : 0.25 * range) /
                                30.0;
            effect.parameter[p] = fmin(fmax(typical, parameter->least + step), parameter->most - step);
            (void)vary(&effect, p, step, &wide[1]);
            (void)vary(&effect, p, -step, &wide[0]);
            (void)vary(&effect, p, 0.5 * step, &narrow[1]);
            (void)vary(&effect, p, -0.5 * step, &narrow[0]);
            effect.parameter[p] = typical;
            for (size_t k = 0; k < READINGS; k++) {
                wide[1].reading_pa[k] -= 2.0 * narrow[1].reading_pa[k] - narrow[0].reading_pa[k];
                wide[0].reading_pa[k] -= narrow[0].reading_pa[k];
            }
            for (size_t k = 0; k < POSES; k++) {
                wide[1].pose[k] -= 2.0 * narrow[1].pose[k] - narrow[0].pose[k];
                wide[0].pose[k] -= narrow[0].pose[k];
            }
            const struct size derivative = size_of(&narrow[1], &narrow[0], 1.0),
                              change = size_of(&wide[1], &wide[0], 0.5);
            const double off = greatest(&change) / fmax(greatest(&derivative), 1e-12);
            if (!(greatest(&derivative) < 1e-9) && !(off < tolerance)) {
                fail_msg("%s: derivative by %s differs by %g between steps", kind->name, parameter->name,
                         off);
            }
        }
    }
}

/* --- supply and valves --- */

/* A plant with rigid chambers of 55 ml, for times that scale. */
static double rigid(enum bend_table_channel channel, const double pressure_pa[3]) {
    (void)pressure_pa;
    return channel >= BEND_TABLE_VOLUME_1 && channel <= BEND_TABLE_VOLUME_3 ? 1e-3 : 1.0;
}

struct bench {
    struct synthetic_table synthetic;
    struct plant plant;
    int64_t time_us;
};

static void bench_open(struct bench *bench, const char *effect) {
    struct plant_parameters parameters;
    plant_default_parameters(&parameters);
    parameters.valve.open_delay_us = parameters.valve.close_delay_us = 0;
    synthetic_table_create(&bench->synthetic, 5, 10000.0, 1.0, rigid);
    plant_init(&bench->plant, &bench->synthetic.table, &parameters);
    if (effect != NULL) {
        const struct effect made = make(effect);
        assert_true(plant_add_effect(&bench->plant, &made));
    }
    bench->time_us = 0;
}

static void bench_run(struct bench *bench, int milliseconds, double duty1, double duty2, double duty3) {
    const double duty[3] = {duty1, duty2, duty3};
    for (int i = 0; i < milliseconds; i++, bench->time_us += 1000) {
        if (bench->time_us % 10000 == 0) {
            plant_start_period(&bench->plant, bench->time_us, duty);
        }
        plant_step(&bench->plant, true, bench->time_us, bench->time_us + 1000);
    }
}

static void bench_close(struct bench *bench) {
    synthetic_table_free(&bench->synthetic);
}

static void a_late_valve_gives_the_same_pressure_later(void **state) {
    (void)state;
    static double nominal[300][3], late[300][3];
    struct bench bench;
    for (int run = 0; run < 2; run++) {
        bench_open(&bench, run == 0 ? NULL : "valve_dead_time:delay=0.023");
        for (int ms = 0; ms < 300; ms++) {
            bench_run(&bench, 1, ms < 100 ? 0.7 : 0.2, ms < 60 ? 1.0 : 0.0, 0.4);
            memcpy((run == 0 ? nominal : late)[ms], bench.plant.pressure_pa, sizeof nominal[0]);
        }
        bench_close(&bench);
    }
    for (int ms = 0; ms < 277; ms++) {
        for (size_t c = 0; c < 3; c++) {
            assert_close(late[ms + 23][c], nominal[ms][c], 1e-6 * (1.0 + nominal[ms][c]));
        }
    }
    assert_true(nominal[60][1] > 1000.0);
}

static void a_dead_band_stops_small_duties_and_its_loss_shortens_all(void **state) {
    (void)state;
    static const struct {
        const char *effect;
        double duty;
        double expected;
    } cases[] = {{"valve_dead_band:least_duty=0.2", 0.194, 0.0},
                 {"valve_dead_band:least_duty=0.2", 0.2, 0.1},
                 {"valve_dead_band:least_duty=0.2", 0.206, 0.206},
                 {"valve_dead_band:least_duty=0.2", 1.0, 1.0},
                 {"valve_dead_band:least_duty=0", 0.001, 0.001},
                 {"valve_dead_band:least_duty=0,loss=1", 0.0, 0.0},
                 {"valve_dead_band:least_duty=0.002", 0.0039, 0.0039 * 0.99815625},
                 {"valve_dead_band:least_duty=0.2,loss=1", 0.6, 0.5},
                 {"valve_dead_band:least_duty=0.2,loss=0.5", 0.28, 0.2},
                 {"valve_dead_band:least_duty=0.2,loss=1", 1.0, 1.0},
                 {"valve_dead_band:least_duty=0.5,loss=1", 0.496, 0.0}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct effect effect = make(cases[i].effect);
        double duty[3] = {cases[i].duty, 0.0, 1.0};
        struct effect_signals signals = {.duty = duty};
        effects_run(&effect, 1, EFFECT_HOOK_COMMAND, &signals);
        assert_close(duty[0], cases[i].expected, 1e-12);
        assert_true(duty[1] == 0.0 && duty[2] == 1.0);
    }
}

/* A rigid chamber's pressure is a function of C t / V: scales of flow and volume are scales of time. */
static void flow_and_volume_scale_the_time_of_filling_and_venting(void **state) {
    (void)state;
    const double nominal_m3 = 0.055 * 1e-3 + 2e-6;
    const struct {
        const char *effect;
        double slower;
        bool others;
    } cases[] = {{"valve_sluggish:flow_scale=0.5,chamber=2", 2.0, false},
                 {"valve_sluggish:flow_scale=0.8,chamber=2", 1.25, false},
                 {"line_resistance:conductance_scale=0.5", 2.0, true},
                 {"line_resistance:conductance_scale=0.8,chamber=2", 1.25, false},
                 {"line_volume:volume=5.7e-6", (nominal_m3 + 5.7e-6) / nominal_m3, true},
                 {"line_volume:volume=5.7e-6,chamber=2", (nominal_m3 + 5.7e-6) / nominal_m3, false}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct bench nominal, slow;
        bench_open(&nominal, NULL);
        bench_open(&slow, cases[i].effect);
        const int fill_ms = 200, slow_ms = (int)lround(fill_ms * cases[i].slower);
        for (int phase = 0; phase < 2; phase++) {
            const double duty = phase == 0 ? 1.0 : 0.0;
            bench_run(&nominal, fill_ms, duty, duty, duty);
            bench_run(&slow, slow_ms, duty, duty, duty);
            assert_true(nominal.plant.pressure_pa[1] > 2000.0);
            assert_relative(slow.plant.pressure_pa[1], nominal.plant.pressure_pa[1], 0.01);
            for (size_t c = 0; c < 3; c += 2) {
                const double ratio = slow.plant.pressure_pa[c] / nominal.plant.pressure_pa[c];
                assert_true(cases[i].others ? fabs(ratio - 1.0) < 0.01 : fabs(ratio - 1.0) > 0.03);
            }
        }
        bench_close(&nominal);
        bench_close(&slow);
    }
}

/* Flow through the nominal valve, in units of the choked one at one pascal. */
static double valve_alone(const struct gas_parameters *gas, double up_pa, double down_pa) {
    return gas_mass_flow(gas, 1.0 / gas->reference_density_kgpm3, up_pa, down_pa);
}

/* A laminar line's drop is its flow times a constant, and in series with the valve both pass the same: whatever the pressures
 * and the direction, the constant that the passed share implies is one. */
static void a_laminar_line_has_one_resistance_at_all_pressures(void **state) {
    (void)state;
    struct plant_parameters parameters;
    plant_default_parameters(&parameters);
    const struct gas_parameters *gas = &parameters.gas;
    static const double chambers_pa[] = {300.0, 2000.0, 6000.0, 10000.0, 20000.0};
    for (int tenths = 2; tenths <= 9; tenths++) {
        struct effect effect = make("line_resistance:form=1");
        double least = INFINITY, most = 0.0;
        effect.parameter[0] = 0.1 * tenths;
        for (size_t i = 0; i < 2 * sizeof chambers_pa / sizeof chambers_pa[0]; i++) {
            const bool filling = i % 2 == 0;
            const double pressure_pa[3] = {chambers_pa[i / 2], chambers_pa[i / 2], chambers_pa[i / 2]};
            struct chamber_influence influence = {.conductance_scale = {1.0, 1.0, 1.0}, .supply_pa = 40000.0};
            struct effect_signals signals = {.pressure_pa = pressure_pa, .influence = &influence};
            effects_run(&effect, 1, EFFECT_HOOK_GAS, &signals);
            const double share = influence.conductance_scale[0] + (filling ? 0.0 : influence.vent_scale_change[0]);
            const double up_pa = gas->ambient_pa_abs + (filling ? 40000.0 : pressure_pa[0]);
            const double down_pa = gas->ambient_pa_abs + (filling ? pressure_pa[0] : 0.0);
            const double flow = share * valve_alone(gas, up_pa, down_pa);
            double low = down_pa, high = up_pa;
            for (int k = 0; k < 60; k++) { /* the pressure between them */
                const double at_pa = 0.5 * (low + high);
                const double passed = filling ? valve_alone(gas, up_pa, at_pa) : valve_alone(gas, at_pa, down_pa);
                *((passed > flow) == filling ? &low : &high) = at_pa;
            }
            const double line = flow / (filling ? low - down_pa : up_pa - low);
            least = fmin(least, line);
            most = fmax(most, line);
            assert_true(share > 0.0 && share < 1.0);
            if (!filling && pressure_pa[0] == 10000.0) {
                assert_relative(share, effect.parameter[0], 0.05);
            }
        }
        assert_relative(most, least, 2e-3);
    }
}

/* Where what comes in through the valve goes out through the hole. */
static void a_leak_holds_the_pressure_where_flows_are_equal(void **state) {
    (void)state;
    const double leak = 4e-11;
    struct bench bench;
    struct plant_parameters parameters;
    plant_default_parameters(&parameters);
    bench_open(&bench, "chamber_leak:conductance=4e-11,chamber=3");
    bench_run(&bench, 4000, 1.0, 1.0, 1.0);
    const struct gas_parameters *gas = &parameters.gas;
    const double ambient = gas->ambient_pa_abs, supply = ambient + parameters.supply_pa;
    double low = ambient, high = supply;
    for (int i = 0; i < 60; i++) {
        const double middle = 0.5 * (low + high);
        *(gas_mass_flow(gas, gas->sonic_conductance, supply, middle) >
                  gas_mass_flow(gas, leak, middle, ambient)
              ? &low
              : &high) = middle;
    }
    assert_close(bench.plant.pressure_pa[2], low - ambient, 10.0);
    assert_close(bench.plant.pressure_pa[0], parameters.supply_pa, 10.0);
    assert_true(bench.plant.pressure_pa[2] < parameters.supply_pa - 1000.0);
    bench_close(&bench);
}

static void a_coupled_chamber_shows_a_share_of_its_neighbour(void **state) {
    (void)state;
    static const struct {
        const char *effect;
        double share[3]; /* of chamber 1's pressure */
    } cases[] = {{"cross_coupling:fraction=0.1", {0.0, 0.0, 0.1}},
                 {"cross_coupling:fraction=0.1,side=0", {0.0, 0.1, 0.0}},
                 {"cross_coupling:fraction=0.2,side=0.75", {0.0, 0.05, 0.15}},
                 {"cross_coupling:fraction=0.1,chamber=3", {0.0, 0.0, 0.1}},
                 {"cross_coupling:fraction=0.1,chamber=1", {0.0, 0.0, 0.0}}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct bench bench;
        bench_open(&bench, cases[i].effect);
        bench_run(&bench, 100, 1.0, 0.0, 0.0);
        const double own_pa = bench.plant.chambers.pressure_pa[0];
        assert_true(own_pa > 1000.0);
        for (size_t c = 0; c < 3; c++) {
            assert_close(bench.plant.pressure_pa[c],
                         bench.plant.chambers.pressure_pa[c] + cases[i].share[c] * own_pa, 0.01);
            assert_close(bench.plant.reading_pa[c], bench.plant.pressure_pa[c], 0.0);
        }
        bench_close(&bench);
    }
}

static void a_drooping_supply_follows_the_flow_with_one_time_constant(void **state) {
    (void)state;
    struct effect effect = make("supply_droop:drop_per_flow=2e8,recovery_time=0.4");
    struct chamber_influence influence;
    struct effect_signals signals = {.step_s = 0.001, .supply_flow_kgps = 3e-5, .influence = &influence};
    for (int i = 1; i <= 2000; i++) {
        influence.supply_pa = 40000.0;
        signals.supply_flow_kgps = i <= 1000 ? 3e-5 : 0.0;
        effects_run(&effect, 1, EFFECT_HOOK_GAS, &signals);
        const double filled = 1.0 - exp(-0.001 * (i < 1000 ? i : 1000) / 0.4),
                     kept = exp(-0.001 * (i > 1000 ? i - 1000 : 0) / 0.4);
        assert_close(influence.supply_pa, 40000.0 - 2e8 * 3e-5 * filled * kept, 1e-6);
    }
}

/* One valve open between the supply and a vented chamber draws what the bounds of the droop are made for. */
static void the_greatest_droop_of_one_valve_is_the_supply(void **state) {
    (void)state;
    struct plant_parameters parameters;
    plant_default_parameters(&parameters);
    const struct gas_parameters *gas = &parameters.gas;
    const double flow_kgps = gas_mass_flow(gas, gas->sonic_conductance,
                                           gas->ambient_pa_abs + parameters.supply_pa, gas->ambient_pa_abs);
    assert_relative(flow_kgps, 2.7e-5, 0.01);
    assert_relative(effect_kind_find("supply_droop")->parameter[0].most * flow_kgps, parameters.supply_pa, 0.02);
    /* and with leaks to feed, supply and flow are in balance */
    struct bench bench;
    struct effect droop = make("supply_droop:drop_per_flow=2e8,recovery_time=0.1");
    bench_open(&bench, "chamber_leak:conductance=1e-10,chamber=1");
    assert_true(plant_add_effect(&bench.plant, &droop));
    bench_run(&bench, 4000, 1.0, 0.0, 0.0);
    assert_relative(40000.0 - bench.plant.influence.supply_pa, 2e8 * bench.plant.chambers.supply_flow_kgps,
                    0.01);
    assert_true(bench.plant.influence.supply_pa < 38000.0);
    bench_close(&bench);
}

/* --- pressure sensors --- */

static void offset_and_gain_are_what_they_say(void **state) {
    (void)state;
    static const struct {
        const char *effect;
        double expected_pa[3];
    } cases[] = {{"pressure_offset:offset=-250", {-250.0, 4750.0, 9750.0}},
                 {"pressure_offset:offset=800,chamber=2", {0.0, 5800.0, 10000.0}},
                 {"pressure_gain:gain=1.1", {0.0, 5500.0, 11000.0}},
                 {"pressure_gain:gain=0.9,chamber=3", {0.0, 5000.0, 9000.0}}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct effect effect = make(cases[i].effect);
        double reading_pa[3] = {0.0, 5000.0, 10000.0};
        struct effect_signals signals = {.reading_pa = reading_pa};
        effects_run(&effect, 1, EFFECT_HOOK_READING, &signals);
        for (size_t c = 0; c < 3; c++) {
            assert_close(reading_pa[c], cases[i].expected_pa[c], 1e-9);
        }
    }
}

/* A pressure that rises over the first step and is held, one that goes on rising, and one that is constant.
 */
static void a_lagging_sensor_answers_a_step_and_a_ramp_exactly(void **state) {
    (void)state;
    const double tau_s[] = {0.3, 0.03, 0.001, 1e-5};
    for (size_t k = 0; k < sizeof tau_s / sizeof tau_s[0]; k++) {
        struct effect effect = make("pressure_lag");
        effect.parameter[0] = tau_s[k];
        const double step_s = 0.001, tau = tau_s[k];
        for (int i = 0; i <= 500; i++) {
            double reading_pa[3] = {i > 0 ? 1000.0 : 0.0, 20.0 * i, 5000.0};
            const double time_s = i * step_s;
            struct effect_signals signals = {.time_s = time_s, .step_s = step_s, .reading_pa = reading_pa};
            effects_run(&effect, 1, EFFECT_HOOK_READING, &signals);
            /* the mean of exp(-(time - s) / tau) over s in the first step */
            const double left =
                i == 0 ? 1.0 : tau / step_s * (exp(-(time_s - step_s) / tau) - exp(-time_s / tau));
            assert_close(reading_pa[0], 1000.0 * (1.0 - left), 1e-9);
            assert_close(reading_pa[1], 20000.0 * (time_s - tau * (1.0 - exp(-time_s / tau))), 1e-8);
            assert_close(reading_pa[2], 5000.0, 1e-9);
        }
    }
}

/* --- tip sensor --- */

/* The tip of a quarter turn towards +x: its axes are -z, y and x of the base. */
static const struct tip_pose quarter = {{0.04, -0.01, 0.03}, {M_SQRT1_2, 0.0, M_SQRT1_2, 0.0}};

static struct tip_pose seen(const char *effect_text, const struct tip_pose *pose) {
    struct effect effect = make(effect_text);
    struct tip_pose result = *pose;
    struct effect_signals signals = {.chance = 1.0, .pose = &result};
    effects_run(&effect, 1, EFFECT_HOOK_POSE, &signals);
    return result;
}

static void a_tip_sensor_is_moved_as_geometry_says(void **state) {
    (void)state;
    const struct tip_pose rest = {{0.0, 0.0, 0.065}, {1.0, 0.0, 0.0, 0.0}};
    const double far = (0.04 * 0.04 + 0.01 * 0.01) / (0.04 * 0.04);
    const struct {
        const char *effect;
        const struct tip_pose *pose;
        double moved_m[3];
    } cases[] = {
        {"tip_offset:x=0.001,y=-0.002,z=0.003", &rest, {0.001, -0.002, 0.003}},
        {"tip_offset:x=0.001,y=-0.002,z=0.003", &quarter, {0.001, -0.002, 0.003}},
        {"tip_lever_arm:x=0.001,y=-0.002,z=0.003", &rest, {0.001, -0.002, 0.003}},
        {"tip_lever_arm:x=0.001,y=-0.002,z=0.003", &quarter, {0.003, -0.002, -0.001}},
        {"tip_distortion:x=0.001,y=-0.002,z=0.003", &rest, {0.0, 0.0, 0.0}},
        {"tip_distortion:x=0.001,y=-0.002,z=0.003", &quarter, {0.001 * far, -0.002 * far, 0.003 * far}},
        {"tip_misalignment:x=0.1,y=0.2,z=-0.1", &quarter, {0.0, 0.0, 0.0}}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const struct tip_pose after = seen(cases[i].effect, cases[i].pose);
        for (size_t k = 0; k < 3; k++) {
            assert_close(after.position_m[k] - cases[i].pose->position_m[k], cases[i].moved_m[k], 1e-15);
        }
        for (size_t k = 0; k < 4 && strncmp(cases[i].effect, "tip_mis", 7) != 0; k++) {
            assert_true(after.quaternion[k] == cases[i].pose->quaternion[k]);
        }
    }
}

/* A further turn about the tip's y axis adds to the quarter turn; about its z axis it turns about the base's
 * x axis. */
static void a_misaligned_sensor_is_turned_in_the_tips_frame(void **state) {
    (void)state;
    const struct tip_pose on = seen("tip_misalignment:x=0,y=0.3,z=0", &quarter);
    assert_close(on.quaternion[0], cos(0.25 * M_PI + 0.15), 1e-12);
    assert_close(on.quaternion[2], sin(0.25 * M_PI + 0.15), 1e-12);
    const struct tip_pose about = seen("tip_misalignment:x=0,y=0,z=0.3", &quarter);
    const double c = cos(0.15), s = sin(0.15), h = M_SQRT1_2, expected[4] = {h * c, h * s, h * c, h * s};
    for (size_t k = 0; k < 4; k++) { /* (c, s, 0, 0) times the quarter turn */
        assert_close(about.quaternion[k], expected[k], 1e-12);
    }
}

/* Position on a parabola, orientation turning steadily about y, sampled at uneven times. */
static struct tip_pose moving_pose(double time_s) {
    const double angle = 2.0 * time_s;
    return (struct tip_pose){{0.1 * time_s, 0.02 - 0.05 * time_s + 0.3 * time_s * time_s, 0.06},
                             {cos(0.5 * angle), 0.0, sin(0.5 * angle), 0.0}};
}

static void a_late_tip_is_where_it_was(void **state) {
    (void)state;
    const double delay_s[] = {0.0, 0.003, 0.03, 0.0377, 0.15}, period_s[] = {0.05, 0.01, 1.0 / 255.0, 0.001};
    for (size_t d = 0; d < sizeof delay_s / sizeof delay_s[0]; d++) {
        for (size_t k = 0; k < sizeof period_s / sizeof period_s[0]; k++) {
            struct effect effect = make("tip_latency");
            effect.parameter[0] = delay_s[d];
            for (int i = 0; i * period_s[k] < 1.0; i++) {
                const double time_s = period_s[k] * (i + (i % 3 == 1 ? 0.2 : 0.0));
                struct tip_pose pose = moving_pose(time_s);
                const struct tip_pose start = moving_pose(0.0), expected = moving_pose(time_s - delay_s[d]);
                struct effect_signals signals = {.time_s = time_s, .pose = &pose};
                effects_run(&effect, 1, EFFECT_HOOK_POSE, &signals);
                const bool before = time_s < delay_s[d]; /* the first pose stood before it */
                for (size_t c = 0; c < 3; c++) {
                    const double from_line =
                        i < 3 || time_s < 0.015 ? 1e-3 : 1e-12; /* two poses make no parabola */
                    assert_close(pose.position_m[c], (before ? start : expected).position_m[c], from_line);
                }
                for (size_t c = 0; c < 4; c++) {
                    assert_close(pose.quaternion[c], (before ? start : expected).quaternion[c],
                                 before ? 1e-12 : 2e-5);
                }
            }
        }
    }
}

static void a_frozen_tip_repeats_its_last_pose_by_chance(void **state) {
    (void)state;
    struct effect effect = make("tip_freeze:fraction=0.3");
    const double chance[] = {0.1, 0.2, 0.5, 0.29, 0.31, 0.01, 0.02, 0.9},
                 expected_m[] = {0, 0, 2, 2, 4, 4, 4, 7};
    for (size_t i = 0; i < sizeof chance / sizeof chance[0]; i++) {
        struct tip_pose pose = {{(double)i, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
        struct effect_signals signals = {.chance = chance[i], .pose = &pose};
        effects_run(&effect, 1, EFFECT_HOOK_POSE, &signals);
        assert_true(pose.position_m[0] == expected_m[i]);
    }
}

/* --- body: rubber --- */

static double loaded(struct effect *effect, double load_pa, double time_s, double temperature_k) {
    double load[3] = {0.0, load_pa, 0.0};
    struct effect_signals signals = {.time_s = time_s,
                                     .step_s = 0.01,
                                     .temperature_k = temperature_k,
                                     .table = &reference.table,
                                     .load_pa = load};
    effects_run(effect, 1, EFFECT_HOOK_LOAD, &signals);
    assert_true(load[0] == 0.0 && load[2] == 0.0);
    return load[1];
}

static void rubber_that_was_stretched_is_softer_up_to_that_stretch(void **state) {
    (void)state;
    struct effect effect = make("mullins:softening=0.2,scale=0.5");
    const double working_pa = (double)reference.table.module.working_pressure_pa, most_pa = 6000.0;
    for (double load = 0.0; load <= most_pa; load += 100.0) {
        assert_true(loaded(&effect, load, 0.0, NAN) == load); /* at first as it is */
    }
    for (int cycle = 0; cycle < 2; cycle++) {
        for (double share = 1.0; share >= 0.0; share -= 0.05) { /* then softer, up and down and whenever */
            const double softer = 0.2 * (1.0 - exp(-most_pa / (0.5 * working_pa))) * (1.0 - share * share);
            assert_close(loaded(&effect, share * most_pa, 0.0, NAN), share * most_pa / (1.0 - softer), 1e-9);
        }
    }
    for (double load = most_pa; load <= 9000.0; load += 100.0) {
        assert_true(loaded(&effect, load, 0.0, NAN) == load); /* beyond, as it is */
    }
    assert_true(loaded(&effect, -50.0, 0.0, NAN) < -50.0); /* a sensor that reads under zero does no harm */
}

static void stiffness_follows_temperature_or_drifts(void **state) {
    (void)state;
    struct effect effect = make("temperature_stiffness:per_kelvin=0.01,drift=0.001");
    assert_close(loaded(&effect, 5000.0, 100.0, 293.15), 5000.0, 1e-9);
    assert_close(loaded(&effect, 5000.0, 110.0, 303.15), 5000.0 / 1.1, 1e-9);
    assert_close(loaded(&effect, 5000.0, 110.0, 283.15), 5000.0 / 0.9, 1e-9);
    assert_close(loaded(&effect, 5000.0, 150.0, NAN), 5000.0 / 1.05, 1e-9);
    struct effect drifting = make("temperature_stiffness:per_kelvin=0.01,drift=-0.01");
    assert_true(loaded(&drifting, 5000.0, 700.0, NAN) == 5000.0); /* nothing at the start, whenever that is */
    assert_close(loaded(&drifting, 5000.0, 710.0, NAN), 5000.0 / 0.9, 1e-9);
    assert_true(isfinite(loaded(&drifting, 5000.0, 5000.0, NAN)));
}

static void shaped(struct effect *effect, struct body_shape *shape) {
    double load_pa[3] = {0.0};
    struct effect_signals signals = {.step_s = 0.01,
                                     .table = &reference.table,
                                     .stiffness_scale = 1.0,
                                     .load_pa = load_pa,
                                     .shape = shape};
    effects_run(effect, 1, EFFECT_HOOK_SHAPE, &signals);
}

/* Bend along one direction in steps up to `bend`, from wherever it is; what comes out last. */
static double bent_to(struct effect *effect, double from, double to, int steps) {
    const double x = cos(0.7), y = sin(0.7);
    double out = 0.0;
    for (int i = 1; i <= steps; i++) {
        const double bend = from + (to - from) * i / steps;
        struct body_shape shape = {bend * x, bend * y, 1.1, 1.0};
        shaped(effect, &shape);
        out = shape.bend_x_rad * x + shape.bend_y_rad * y;
        assert_close(shape.bend_y_rad * x, shape.bend_x_rad * y, 1e-12); /* it stays on the line */
        assert_true(shape.stretch == 1.1);
    }
    return out;
}

static void a_hysteresis_loop_is_as_wide_as_it_says_at_any_rate(void **state) {
    (void)state;
    const double limit = (double)reference.table.module.bend_limit_rad;
    static const char *const kinds[] = {"hysteresis:width=0.1,memory=0.3", "hysteresis:width=0.05,memory=0.15",
                                        "hysteresis:width=0.05,memory=0.45", "hysteresis:width=0.1,memory=0.3,form=1",
                                        "hysteresis:width=0.05,memory=0.15,form=1", "hysteresis:width=0.2,memory=0.05",
                                        "hysteresis:width=0.18,memory=0.05,form=1"};
    for (size_t i = 0; i < 3 * sizeof kinds / sizeof kinds[0]; i++) {
        const int steps = i % 3 == 0 ? 2 : i % 3 == 1 ? 20 : 2000;
        struct effect effect = make(kinds[i / 3]);
        (void)bent_to(&effect, 0.0, limit, steps);
        (void)bent_to(&effect, limit, 0.0, steps);
        for (int cycle = 0; cycle < 2; cycle++) {
            const double up = bent_to(&effect, 0.0, 0.5 * limit, steps);
            const double top = bent_to(&effect, 0.5 * limit, limit, steps);
            const double down = bent_to(&effect, limit, 0.5 * limit, steps);
            const double bottom = bent_to(&effect, 0.5 * limit, 0.0, steps);
            assert_relative(down - up, effect.parameter[0] * limit, 0.001);
            assert_close(0.5 * (down + up), 0.5 * limit, 1e-12); /* round the nominal curve */
            assert_close(top + bottom, limit, 1e-12);
        }
    }
}

/* How wide a cycle from zero to a share of the limit opens, as a share of its own length. */
static double opens_by(struct effect effect, double share) {
    const double most = share * (double)reference.table.module.bend_limit_rad;
    (void)bent_to(&effect, 0.0, most, 50);
    (void)bent_to(&effect, most, 0.0, 50);
    const double up = bent_to(&effect, 0.0, 0.5 * most, 50);
    (void)bent_to(&effect, 0.5 * most, most, 50);
    return (bent_to(&effect, most, 0.5 * most, 50) - up) / most;
}

/* Loops of any size up to the memory are about as wide for their size; longer ones all open by as much, and of the other
 * form nearly all are longer ones. */
static void hysteresis_loops_grow_with_their_size_up_to_the_memory(void **state) {
    (void)state;
    const struct effect all_sizes = make("hysteresis:width=0.1,memory=0.5"), small = make("hysteresis:width=0.02,memory=0.05"),
                        one_size = make("hysteresis:width=0.05,memory=0.12,form=1");
    for (double share = 1.0; share > 0.2; share *= 0.5) { // NOLINT(cert-flp30-c): powers of two
        const double open = opens_by(all_sizes, share);
        assert_true(open > 0.05 && open < 0.13);
    }
    assert_relative(opens_by(small, 0.5), 2.0 * opens_by(small, 1.0), 0.01);
    assert_relative(opens_by(one_size, 0.5), 2.0 * opens_by(one_size, 1.0), 0.01);
    assert_true(opens_by(one_size, 0.1) < opens_by(one_size, 0.5));
}

/* However wide a loop is asked for, the bend never goes the wrong way where the load turns round. */
static void a_hysteresis_that_asks_for_too_much_only_stands_still(void **state) {
    (void)state;
    for (size_t i = 0; i < 4; i++) {
        struct effect effect = make(i < 2 ? "hysteresis:width=0.2,memory=0.05" : "hysteresis:width=0.2,memory=2");
        effect.form = i % 2;
        const double top = bent_to(&effect, 0.0, 1.0, 50), back = bent_to(&effect, 1.0, 0.99, 3);
        assert_true(back < top);
    }
}

static void a_minor_hysteresis_loop_closes_and_is_forgotten(void **state) {
    (void)state;
    struct effect with = make("hysteresis:width=0.15,memory=0.4"), without = with;
    const double before = bent_to(&with, 0.0, 1.2, 20);
    (void)bent_to(&with, 1.2, 0.7, 20);
    (void)bent_to(&with, 0.7, 0.9, 20);
    (void)bent_to(&with, 0.9, 0.7, 20);
    assert_close(bent_to(&with, 0.7, 1.2, 20), before, 1e-12);
    (void)bent_to(&without, 0.0, 1.2, 20);
    assert_close(bent_to(&with, 1.2, 1.6, 20), bent_to(&without, 1.2, 1.6, 20), 1e-12);
    assert_true(bent_to(&with, 1.6, 0.0, 20) > 0.01); /* some bend is left after venting */
}

static void an_asymmetric_chamber_has_a_gain_and_an_azimuth_of_its_own(void **state) {
    (void)state;
    struct effect effect = make("chamber_asymmetry:gain=1.1,azimuth=0.2,chamber=2");
    const double cases_pa[][3] = {
        {0.0, 7000.0, 0.0}, {7000.0, 0.0, 0.0}, {5000.0, 0.0, 6000.0}, {3000.0, 7000.0, 0.0}};
    for (size_t i = 0; i < sizeof cases_pa / sizeof cases_pa[0]; i++) {
        double load_pa[3] = {cases_pa[i][0], cases_pa[i][1], cases_pa[i][2]};
        const double gained_pa[3] = {load_pa[0], 1.1 * load_pa[1], load_pa[2]};
        struct body_shape shape, nominal, others;
        struct effect_signals signals = {
            .step_s = 0.01, .table = &reference.table, .load_pa = load_pa, .shape = &shape};
        effects_run(&effect, 1, EFFECT_HOOK_LOAD, &signals);
        body_shape_at(&reference.table, load_pa, &shape);
        effects_run(&effect, 1, EFFECT_HOOK_SHAPE, &signals);
        body_shape_at(&reference.table, gained_pa, &nominal);
        body_shape_at(&reference.table, (const double[3]){gained_pa[0], 0.0, gained_pa[2]}, &others);
        const double own =
            hypot(nominal.bend_x_rad - others.bend_x_rad, nominal.bend_y_rad - others.bend_y_rad);
        const double azimuth =
            atan2(nominal.bend_y_rad - others.bend_y_rad, nominal.bend_x_rad - others.bend_x_rad);
        assert_close(shape.bend_x_rad, others.bend_x_rad + own * cos(azimuth + 0.2), 1e-12);
        assert_close(shape.bend_y_rad, others.bend_y_rad + own * sin(azimuth + 0.2), 1e-12);
        assert_true((own > 0.1) == (load_pa[1] > 0.0));
    }
}

/* --- body: ends, weight, contact --- */

static void a_restrained_module_is_a_shorter_arc_between_longer_caps(void **state) {
    (void)state;
    struct effect effect = make("end_restraint:fraction=0.8");
    struct body_shape shape = {0.5 * M_PI / 0.8, 0.0, 1.0, 1.0};
    struct tip_pose pose;
    shaped(&effect, &shape);
    body_tip_pose(&reference.table.module, &shape, &pose);
    const double radius_m = 0.8 * 0.055 / (0.5 * M_PI), cap_m = 0.005 + 0.1 * 0.055;
    assert_close(pose.position_m[0], radius_m + cap_m, 1e-8);
    assert_close(pose.position_m[2], cap_m + radius_m, 1e-8);
    assert_close(pose.quaternion[2], sin(0.25 * M_PI), 1e-9);
}

static void contact_stops_only_what_goes_beyond_it(void **state) {
    (void)state;
    const double direction = 2.0;
    const struct {
        double along, across, expected;
    } cases[] = {
        {0.3, 0.4, 0.3}, {0.59, -0.2, 0.59}, {0.6, 0.0, 0.6 - 0.75 * 0.0025}, {0.61, 0.5, 0.61 - 0.75 * 0.01},
        {1.0, 0.5, 0.7}, {-1.0, 0.3, -1.0}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct effect effect = make("contact:direction=2.0,bend=0.6,stiffness=3");
        const double x = cos(direction), y = sin(direction);
        struct body_shape shape = {cases[i].along * x - cases[i].across * y,
                                   cases[i].along * y + cases[i].across * x, 1.0, 1.0};
        shaped(&effect, &shape);
        assert_close(shape.bend_x_rad * x + shape.bend_y_rad * y, cases[i].expected, 1e-12);
        assert_close(shape.bend_y_rad * x - shape.bend_x_rad * y, cases[i].across, 1e-12);
    }
}

/* The reference module: Ecoflex 0030's shear modulus is 2 x 5072 Pa, the section is a disc less three
 * semicircles of 3.7 mm radius whose centroids are 8.87 mm from the axis. */
static void the_bending_stiffness_is_that_of_the_section(void **state) {
    (void)state;
    const double chamber_m2 = 0.5 * M_PI * 3.7e-3 * 3.7e-3, offset_m = 8.87e-3;
    const double second_moment_m4 = M_PI / 64.0 * pow(0.025, 4.0) - 1.5 * chamber_m2 * offset_m * offset_m;
    assert_relative(1.0 / body_bending_compliance(&reference.table), 3.0 * 2.0 * 5072.0 * second_moment_m4,
                    0.05);
}

/* A small weight on a straight, level module: slopes of a cantilever, w L^3 / (6 EI) + F (L^2 / 2 + a L) /
 * EI. */
static void a_level_module_sags_as_a_cantilever(void **state) {
    (void)state;
    const double length_m = 0.055, cap_m = 0.005, give = body_bending_compliance(&reference.table);
    const double face_m2 = M_PI / 4.0 * 0.025 * 0.025, chambers_m2 = 1.5 * M_PI * 3.7e-3 * 3.7e-3;
    const double line_npm = 0.01 * 1070.0 * GRAVITY_MPS2 * (face_m2 - chambers_m2);
    const double cap_n = 0.01 * 1070.0 * GRAVITY_MPS2 * face_m2 * cap_m, mass_n = 1e-4 * GRAVITY_MPS2;
    const double own =
        give * (line_npm * pow(length_m, 3.0) / 6.0 + cap_n * length_m * (0.5 * length_m + 0.5 * cap_m));
    const double payload = give * mass_n * length_m * (0.5 * length_m + cap_m);
    for (double azimuth = -3.0; azimuth <= 3.0; azimuth += 0.5) {
        char gravity[96], mass[96];
        (void)snprintf(gravity, sizeof gravity, "gravity:angle=%.17g,azimuth=%g,weight_scale=0.01",
                       0.5 * M_PI, azimuth);
        (void)snprintf(mass, sizeof mass, "tip_payload:mass=1e-4,angle=%.17g,azimuth=%g", 0.5 * M_PI,
                       azimuth);
        const char *const texts[2] = {gravity, mass};
        for (int i = 0; i < 2; i++) {
            struct effect effect = make(texts[i]);
            struct body_shape shape = {0.0, 0.0, 1.0, 1.0};
            shaped(&effect, &shape);
            assert_relative(hypot(shape.bend_x_rad, shape.bend_y_rad), i == 0 ? own : payload, 2e-3);
            assert_close(cos(atan2(shape.bend_y_rad, shape.bend_x_rad) - azimuth), 1.0, 1e-9);
        }
    }
}

/* `tribend-tables rod paper-semicircle`, a rod on the solved section: level 18.90 deg at rest; at 8 kPa in
 * chamber 1, hanging 7.7 deg less and standing 10.1 deg more. One stiffness for every pressure cannot be
 * nearer than a third. */
static void the_weight_of_the_reference_module_bends_it_as_its_rod(void **state) {
    (void)state;
    struct effect level = make("gravity"), hanging = make("gravity:angle=0"),
                  standing = make("gravity:angle=3.14159265");
    struct body_shape rest = {0.0, 0.0, 1.0, 1.0}, bent, upright = {0.0, 0.0, 1.0, 1.0};
    shaped(&level, &rest);
    assert_close(rest.bend_x_rad, 18.9 * DEG, 0.5 * DEG);
    assert_close(rest.bend_y_rad, 0.0, 1e-12);
    shaped(&hanging, &upright);
    assert_true(hypot(upright.bend_x_rad, upright.bend_y_rad) == 0.0);
    const double pressure_pa[3] = {8000.0, 0.0, 0.0};
    body_shape_at(&reference.table, pressure_pa, &bent);
    const double before = -bent.bend_x_rad;
    struct body_shape hung = bent, stood = bent;
    shaped(&hanging, &hung);
    shaped(&standing, &stood);
    assert_close(before + hung.bend_x_rad, 7.7 * DEG, 2.6 * DEG);
    assert_close(-stood.bend_x_rad - before, 10.1 * DEG, 4.0 * DEG);
}

/* Energy of a shape under a weight, by summing points of the arc: bending, less the work. */
static double energy(const struct body_shape *shape, const struct body_shape *start,
                     const struct body_weight *weight) {
    const struct bend_table_module *module = &reference.table.module;
    const double length_m = (double)module->chamber_length_m * shape->stretch;
    const double x = shape->bend_x_rad - start->bend_x_rad, y = shape->bend_y_rad - start->bend_y_rad;
    double sum = 0.5 * (x * x + y * y) / (body_bending_compliance(&reference.table) * length_m);
    enum { POINTS = 400 };
    for (int i = 0; i <= POINTS; i++) { /* the last one is the weight at the end */
        const double share = i < POINTS ? (i + 0.5) / POINTS : 1.0;
        struct bend_table_module part = *module;
        part.chamber_length_m = (float)(share * (double)module->chamber_length_m);
        part.cap_distal_m = i < POINTS ? 0.0f : (float)weight->end_beyond_m;
        const struct body_shape bent = {share * shape->bend_x_rad, share * shape->bend_y_rad, shape->stretch,
                                        1.0};
        struct tip_pose pose;
        body_tip_pose(&part, &bent, &pose);
        for (int k = 0; k < 3; k++) {
            const double pull_n = i < POINTS ? weight->spread_n / POINTS : weight->end_n;
            sum -= pull_n * weight->down[k] * pose.position_m[k];
        }
    }
    return sum;
}

static void under_weight_the_energy_is_least(void **state) {
    (void)state;
    static const struct {
        double bend_x, bend_y, angle, azimuth, spread_n, end_n;
    } cases[] = {{0.0, 0.0, 0.5, 1.0, 0.25, 0.02}, {1.0, 0.5, 1.5, -2.0, 0.25, 0.02},
                 {-1.8, 0.3, 0.2, 0.4, 0.7, 0.1},  {0.5, -0.2, 3.0, 2.0, 0.25, 0.02},
                 {0.02, 0.01, 1.2, 0.3, 0.0, 1.0}, {0.3, 0.0, 3.1, 0.0, 0.7, 0.5}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct body_weight weight = {
            .spread_n = cases[i].spread_n, .end_n = cases[i].end_n, .end_beyond_m = 0.004};
        const struct body_shape start = {cases[i].bend_x, cases[i].bend_y, 1.08, 1.0};
        struct body_shape shape = start;
        body_down(cases[i].angle, cases[i].azimuth, weight.down);
        body_bend_under(&reference.table, 1.0, &weight, &shape);
        const double least = energy(&shape, &start, &weight), away = 0.01;
        for (int k = 0; k < 8; k++) {
            struct body_shape beside = shape;
            beside.bend_x_rad += away * cos(k * M_PI / 4.0);
            beside.bend_y_rad += away * sin(k * M_PI / 4.0);
            assert_true(energy(&beside, &start, &weight) > least);
        }
        assert_true(least < energy(&start, &start, &weight));
        struct body_shape stiff = start;
        body_bend_under(&reference.table, 1e9, &weight, &stiff);
        assert_close(stiff.bend_x_rad, start.bend_x_rad, 1e-6);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_catalogue_is_whole),
        cmocka_unit_test(every_effect_says_what_it_is),
        cmocka_unit_test(at_none_nothing_changes),
        cmocka_unit_test(typical_values_show_where_they_should),
        cmocka_unit_test(before_its_onset_an_effect_does_nothing),
        cmocka_unit_test(before_its_onset_a_latent_effect_only_remembers),
        cmocka_unit_test(an_effect_on_one_chamber_stays_there),
        cmocka_unit_test(effects_are_smooth_in_their_parameters),
        cmocka_unit_test(a_late_valve_gives_the_same_pressure_later),
        cmocka_unit_test(a_dead_band_stops_small_duties_and_its_loss_shortens_all),
        cmocka_unit_test(a_laminar_line_has_one_resistance_at_all_pressures),
        cmocka_unit_test(flow_and_volume_scale_the_time_of_filling_and_venting),
        cmocka_unit_test(a_leak_holds_the_pressure_where_flows_are_equal),
        cmocka_unit_test(a_coupled_chamber_shows_a_share_of_its_neighbour),
        cmocka_unit_test(a_drooping_supply_follows_the_flow_with_one_time_constant),
        cmocka_unit_test(the_greatest_droop_of_one_valve_is_the_supply),
        cmocka_unit_test(offset_and_gain_are_what_they_say),
        cmocka_unit_test(a_lagging_sensor_answers_a_step_and_a_ramp_exactly),
        cmocka_unit_test(a_tip_sensor_is_moved_as_geometry_says),
        cmocka_unit_test(a_misaligned_sensor_is_turned_in_the_tips_frame),
        cmocka_unit_test(a_late_tip_is_where_it_was),
        cmocka_unit_test(a_frozen_tip_repeats_its_last_pose_by_chance),
        cmocka_unit_test(rubber_that_was_stretched_is_softer_up_to_that_stretch),
        cmocka_unit_test(stiffness_follows_temperature_or_drifts),
        cmocka_unit_test(a_hysteresis_loop_is_as_wide_as_it_says_at_any_rate),
        cmocka_unit_test(hysteresis_loops_grow_with_their_size_up_to_the_memory),
        cmocka_unit_test(a_hysteresis_that_asks_for_too_much_only_stands_still),
        cmocka_unit_test(a_minor_hysteresis_loop_closes_and_is_forgotten),
        cmocka_unit_test(an_asymmetric_chamber_has_a_gain_and_an_azimuth_of_its_own),
        cmocka_unit_test(a_restrained_module_is_a_shorter_arc_between_longer_caps),
        cmocka_unit_test(contact_stops_only_what_goes_beyond_it),
        cmocka_unit_test(the_bending_stiffness_is_that_of_the_section),
        cmocka_unit_test(a_level_module_sags_as_a_cantilever),
        cmocka_unit_test(the_weight_of_the_reference_module_bends_it_as_its_rod),
        cmocka_unit_test(under_weight_the_energy_is_least),
    };
    return cmocka_run_group_tests(tests, open_reference, close_reference);
}
