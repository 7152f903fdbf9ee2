/* `tribend gap diagnose` on this machine: seconds for a 60 s, 200 Hz log over the whole catalogue on two cores, how they grow
 * with the log's length and with the catalogue's size, and the peak memory. The logs are of a simulated module with a leak in
 * one chamber and a controller that follows random pressures. Growth is of processor time, which other programs on the machine
 * change little. Prints; asserts nothing but that each diagnosis succeeds.
 *
 *     bench_gap TRIBEND FOLDER      the program to time; where the logs go */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "link/sim_link.h"
#include "log/run_log.h"
#include "program/program.h"
#include "program/table_file.h"

#define EFFECT "chamber_leak:chamber=2"
#define TRUE_NAME "chamber_leak"
#define TABLE "tables/paper-semicircle.tbt"
#define RATE_HZ 200
#define ROW_US (1000000 / RATE_HZ)
#define COMMAND_US 100000
#define PATH_BYTES 4096
#define KINDS_MAX 64
#define ARGUMENTS_MAX (2 * KINDS_MAX + 16)

struct cost {
    double seconds;           /* on the clock */
    double processor_seconds; /* of both threads */
    double mebibytes; /* most that was resident */
};

static double now_s(void) {
    struct timespec now;
    (void)timespec_get(&now, TIME_UTC);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void fail(const char *what) {
    (void)fprintf(stderr, "bench_gap: %s\n", what);
    exit(1);
}

/* --- logs --- */

/* A pressure for each chamber, held for one to three seconds, in every fourth stretch none at all. */
static void draw_command(struct random_stream *random, const struct bend_table *table, struct controller_command *command,
                         int64_t time_us, int64_t *until_us) {
    const float most_pa = 0.8f * table->module.working_pressure_pa;
    const bool rest = random_uniform(random) < 0.25;
    *until_us = time_us + (int64_t)(1e6 * (1.0 + 2.0 * random_uniform(random)));
    *command = (struct controller_command){.kind = COMMAND_PRESSURE};
    for (size_t c = 0; c < 3; c++) {
        const float share = (float)random_uniform(random);
        command->pressure_pa[c] = rest || share < 0.3f ? 0.0f : share * most_pa;
    }
}

static void write_log(const struct bend_table *table, const char *path, int64_t seconds) {
    static struct sim_link sim;
    struct sim_link_setup setup;
    struct link link;
    struct link_report report = {.time_us = 0};
    struct run_log_writer log;
    struct random_stream random;
    struct controller_command command = {.kind = COMMAND_VENT};
    struct effect effect;
    char error[PROGRAM_ERROR_BYTES];
    const struct run_log_metadata metadata = {
        .module = table->module.name, .table_hash = table->module.inputs_hash, .rate_hz = RATE_HZ, .note = "for timing"};
    sim_link_default_setup(&setup, table, 1);
    if (!effect_parse(EFFECT, &effect, error, sizeof error) || !run_log_create(&log, path, &metadata, error, sizeof error)) {
        fail(error);
    }
    sim_link_open_setup(&sim, &setup, &link);
    if (!sim_add_effect(&sim.sim, &effect)) {
        fail("no room for the effect");
    }
    random_seed(&random, 5, 17);
    int64_t until_us = 1000000, phase_us = -1;
    for (int64_t step = 0; step < seconds * 1000; step++) {
        if (report.time_us >= until_us) {
            draw_command(&random, table, &command, report.time_us, &until_us);
        }
        if (report.time_us % COMMAND_US == 0) {
            (void)link.send(link.context, &command);
        }
        (void)link.receive(link.context, &report);
        phase_us = phase_us < 0 && report.tip_new ? report.time_us % ROW_US : phase_us; /* tip samples come in rows */
        if (phase_us >= 0 && report.time_us % ROW_US == phase_us) {
            run_log_append(&log, &report, &command);
        }
    }
    link.close(link.context);
    if (report.status.state != SUPERVISOR_ACTIVE || !run_log_finish(&log, error, sizeof error)) {
        fail("the recording did not come to its end");
    }
}

/* --- timing --- */

/* Every `share`-th entry of the catalogue, and the true one, are tried. */
static struct cost diagnose(const char *program, const char *path, size_t share) {
    char *argument[ARGUMENTS_MAX] = {(char *)program, "gap", "diagnose", (char *)path, "--table", TABLE, "--threads", "2", "-q"};
    size_t count = 9;
    for (size_t i = 0; i < effect_kind_count() && i < KINDS_MAX; i++) {
        const char *name = effect_kind_at(i)->name;
        if (i % share != 0 && strcmp(name, TRUE_NAME) != 0) {
            argument[count++] = "--without";
            argument[count++] = (char *)name;
        }
    }
    struct rusage usage;
    int status = 0;
    const double start_s = now_s();
    (void)fflush(stdout);
    const pid_t child = fork();
    if (child == 0) {
        (void)execv(program, argument);
        _exit(127);
    }
    if (child < 0 || wait4(child, &status, 0, &usage) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0) {
        fail("a diagnosis failed");
    }
    const double processor_s = (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
                               1e-6 * (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
    return (struct cost){now_s() - start_s, processor_s, (double)usage.ru_maxrss / 1024.0};
}

static size_t tried(size_t share) {
    size_t count = 0;
    for (size_t i = 0; i < effect_kind_count(); i++) {
        count += i % share == 0 || strcmp(effect_kind_at(i)->name, TRUE_NAME) == 0 ? 1 : 0;
    }
    return count;
}

int main(int argc, char **argv) {
    enum { LENGTHS = 4, WHOLE = 2 };
    static const int64_t length_s[LENGTHS] = {15, 30, 60, 120};
    struct table_file file;
    struct cost by_length[LENGTHS];
    char path[LENGTHS][PATH_BYTES];
    if (argc != 3 || table_file_open(&file, TABLE, NULL) != 0) {
        fail("usage: bench_gap TRIBEND FOLDER, in the tree's root");
    }
    for (size_t i = 0; i < LENGTHS; i++) {
        (void)snprintf(path[i], sizeof path[i], "%s/%d.csv", argv[2], (int)length_s[i]);
        write_log(&file.table, path[i], length_s[i]);
        by_length[i] = diagnose(argv[1], path[i], 1);
    }
    const struct cost whole = by_length[WHOLE];
    printf("diagnosis              %8.1f s   (log of 60 s at %d Hz, whole catalogue of %zu, two threads; aim 20 s; processor %.1f s)\n",
           whole.seconds, RATE_HZ, effect_kind_count(), whole.processor_seconds);
    printf("  by length           ");
    for (size_t i = 0; i < LENGTHS; i++) {
        printf(" %4d s: %.2f%s", (int)length_s[i], by_length[i].processor_seconds / whole.processor_seconds, i + 1 < LENGTHS ? "," : "");
    }
    printf("   (processor time over that of 60 s)\n  by catalogue        ");
    for (size_t share = 4; share >= 1; share /= 2) {
        const struct cost cost = share > 1 ? diagnose(argv[1], path[WHOLE], share) : whole;
        printf(" %zu entries: %.2f%s", tried(share), cost.processor_seconds / whole.processor_seconds, share > 1 ? "," : "");
    }
    printf("   (over that of the whole)\n  peak memory         ");
    for (size_t i = 0; i < LENGTHS; i++) {
        printf(" %4d s: %.0f MiB%s", (int)length_s[i], by_length[i].mebibytes, i + 1 < LENGTHS ? "," : "\n");
    }
    table_file_close(&file);
    return 0;
}
