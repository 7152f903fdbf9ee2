#include "report/run_summary.h"

#include <math.h>
#include <string.h>

void run_summary_start(struct run_summary *summary, const struct controller_command *command, int64_t start_us,
                       int64_t end_us) {
    memset(summary, 0, sizeof *summary);
    summary->command = *command;
    summary->start_us = start_us;
    summary->end_us = end_us;
    summary->last_outside_us = start_us;
    summary->last_inside_us = -1;
}

static void note_band(struct run_summary *summary, int64_t time_us, bool inside) {
    if (inside) {
        summary->last_inside_us = time_us;
    } else {
        summary->last_outside_us = time_us;
    }
}

static void add_bend(struct run_summary *summary, const struct link_report *report, bool in_window) {
    const double bend = (double)report->status.bend_rad, direction = (double)report->status.direction_rad;
    const double wanted_bend = (double)summary->command.bend_rad;
    const double wanted_direction = (double)summary->command.direction_rad;
    const double turn = remainder(direction - wanted_direction, 2.0 * M_PI);
    const double error_x = bend * cos(turn) - wanted_bend, error_y = bend * sin(turn);
    const double step_us = (double)(report->time_us - summary->smoothed_us);
    const double share = summary->samples_seen == 0 ? 1.0 : step_us / (step_us + RUN_SUMMARY_SMOOTHING_US);
    summary->samples_seen++;
    summary->smoothed_us = report->time_us;
    summary->smoothed_error_rad[0] += share * (error_x - summary->smoothed_error_rad[0]);
    summary->smoothed_error_rad[1] += share * (error_y - summary->smoothed_error_rad[1]);
    note_band(summary, report->time_us,
              hypot(summary->smoothed_error_rad[0], summary->smoothed_error_rad[1]) <= RUN_SUMMARY_BEND_BAND_RAD);
    if (in_window) {
        summary->samples++;
        summary->bend_sum_rad += bend;
        summary->bend_square_rad2 += (bend - wanted_bend) * (bend - wanted_bend);
        summary->direction_sum_rad += turn;
        summary->direction_square_rad2 += turn * turn;
    }
}

static void add_pressures(struct run_summary *summary, const struct link_report *report, bool in_window) {
    bool inside = true;
    summary->pressure_samples += in_window ? 1u : 0u;
    for (size_t c = 0; c < 3; c++) {
        const double pressure_pa = (double)report->pressure_pa[c];
        const double error_pa = pressure_pa - (double)report->status.pressure_target_pa[c];
        summary->pressure_most_pa = fmax(summary->pressure_most_pa, pressure_pa);
        if (in_window) {
            summary->pressure_sum_pa[c] += pressure_pa;
            summary->pressure_square_pa2[c] += error_pa * error_pa;
        }
        /* the estimate: a single sample's noise is a quarter of the band */
        inside = inside && fabs((double)report->status.pressure_estimate_pa[c] -
                                (double)report->status.pressure_target_pa[c]) <= RUN_SUMMARY_PRESSURE_BAND_PA;
    }
    if (summary->command.kind == COMMAND_PRESSURE) {
        note_band(summary, report->time_us, inside);
    }
}

void run_summary_add(struct run_summary *summary, const struct link_report *report) {
    const bool in_window = report->time_us > summary->end_us - RUN_SUMMARY_WINDOW_US;
    if (report->time_us < summary->start_us || report->time_us > summary->end_us) {
        return;
    }
    add_pressures(summary, report, in_window);
    if (summary->command.kind == COMMAND_BEND && (report->tip_new || !report->status.bend_is_measured)) {
        add_bend(summary, report, in_window);
    }
}

double run_summary_settling_s(const struct run_summary *summary) {
    return summary->last_inside_us > summary->last_outside_us
               ? 1e-6 * (double)(summary->last_outside_us - summary->start_us)
               : -1.0;
}
