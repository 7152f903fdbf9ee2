/* `tribend gap close`: how far a calibration closes the gap, once simulation and controller know it. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/commands.h"
#include "gap/close.h"
#include "gap/report_file.h"

#define DEGREES (180.0 / M_PI)
#define SEEDS_DEFAULT 5
#define WORDS_BYTES 512

struct arguments {
    const char *log;
    const char *calibration;
    const char *table;
    const char *json;
    size_t seeds;
    bool quiet;
};

static const struct argp_option option_list[] = {
    {"calibration", 'k', "FILE", 0, "what tribend gap diagnose found (required)", 0},
    {"table", 't', "FILE", 0, "bend table of the nominal module (default $TRIBEND_TABLE, else the reference table)", 0},
    {"seeds", 's', "N", 0, "how many runs, each with noise of its own (default 5)", 0},
    {"json", 'j', "FILE", 0, "write the figures as JSON", 0},
    {"quiet", 'q', NULL, 0, "no summary", 0},
    {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 'k':
        arguments->calibration = argument;
        return 0;
    case 't':
        arguments->table = argument;
        return 0;
    case 's':
        arguments->seeds = (size_t)cli_whole_number(state, "--seeds", argument, 1, CLOSE_SEEDS_MAX);
        return 0;
    case 'j':
        arguments->json = argument;
        return 0;
    case 'q':
        arguments->quiet = true;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0) {
            argp_error(state, "one run log at a time, '%s' is too much", argument);
        }
        arguments->log = argument;
        return 0;
    case ARGP_KEY_END:
        if (arguments->log == NULL || arguments->calibration == NULL) {
            argp_error(state, "which run log, and which calibration? For example: run.csv --calibration found.yaml");
        }
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {
    option_list, parse, "RUN.csv",
    "Follow the command of RUN.csv again on a simulated module that is as the calibration says: with a controller that does "
    "not know the calibration (before) and with one that does (after), and on the nominal module (without gap). Errors are "
    "those of the true bend or the true pressures.\v"
    "Example: tribend gap close RUN.csv --calibration FOUND.yaml",
    NULL, NULL, NULL};

/* --- the figures --- */

struct quantity {
    enum close_quantity quantity;
    const char *name;
    const char *unit;
    double in_unit; /* of one in SI */
};

static const struct quantity quantities[] = {{CLOSE_BEND_RAD, "bend", "deg", DEGREES},
                                             {CLOSE_DIRECTION_RAD, "direction", "deg", DEGREES},
                                             {CLOSE_PRESSURE_PA, "pressure", "kPa", 1e-3}};
#define QUANTITIES (sizeof quantities / sizeof quantities[0])

static const char *const variant_names[CLOSE_VARIANTS] = {
    [CLOSE_BEFORE] = "before", [CLOSE_AFTER] = "after", [CLOSE_WITHOUT_GAP] = "without gap"};

static bool was_measured(const struct close_figure figure[CLOSE_VARIANTS]) {
    return figure[CLOSE_BEFORE].seeds > 0 || figure[CLOSE_AFTER].seeds > 0;
}

static void print_figure(const struct close_figure *figure, double in_unit) {
    if (figure->seeds == 0) {
        printf("  %17s", "-");
    } else {
        printf("  %8.3f +- %5.3f", in_unit * figure->mean, in_unit * figure->spread);
    }
}

static void print_row(const struct close_result *result, size_t feedback, size_t window, const struct quantity *quantity) {
    const struct close_figure *figure = result->figure[feedback][window][quantity->quantity];
    char label[64];
    if (!was_measured(figure)) {
        return;
    }
    (void)snprintf(label, sizeof label, "%s, %s%s", quantity->name, quantity->unit,
                   window == CLOSE_SETTLED ? ", settled" : "");
    printf("  %-25s", label);
    for (size_t v = 0; v < CLOSE_VARIANTS; v++) {
        print_figure(&figure[v], quantity->in_unit);
    }
    const double share = close_share(figure);
    if (isnan(share)) {
        printf("   no gap\n");
    } else {
        printf("  %6.1f %%\n", 100.0 * share);
    }
}

