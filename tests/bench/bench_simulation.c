/* Simulated seconds per second: controller and plant in closed loop, a bend command that changes once a second. Prints;
 * asserts nothing. */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "link/sim_link.h"
#include "program/table_file.h"

enum { SIMULATED_S = 100, RUNS = 5 };

static double seconds(void) {
    struct timespec now;
    (void)timespec_get(&now, TIME_UTC);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double time_run(const struct bend_table *table, uint64_t seed) {
    static struct sim_link sim;
    struct link link;
    struct link_report report = {.time_us = 0};
    struct random_stream random;
    sim_link_open(&sim, table, seed, &link);
    random_seed(&random, seed, 99);
    const double start_s = seconds();
    for (int64_t step = 0; step < SIMULATED_S * 1000; step++) {
        if (step % 1000 == 100) {
            const struct controller_command command = {.kind = COMMAND_BEND,
                                                       .bend_rad = 1.57f * (float)random_uniform(&random),
                                                       .direction_rad = 6.28f * (float)random_uniform(&random)};
            (void)link.send(link.context, &command);
        } else if (step % 100 == 0) {
            struct controller_command again = sim.app.controller.active;
            (void)link.send(link.context, &again);
        }
        (void)link.receive(link.context, &report);
    }
    const double used_s = seconds() - start_s;
    link.close(link.context);
    if (report.status.state != SUPERVISOR_ACTIVE) {
        fprintf(stderr, "bench_simulation: the run ended in %s\n", supervisor_state_name(report.status.state));
        exit(1);
    }
    return used_s;
}

int main(void) {
    struct table_file file;
    if (table_file_open(&file, "tables/paper-semicircle.tbt", NULL) != 0) {
        return 1;
    }
    double least_s = 0.0, sum_s = 0.0;
    for (uint64_t run = 0; run < RUNS; run++) {
        const double used_s = time_run(&file.table, run + 1);
        least_s = run == 0 || used_s < least_s ? used_s : least_s;
        sum_s += used_s;
    }
    printf("simulation             %8.0f simulated seconds per second (best of %d runs of %d s; mean %.0f)\n",
           SIMULATED_S / least_s, RUNS, SIMULATED_S, RUNS * SIMULATED_S / sum_s);
    table_file_close(&file);
    return 0;
}
