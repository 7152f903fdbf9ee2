/* tribend-tables show: what a bend table holds. */
#include <argp.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "cli/cli.h"
#include "program/table_file.h"
#include "control/bend_table_format.h"

#define DEGREES (180.0 / M_PI)

struct arguments {
    const char *path;
    const char *module;
};

static const struct argp_option options[] = {
    {"module", 'm', "NAME", 0, "refuse a table of another module", 0}, {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 'm':
        arguments->module = argument;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0) {
            argp_error(state, "one table at a time, '%s' is too much", argument);
        }
        arguments->path = argument;
        return 0;
    case ARGP_KEY_NO_ARGS:
        argp_error(state, "which FILE.tbt?");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "FILE.tbt", "Print what a bend table holds.\vExample: tribend-tables show TABLE.tbt", NULL, NULL, NULL};

static void print_tags(const struct bend_table *table) {
    static const struct {
        unsigned bit;
        const char *name;
    } tags[] = {{BEND_TABLE_TAG_VALID, "valid"},
                {BEND_TABLE_TAG_STABLE, "stable"},
                {BEND_TABLE_TAG_MIRRORED, "mirrored or turned from a solved node"},
                {BEND_TABLE_TAG_EXTRAPOLATED, "without an equilibrium (filled)"},
                {BEND_TABLE_TAG_BEYOND_STRAIN, "stretched beyond the material's fitted range"},
                {BEND_TABLE_TAG_CONTACT, "with chamber walls in contact"}};
    const size_t count = (size_t)table->nodes[0] * table->nodes[1] * table->nodes[2];
    printf("nodes            %u x %u x %u = %zu\n", table->nodes[0], table->nodes[1], table->nodes[2], count);
    for (size_t t = 0; t < sizeof tags / sizeof tags[0]; t++) {
        size_t tagged = 0;
        for (size_t i = 0; i < count; i++) {
            tagged += (table->tag[i] & tags[t].bit) != 0;
        }
        printf("                 %5zu %s\n", tagged, tags[t].name);
    }
}

static void print_ranges(const struct bend_table *table) {
    const size_t count = (size_t)table->nodes[0] * table->nodes[1] * table->nodes[2];
    const char *text = BEND_TABLE_CHANNEL_TEXT;
    for (size_t c = 0; c < BEND_TABLE_CHANNEL_COUNT; c++) {
        char name[32], unit[16];
        int used = 0;
        float least = table->channel[c][0], most = least;
        for (size_t i = 1; i < count; i++) {
            least = fminf(least, table->channel[c][i]);
            most = fmaxf(most, table->channel[c][i]);
        }
        if (sscanf(text, "%31s %15s\n%n", name, unit, &used) == 2) {
            printf("%-16s %12.5g to %12.5g %s\n", name, (double)least, (double)most, unit);
        }
        text += used;
    }
}

static void print_bends(const struct bend_table *table) {
    printf("bend of chamber 1 alone\n");
    for (uint32_t i = 0; i < table->nodes[0]; i++) {
        const float pressure_pa[3] = {table->axis_pa[0][i], 0.0f, 0.0f};
        struct bend_table_stencil stencil;
        bend_table_locate(table, pressure_pa, &stencil);
        const double x = (double)bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_X);
        const double y = (double)bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_Y);
        printf("  %9.1f Pa %8.3f deg\n", (double)pressure_pa[0],
               hypot(x, y) * (double)table->module.active_length_m * DEGREES);
    }
}

/* The greatest and the least pressure, and the states of one chamber alone between and beyond, by its volume. */
static void print_snap(const struct bend_table *table) {
    const struct bend_table_module *module = &table->module;
    struct bend_table ballooned;
    if (module->jump_up_pa == 0.0f) {
        printf("snap             none up to the end of the axes\n");
        return;
    }
    printf("snap             chamber 1 alone balloons at %.0f Pa; ", (double)module->jump_up_pa);
    if (module->jump_down_pa > 0.0f) {
        printf("it falls back at %.0f Pa\n", (double)module->jump_down_pa);
    } else {
        printf("no second stable branch up to where the model holds\n");
    }
    if (!bend_table_ballooned(table, &ballooned)) {
        return;
    }
    for (uint32_t v = 0; v < ballooned.nodes[0]; v++) {
        const size_t at = (size_t)v * ballooned.nodes[1] * ballooned.nodes[2];
        const double x = (double)ballooned.channel[BEND_TABLE_CURVATURE_X][at];
        const double y = (double)ballooned.channel[BEND_TABLE_CURVATURE_Y][at];
        printf("  %9.1f Pa %8.3f deg, chamber 1 holds %.2f ml, %s%s\n", (double)ballooned.channel[BEND_TABLE_PRESSURE_1][at],
               hypot(x, y) * (double)module->active_length_m * DEGREES,
               1e6 * (double)ballooned.axis_pa[0][v] * (double)module->chamber_length_m,
               (ballooned.tag[at] & (unsigned)BEND_TABLE_TAG_STABLE) != 0 ? "stable" : "unstable",
               (ballooned.tag[at] & (unsigned)BEND_TABLE_TAG_BEYOND_STRAIN) != 0 ? ", beyond fit" : "");
    }
}

int cli_show(int argc, char **argv) {
    struct arguments arguments = {NULL, NULL};
    struct table_file file;
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    const int code = table_file_open(&file, arguments.path, arguments.module);
    if (code != EXIT_OK) {
        return code;
    }
    const struct bend_table_module *module = &file.table.module;
    printf("module           %s (inputs %016" PRIx64 ")\n", module->name, module->inputs_hash);
    printf("geometry         %.2f mm across, chambers %.2f mm, active length %.2f mm, caps %.2f and %.2f mm\n",
           1e3 * (double)module->outer_diameter_m, 1e3 * (double)module->chamber_length_m,
           1e3 * (double)module->active_length_m, 1e3 * (double)module->cap_proximal_m,
           1e3 * (double)module->cap_distal_m);
    printf("limits           working %.0f Pa, burst %.0f Pa, bend %.1f deg\n", (double)module->working_pressure_pa,
           (double)module->burst_pressure_pa, (double)module->bend_limit_rad * DEGREES);
    printf("image            %zu bytes, version %u, CRC-32 sound\n", file.size, BEND_TABLE_VERSION);
    print_tags(&file.table);
    print_ranges(&file.table);
    print_bends(&file.table);
    print_snap(&file.table);
    table_file_close(&file);
    return EXIT_OK;
}
