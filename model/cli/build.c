/* tribend-tables build: a module's bend table, with a progress bar. */
#include <argp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>


#include "cli/cli.h"
#include "description/calibration_file.h"
#include "table/table_builder.h"


struct arguments {
    const char *module;
    const char *material;
    const char *calibration;
    const char *output;
    struct table_build_options build;
    bool quiet;
    bool resume;
};

static const struct argp_option options[] = {
    {"output", 'o', "FILE", 0, "the table to write (default MODULE.tbt)", 0},
    {"material", 'm', "NAME", 0, "a material from tables/materials, or the path of a YAML file", 0},
    {"calibration", 'c', "FILE", 0, "scale every stiffness as `tribend gap diagnose` found it", 0},
    {"nodes", 'n', "COUNT", 0, "nodes on each pressure axis, 4 to 32 (default 17)", 0},
    {"mesh-size", 's', "LENGTH", 0, "element size at chamber walls (default 0.75mm)", 0},
    {"resume", 'r', NULL, 0, "keep finished slabs in FILE.points, and go on from those that are there", 0},
    {"quiet", 'q', NULL, 0, "no progress", 0},
    {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    char *end = NULL;
    switch (key) {
    case 'o':
        arguments->output = argument;
        return 0;
    case 'm':
        arguments->material = argument;
        return 0;
    case 'c':
        arguments->calibration = argument;
        return 0;
    case 'n':
        arguments->build.nodes = strtoul(argument, &end, 10);
        if (end == argument || *end != '\0' || arguments->build.nodes < 4 || arguments->build.nodes > 32) {
            argp_error(state, "--nodes: '%s' is not a number from 4 to 32", argument);
        }
        return 0;
    case 's':
        cli_mesh_size(state, argument, &arguments->build.size_m);
        return 0;
    case 'q':
        arguments->quiet = true;
        return 0;
    case 'r':
        arguments->resume = true;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0) {
            argp_error(state, "one module at a time, '%s' is too much", argument);
        }
        arguments->module = argument;
        return 0;
    case ARGP_KEY_NO_ARGS:
        argp_error(state, "which MODULE? For example paper-semicircle");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "MODULE",
                                   "Build the bend table of MODULE (a name from tables/modules or a YAML file), on "
                                   "every core of this machine, or with mpirun -n RANKS on many machines.\v"
                                   "Example: tribend-tables build paper-semicircle -o paper-semicircle.tbt",
                                   NULL, NULL, NULL};

static double seconds(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double peak_memory_mib(void) {
    struct rusage usage;
    return getrusage(RUSAGE_SELF, &usage) == 0 ? (double)usage.ru_maxrss / 1024.0 : 0.0;
}

/* Of a calibration only the stiffness enters a table; what else it holds is the simulation's and the controller's. */
static bool calibrate(const struct arguments *arguments, struct module_description *module, bool first_rank,
                      struct description_error *error) {
    if (arguments->calibration == NULL) {
        return true;
    }
    struct calibration_file *file = calibration_file_read(arguments->calibration, module->name, error);
    if (file == NULL) {
        return false;
    }
    const double scale = file->stiffness_scale.value;
    module_description_stiffen(module, scale);
    if (first_rank) {
        printf("stiffness x %.4g by %s; do not give this calibration together with the table again\n", scale,
               arguments->calibration);
    }
    calibration_file_free(file);
    return true;
}

static int run(struct arguments *arguments, bool first_rank) {
    char path[PROGRAM_PATH_BYTES], message[PROGRAM_ERROR_BYTES], output[PROGRAM_PATH_BYTES];
    char keep[PROGRAM_PATH_BYTES + 8];
    struct module_description module;
    struct description_error error;
    struct table_image image;
    struct cli_progress progress = {.what = "equilibria"};
    cli_table_path("modules", arguments->module, path);
    if (!module_description_read(path, arguments->material, &module, &error) ||
        !calibrate(arguments, &module, first_rank, &error)) {
        return first_rank ? program_fail(EXIT_BAD_INPUT, "%s", error.text) : EXIT_BAD_INPUT;
    }
    (void)snprintf(output, sizeof output, "%s%s", arguments->output != NULL ? arguments->output : module.name,
                   arguments->output != NULL ? "" : ".tbt");
    (void)snprintf(keep, sizeof keep, "%s.points", output);
    if (first_rank) {
        cli_print_material(&module.material);
        (void)fflush(stdout);
    }
    program_catch_interrupt();
    arguments->build.stop = &program_interrupted;
    arguments->build.progress = arguments->quiet || !first_rank ? NULL : cli_show_progress;
    arguments->build.context = &progress;
    arguments->build.keep_path = arguments->resume ? keep : NULL;
    const double start_s = seconds();
    const enum sweep_outcome outcome = table_build(&module, &arguments->build, &image, &error);
    if (outcome == SWEEP_HELPED) {
        return EXIT_OK;
    }
    if (outcome != SWEEP_DONE) {
        return program_fail(outcome == SWEEP_STOPPED ? EXIT_INTERRUPTED : EXIT_SOLVER, "%s", error.text);
    }
    const bool written = table_image_write(&image, output, message, sizeof message);
    if (written) {
        printf("table     %s: %zu nodes from %zu equilibria (%zu without), %zu bytes, %.1f s, peak memory %.0f MiB", output,
               image.nodes, image.solved, image.no_equilibrium, image.size, seconds() - start_s, peak_memory_mib());
        if (sweep_ranks() > 1) {
            printf(" on %zu ranks", sweep_ranks());
        }
        putchar('\n');
    }
    table_image_free(&image);
    return written ? EXIT_OK : program_fail(EXIT_OUTPUT, "%s", message);
}

int cli_build(int argc, char **argv) {
    struct arguments arguments = {.module = NULL};
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    const bool first_rank = sweep_join();
    const int code = run(&arguments, first_rank);
    sweep_leave();
    return code;
}
