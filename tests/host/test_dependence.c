/* On what the residuals of a recording depend, of simulated modules whose effect is known: which chamber, which variable, where. */
#include "support/test.h"

#include <stdlib.h>
#include <unistd.h>

#include "gap/dependence.h"
#include "link/sim_link.h"
#include "log/run_log.h"
#include "program/table_file.h"
#include "support/scratch.h"

#define TABLE "tables/paper-semicircle.tbt"
#define SECONDS 40
#define ROW_US 5000
#define COMMAND_US 100000

static struct table_file table;
static char log_path[SCRATCH_BYTES];

/* Each chamber to a random pressure every second or two, in every fourth stretch to none. */
static void draw_command(struct random_stream *random, struct controller_command *command, int64_t *until_us) {
    const bool rest = random_uniform(random) < 0.25;
    *until_us += (int64_t)(1e6 * (1.0 + random_uniform(random)));
    *command = (struct controller_command){.kind = COMMAND_PRESSURE};
    for (size_t c = 0; c < 3; c++) {
        command->pressure_pa[c] = rest ? 0.0f : (float)(8000.0 * random_uniform(random));
    }
}

static void record(const char *effect_text) {
    static struct sim_link sim;
    struct link link;
    struct link_report report = {.time_us = 0};
    struct run_log_writer log;
    struct random_stream random;
    struct controller_command command = {.kind = COMMAND_VENT};
    struct effect effect;
    char error[512];
    const struct run_log_metadata metadata = {.module = table.table.module.name, .rate_hz = 200.0, .note = ""};
    int64_t until_us = 1000000, phase_us = -1;
    sim_link_open(&sim, &table.table, 3, &link);
    if (effect_text != NULL && (!effect_parse(effect_text, &effect, error, sizeof error) || !sim_add_effect(&sim.sim, &effect))) {
        fail_msg("%s", error);
    }
    if (!run_log_create(&log, log_path, &metadata, error, sizeof error)) {
        fail_msg("%s", error);
    }
    random_seed(&random, 11, 2);
    for (int64_t step = 0; step < SECONDS * 1000; step++) {
        if (report.time_us >= until_us) {
            draw_command(&random, &command, &until_us);
        }
        if (report.time_us % COMMAND_US == 0) {
            assert_true(link.send(link.context, &command));
        }
        assert_true(link.receive(link.context, &report));
        phase_us = phase_us < 0 && report.tip_new ? report.time_us % ROW_US : phase_us;
        if (phase_us >= 0 && report.time_us % ROW_US == phase_us) {
            run_log_append(&log, &report, &command);
        }
    }
    link.close(link.context);
    assert_int_equal(report.status.faults, 0); /* a sensor that lags is no broken valve */
    assert_int_equal(report.status.state, SUPERVISOR_ACTIVE);
    assert_true(run_log_finish(&log, error, sizeof error));
}

/* Against the nominal model, which stands for the recalibrated and the best one. */
static void find(const char *effect_text, struct dependences *dependences) {
    static struct search search;
    static struct gap_data data;
    struct plant_parameters nominal;
    struct replay_state state;
    const char *path = log_path;
    char error[512];
    record(effect_text);
    if (!gap_data_read(&data, &path, 1, error, sizeof error)) {
        fail_msg("%s", error);
    }
    plant_default_parameters(&nominal);
    memset(&search, 0, sizeof search);
    search.data = &data;
    search.nominal.model = (struct gap_model){.stiffness_scale = 1.0, .supply_scale = 1.0};
    search.recalibrated = search.best = search.nominal;
    assert_true(replay_open(&search.replay, &data, &table.table, &nominal));
    assert_true(replay_state_open(&state, &search.replay));
    assert_true(replay_prepare(&search.replay, &search.nominal.model, &state));
    replay_state_close(&state, &search.replay);
    assert_true(dependence_find(dependences, &search, false));
    replay_close(&search.replay);
    gap_data_free(&data);
}

