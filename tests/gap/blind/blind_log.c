#include "blind_log.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define STEPS_A_PERIOD (BLIND_PERIOD_US / BLIND_STEP_US)

/* Rows: each arrival of a tip sample, more at random up to the rate, and at least one inside every PWM period, so that
 * the duty of each period stands in a row before it starts. */
static void choose_rows(const struct blind_record *record, const struct blind_log_form *form, struct blind_random *random,
                        bool *row) {
    const double seconds = 1e-6 * BLIND_STEP_US * (double)record->steps;
    const double more_hz = form->rate_hz - (double)record->tips / seconds;
    row[0] = row[record->steps] = true;
    for (size_t i = 0; i < record->tips; i++) {
        row[record->tip[i].step] = true;
    }
    for (double at_s = 0.0; more_hz > 1.0 && at_s < seconds; at_s += blind_uniform(random, 0.6, 1.4) / more_hz) {
        row[(size_t)(at_s * 1e6 / BLIND_STEP_US)] = true;
    }
    for (size_t start = 0; start < record->steps; start += STEPS_A_PERIOD) {
        bool any = false;
        for (size_t i = start + 1; i < start + STEPS_A_PERIOD; i++) {
            any = any || row[i];
        }
        row[start + 1 + blind_below(random, STEPS_A_PERIOD - 1)] |= !any;
    }
}

static void write_header(FILE *file, const struct bend_table_module *module, const struct blind_log_form *form) {
    fprintf(file, "# tribend-run 1\n# module: %s\n# table: %016" PRIx64 "\n# rate: %.4g Hz\n# note: recorded run\n",
            module->name, module->inputs_hash, form->rate_hz);
    fputs("time_s,valve1,valve2,valve3,p1_cmd_pa,p2_cmd_pa,p3_cmd_pa,p1_pa,p2_pa,p3_pa", file);
    fputs(form->supply ? ",supply_pa" : "", file);
    fputs(",tip_x_m,tip_y_m,tip_z_m", file);
    fputs(form->orientation ? ",tip_qw,tip_qx,tip_qy,tip_qz" : "", file);
    fputs(",tip_quality,tip_status", file);
    fputs(form->temperature ? ",temperature_k" : "", file);
    fputs(",state\n", file);
}

static void write_tip(FILE *file, const struct blind_tip *tip, const struct blind_log_form *form) {
    if (tip == NULL) {
        fputs(form->orientation ? ",,,,,,,,," : ",,,,,", file);
        return;
    }
    fprintf(file, ",%.7g,%.7g,%.7g", tip->position_m[0], tip->position_m[1], tip->position_m[2]);
    if (form->orientation) {
        fprintf(file, ",%.9g,%.9g,%.9g,%.9g", tip->quaternion[0], tip->quaternion[1], tip->quaternion[2],
                tip->quaternion[3]);
    }
    fputs(",100,0", file);
}

static void write_row(FILE *file, const struct blind_record *record, size_t at, const struct blind_tip *tip,
                      const struct blind_log_form *form) {
    const struct blind_step *step = &record->step[at];
    const double *duty = record->duty[(at + STEPS_A_PERIOD - 1) / STEPS_A_PERIOD]; /* of the period that starts at or after */
    fprintf(file, "%.6f,%.6g,%.6g,%.6g", 1e-6 * BLIND_STEP_US * (double)at, duty[0], duty[1], duty[2]);
    for (size_t c = 0; c < 3; c++) {
        if (isnan(step->target_pa[c])) {
            fputc(',', file);
        } else {
            fprintf(file, ",%.8g", step->target_pa[c]);
        }
    }
    fprintf(file, ",%.8g,%.8g,%.8g", step->reading_pa[0], step->reading_pa[1], step->reading_pa[2]);
    if (form->supply) {
        fprintf(file, ",%.6g", step->supply_pa);
    }
    write_tip(file, tip, form);
    if (form->temperature) {
        fprintf(file, ",%.6g", step->temperature_k);
    }
    fprintf(file, ",%s\n", supervisor_state_name(step->state));
}

bool blind_log_write(const char *path, const struct bend_table_module *module, const struct blind_record *record,
                     const struct blind_log_form *form, struct blind_random *random) {
    bool *row = calloc(record->steps + STEPS_A_PERIOD, sizeof *row);
    FILE *file = row == NULL ? NULL : fopen(path, "w");
    size_t next = 0;
    if (file == NULL) {
        free(row);
        return false;
    }
    choose_rows(record, form, random, row);
    write_header(file, module, form);
    for (size_t i = 0; i <= record->steps; i++) {
        while (next < record->tips && record->tip[next].step < i) {
            next++;
        }
        const bool arrives = next < record->tips && record->tip[next].step == i;
        if (row[i]) {
            write_row(file, record, i, arrives ? &record->tip[next] : NULL, form);
        }
    }
    free(row);
    const bool written = ferror(file) == 0;
    return fclose(file) == 0 && written;
}