static void print_trouble(const struct close_result *result, size_t feedback) {
    char words[WORDS_BYTES];
    for (size_t v = 0; v < CLOSE_VARIANTS; v++) {
        if (result->never_ready[feedback][v]) {
            printf("  %s: the controller never came out of its self-test: a vented chamber seemed to be under pressure\n",
                   variant_names[v]);
        }
        if (result->faults[feedback][v] != 0u) {
            cli_describe_faults(result->faults[feedback][v], words, sizeof words);
            printf("  %s: the controller vented (%s); errors are those until then\n", variant_names[v], words);
        }
    }
}

static void print_feedback(const struct close_result *result, const struct close_recording *recording, size_t feedback) {
    const char *title = recording->kind == CLOSE_PRESSURE    ? "pressure loops"
                        : feedback == CLOSE_NO_TIP_SENSOR ? "without tip sensor"
                                                          : "with tip sensor";
    printf("%-27s  %17s  %17s  %17s   closed\n", title, "before", "after", "without gap");
    for (size_t q = 0; q < QUANTITIES; q++) {
        for (size_t window = 0; window < CLOSE_WINDOWS; window++) {
            print_row(result, feedback, window, &quantities[q]);
        }
    }
    print_trouble(result, feedback);
}

static void print_effects(const struct calibration *calibration) {
    for (size_t e = 0; e < calibration->effects; e++) {
        const struct effect *effect = &calibration->effect[e];
        printf(", %s", effect->kind->name);
        if (effect->chamber > 0) {
            printf(" of chamber %zu", effect->chamber);
        }
    }
}

static void print_report(const struct arguments *arguments, const struct close_recording *recording,
                         const struct calibration *calibration, const struct calibrated_controller *controller,
                         const struct close_result *result) {
    printf("module    %s: stiffness x %.4g, supply x %.4g", calibration->module, calibration->stiffness_scale,
           calibration->supply_scale);
    print_effects(calibration);
    printf("\ncommand   %s, %.1f s of %s, %zu seeds", recording->kind == CLOSE_BEND ? "bend and direction" : "pressures",
           1e-6 * (double)recording->duration_us, arguments->log, arguments->seeds);
    if (result->measured_from_s > recording->start_s) {
        printf(", measured from %.1f s on, when the last effect sets in", result->measured_from_s);
    }
    printf("\n");
    for (size_t i = 0; i < controller->notes; i++) {
        printf("note      %s\n", controller->note[i]);
    }
    printf("tracking  rms error, mean and spread over the seeds; settled: the command has stood for %.0f s\n",
           CLOSE_SETTLED_S);
    print_feedback(result, recording, CLOSE_TIP_SENSOR);
    if (recording->kind == CLOSE_BEND) {
        print_feedback(result, recording, CLOSE_NO_TIP_SENSOR);
    }
}

/* --- JSON --- */

static json_t *figure_json(const struct close_figure *figure, double in_unit) {
    return figure->seeds == 0 ? json_null()
                              : json_pack("{s:f,s:f,s:i}", "mean", in_unit * figure->mean, "spread",
                                          in_unit * figure->spread, "seeds", (int)figure->seeds);
}

static json_t *row_json(const struct close_result *result, const struct close_recording *recording, size_t feedback,
                        size_t window, const struct quantity *quantity) {
    const struct close_figure *figure = result->figure[feedback][window][quantity->quantity];
    const double share = close_share(figure), in_unit = quantity->in_unit;
    json_t *tip_sensor = recording->kind == CLOSE_PRESSURE ? json_null() : json_boolean(feedback == CLOSE_TIP_SENSOR);
    return json_pack("{s:s,s:s,s:s,s:o,s:o,s:o,s:o,s:o}", "quantity", quantity->name, "unit", quantity->unit, "window",
                     window == CLOSE_SETTLED ? "settled" : "whole", "tip_sensor", tip_sensor, "before",
                     figure_json(&figure[CLOSE_BEFORE], in_unit), "after", figure_json(&figure[CLOSE_AFTER], in_unit),
                     "without_gap", figure_json(&figure[CLOSE_WITHOUT_GAP], in_unit), "closed_fraction",
                     isnan(share) ? json_null() : json_real(share));
}