static const struct dependence *strongest(const struct dependences *dependences, const char *residual, const char *variable) {
    for (size_t i = 0; i < dependences->count; i++) {
        const struct dependence *one = &dependences->list[i];
        if (strcmp(one->residual, residual) == 0 && (variable == NULL || strcmp(one->variable, variable) == 0)) {
            return one;
        }
    }
    fail_msg("nothing is said of %s%s%s", residual, variable != NULL ? " and " : "", variable != NULL ? variable : "");
    return NULL;
}

static void gain_of_a_sensor_depends_on_its_pressure(void **state) {
    static struct dependences dependences;
    (void)state;
    find("pressure_gain:gain=1.15,chamber=2", &dependences);
    const struct dependence *chamber = strongest(&dependences, "r1_pressure", "chamber");
    assert_string_equal(chamber->channel, "chamber 2");
    assert_true(chamber->share > 0.9);
    const struct dependence *pressure = strongest(&dependences, "r1_pressure", "pressure");
    assert_string_equal(pressure->channel, "chamber 2");
    assert_int_equal(pressure->chamber, 2);
    assert_true(pressure->share > 0.8 && pressure->to > 5.0 && pressure->off > 0.5);
    assert_string_equal(pressure->off_unit, "kPa");
}

static void lag_of_a_sensor_depends_on_the_rate(void **state) {
    static struct dependences dependences;
    (void)state;
    find("pressure_lag:time_constant=0.1,chamber=3", &dependences);
    const struct dependence *rate = strongest(&dependences, "r1_pressure", "pressure rate");
    assert_string_equal(rate->channel, "chamber 3");
    assert_int_equal(rate->chamber, 3);
    for (size_t i = 0; i < dependences.count; i++) { /* no other variable says more of that chamber */
        const struct dependence *one = &dependences.list[i];
        if (strcmp(one->channel, "chamber 3") == 0 && strcmp(one->variable, "chamber") != 0) {
            assert_true(one->share <= rate->share);
        }
    }
}

static void weak_chamber_shows_by_its_pressure_or_the_direction_of_the_bend(void **state) {
    static struct dependences dependences;
    (void)state;
    find("chamber_asymmetry:gain=0.85,chamber=1", &dependences);
    const struct dependence *body = strongest(&dependences, "r2_angle", NULL);
    assert_true(strcmp(body->variable, "bend direction") == 0 || (strcmp(body->variable, "pressure") == 0 && body->chamber == 1));
}

/* The line for people: each residual once, with its strongest. */
static void text_is_one_line(void **state) {
    static struct dependences dependences;
    char *text = NULL;
    size_t size = 0;
    (void)state;
    find("pressure_gain:gain=1.15,chamber=2", &dependences);
    FILE *out = open_memstream(&text, &size);
    assert_non_null(out);
    const size_t said = dependence_text(&dependences, false, out);
    assert_int_equal(fclose(out), 0);
    assert_in_range(said, 1, 3);
    assert_memory_equal(text, "depends   ", 10);
    assert_non_null(strstr(text, "r1_pressure chamber 2 on chamber ("));
    assert_ptr_equal(strchr(text, '\n'), text + strlen(text) - 1);
    free(text);
}

static int set_up(void **state) {
    (void)state;
    const int file = scratch_file(log_path);
    return file < 0 || close(file) != 0 ? -1 : table_file_open(&table, TABLE, NULL);
}

static int tear_down(void **state) {
    (void)state;
    table_file_close(&table);
    return remove(log_path);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(gain_of_a_sensor_depends_on_its_pressure),
                                       cmocka_unit_test(lag_of_a_sensor_depends_on_the_rate),
                                       cmocka_unit_test(weak_chamber_shows_by_its_pressure_or_the_direction_of_the_bend),
                                       cmocka_unit_test(text_is_one_line)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