static json_t *trouble_json(const struct close_result *result) {
    json_t *list = json_array();
    char words[WORDS_BYTES];
    for (size_t f = 0; f < CLOSE_FEEDBACKS; f++) {
        for (size_t v = 0; v < CLOSE_VARIANTS; v++) {
            if (result->never_ready[f][v] || result->faults[f][v] != 0u) {
                cli_describe_faults(result->faults[f][v], words, sizeof words);
                json_array_append_new(list, json_pack("{s:s,s:b,s:b,s:s}", "run", variant_names[v], "tip_sensor",
                                                      f == CLOSE_TIP_SENSOR, "never_ready",
                                                      (int)result->never_ready[f][v], "faults", words));
            }
        }
    }
    return list;
}

static json_t *report_json(const struct arguments *arguments, const struct close_recording *recording,
                           const struct calibrated_controller *controller, const struct close_result *result) {
    json_t *rows = json_array(), *notes = json_array();
    for (size_t f = 0; f < CLOSE_FEEDBACKS; f++) {
        for (size_t q = 0; q < QUANTITIES; q++) {
            for (size_t window = 0; window < CLOSE_WINDOWS; window++) {
                if (was_measured(result->figure[f][window][quantities[q].quantity])) {
                    json_array_append_new(rows, row_json(result, recording, f, window, &quantities[q]));
                }
            }
        }
    }
    for (size_t i = 0; i < controller->notes; i++) {
        json_array_append_new(notes, json_string(controller->note[i]));
    }
    return json_pack("{s:s,s:s,s:s,s:s,s:f,s:f,s:i,s:o,s:o,s:o}", "log", arguments->log, "calibration",
                     arguments->calibration, "module", controller->table.table.module.name, "command",
                     recording->kind == CLOSE_BEND ? "bend" : "pressure", "duration_s",
                     1e-6 * (double)recording->duration_us, "measured_from_s", result->measured_from_s, "seeds",
                     (int)arguments->seeds, "tracking", rows, "trouble", trouble_json(result), "notes", notes);
}

static int write_json(const struct arguments *arguments, json_t *report) {
    char error[PROGRAM_ERROR_BYTES];
    const bool written = report_file_write(report, arguments->json, error, sizeof error);
    return written ? EXIT_OK : program_fail(EXIT_OUTPUT, "%s", error);
}

/* --- the course of it --- */

static int follow(const struct arguments *arguments, const struct close_recording *recording,
                  const struct bend_table *table, const struct calibration *calibration) {
    static struct calibrated_controller controller;
    static struct close_result result;
    char error[PROGRAM_ERROR_BYTES];
    int code = EXIT_OK;
    if (!calibrated_controller_make(&controller, calibration, table, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s: %s", arguments->calibration, error);
    }
    if (!close_run(&result, recording, table, calibration, &controller, arguments->seeds, error, sizeof error)) {
        code = program_fail(EXIT_SOLVER, "%s", error);
    } else {
        if (!arguments->quiet) {
            print_report(arguments, recording, calibration, &controller, &result);
        }
        if (arguments->json != NULL) {
            code = write_json(arguments, report_json(arguments, recording, &controller, &result));
        }
    }
    calibrated_controller_free(&controller);
    return code;
}

static int check_and_follow(const struct arguments *arguments, const struct close_recording *recording,
                            const char *table_path, const struct bend_table *table) {
    static struct calibration calibration;
    char error[PROGRAM_ERROR_BYTES];
    if (recording->module[0] != '\0' && strcmp(recording->module, table->module.name) != 0) {
        return program_fail(EXIT_BAD_INPUT,
                            "%s is of module %s, but the table %s is of module %s: give that module's table with --table",
                            arguments->log, recording->module, table_path, table->module.name);
    }
    if (!calibration_read(arguments->calibration, table->module.name, &calibration, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    return follow(arguments, recording, table, &calibration);
}

int gap_close_run(int argc, char **argv) {
    struct arguments arguments = {.seeds = SEEDS_DEFAULT};
    struct close_recording recording;
    struct table_file file;
    char error[PROGRAM_ERROR_BYTES], found[PROGRAM_PATH_BYTES];
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    int code = cli_check_outputs(&arguments.json, 1);
    if (code != EXIT_OK) {
        return code;
    }
    if (!close_recording_read(&recording, arguments.log, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    const char *path = bus_table_path(arguments.table, found);
    code = table_file_open(&file, path, NULL);
    if (code == EXIT_OK) {
        code = check_and_follow(&arguments, &recording, path, &file.table);
        table_file_close(&file);
    }
    close_recording_free(&recording);
    return code;
}
