/* blind_generate: writes a corpus of blind cases, two run logs each, and the sealed truth beside them; or, for the truth of a
 * case and a plan, what the same plant shows when the plan is followed. */
#include <argp.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "blind_next.h"
#include "blind_plan.h"
#include "blind_truth.h"

#define PATH_BYTES 4096
#define ERROR_BYTES 4352

struct arguments {
    uint64_t seed;
    const char *corpus;
    size_t first;
    size_t count;
    const char *truth;
    const char *plan;
    const char *table;
    const char *module;
    const char *out;
    double seconds;
};

static const struct argp_option options[] = {
    {"seed", 's', "N", 0, "the same seed gives the same bytes (default 1)", 0},
    {"corpus", 'c', "NAME", 0,
     "single, local, pair, unknown, ablation, nogap, recalibrate, geometry, confounded or mixed (default single)", 0},
    {"count", 'n', "K", 0, "cases (default 1)", 0},
    {"first", 'f', "I", 0, "number of the first case (default 0)", 0},
    {"truth", 'T', "FILE", 0, "the case of this truth once more, with --plan", 1},
    {"plan", 'p', "PLAN.yaml", 0, "follow it: writes OUT/planned/ID.csv, and OUT/random/ID.csv of the same length", 1},
    {"table", 't', "FILE", 0, "bend table of the module", 0},
    {"module", 'm', "NAME", 0, "the module that the table must be of", 0},
    {"seconds", 'd', "SECONDS", 0, "length of each run (default 30)", 0},
    {"out", 'o', "DIR", 0, "folder that gets logs/ and truth/", 0},
    {0}};

static double read_number(struct argp_state *state, const char *text, double least, double most) {
    char *end = NULL;
    const double value = strtod(text, &end);
    if (end == text || *end != '\0' || !(value >= least) || !(value <= most)) {
        argp_error(state, "'%s' is not a number from %g to %g", text, least, most);
    }
    return value;
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 's':
        arguments->seed = (uint64_t)read_number(state, argument, 0.0, 1e15);
        return 0;
    case 'c':
        arguments->corpus = blind_corpus_find(argument);
        if (arguments->corpus == NULL) {
            argp_error(state, "there is no corpus '%s'", argument);
        }
        return 0;
    case 'n':
        arguments->count = (size_t)read_number(state, argument, 0.0, 1e6);
        return 0;
    case 'f':
        arguments->first = (size_t)read_number(state, argument, 0.0, 1e6);
        return 0;
    case 'T':
        arguments->truth = argument;
        return 0;
    case 'p':
        arguments->plan = argument;
        return 0;
    case 't':
        arguments->table = argument;
        return 0;
    case 'm':
        arguments->module = argument;
        return 0;
    case 'd':
        arguments->seconds = read_number(state, argument, 5.0, 600.0);
        return 0;
    case 'o':
        arguments->out = argument;
        return 0;
    case ARGP_KEY_END:
        if (arguments->table == NULL || arguments->out == NULL) {
            argp_error(state, "--table and --out are wanted");
        }
        if ((arguments->truth == NULL) != (arguments->plan == NULL)) {
            argp_error(state, "--truth and --plan go together");
        }
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "", "Writes blind cases for the check of the diagnosis.", NULL, NULL, NULL};

static unsigned char *read_file(const char *path, size_t *size) {
    FILE *file = fopen(path, "rb");
    struct stat status;
    if (file == NULL || fstat(fileno(file), &status) != 0) {
        return NULL;
    }
    unsigned char *bytes = malloc((size_t)status.st_size + 1);
    *size = bytes != NULL ? fread(bytes, 1, (size_t)status.st_size, file) : 0;
    (void)fclose(file);
    return bytes;
}

static bool make_folder(const char *folder, const char *below) {
    char path[PATH_BYTES];
    (void)snprintf(path, sizeof path, "%s%s%s", folder, *below != '\0' ? "/" : "", below);
    return mkdir(path, 0777) == 0 || errno == EEXIST;
}

static bool write_case(const struct blind_case *blind, const struct bend_table *table, const char *out) {
    char path[PATH_BYTES];
    for (size_t r = 0; r < BLIND_RUNS; r++) {
        struct blind_random random;
        blind_random_open(&random, blind->rig[r].seed, "rows", r);
        (void)snprintf(path, sizeof path, "%s/logs/%s-%zu.csv", out, blind->id, r + 1);
        if (!blind_log_write(path, &table->module, &blind->record[r], &blind->form, &random)) {
            return false;
        }
    }
    (void)snprintf(path, sizeof path, "%s/truth/%s.json", out, blind->id);
    return blind_truth_write(path, blind);
}

static int generate(const struct arguments *arguments, const struct bend_table *table) {
    static struct blind_case blind;
    struct blind_field field;
    int failed = blind_field_open(&field, table) ? 0 : 1;
    for (size_t i = arguments->first; i < arguments->first + arguments->count && failed == 0; i++) {
        const struct blind_draw draw = {arguments->seed, arguments->corpus, i, arguments->seconds};
        if (!blind_case_open(&blind, &field, &draw)) {
            (void)fprintf(stderr, "blind_generate: case %zu of %s: no draw fitted the module, or out of memory\n", i,
                          arguments->corpus);
            failed = 4;
        } else if (!write_case(&blind, table, arguments->out)) {
            (void)fprintf(stderr, "blind_generate: %s: %s\n", arguments->out, strerror(errno));
            failed = 5;
        }
        blind_case_close(&blind);
    }
    blind_field_close(&field);
    return failed;
}

/* --- once more --- */

static bool write_next(const struct blind_case *blind, const struct bend_table *table, const struct blind_record *record,
                       const char *folder, const char *out) {
    char path[PATH_BYTES];
    struct blind_random random;
    blind_random_open(&random, blind->rig[0].seed, folder, 1);
    (void)snprintf(path, sizeof path, "%s/%s/%s.csv", out, folder, blind->id);
    return make_folder(out, folder) && blind_log_write(path, &table->module, record, &blind->form, &random);
}

static int run_next(const struct arguments *arguments, const struct bend_table *table, struct blind_case *blind,
                    struct blind_field *field, const struct blind_excitation *plan, double seconds) {
    struct blind_record planned = {0}, random = {0};
    int failed = 0;
    if (!blind_next_planned(blind, field, plan, seconds, &planned) || !blind_next_random(blind, field, seconds, &random)) {
        (void)fprintf(stderr, "blind_generate: %s: the plant failed under %s, or out of memory\n", arguments->truth, arguments->plan);
        failed = 4;
    } else if (!write_next(blind, table, &planned, "planned", arguments->out) ||
               !write_next(blind, table, &random, "random", arguments->out)) {
        (void)fprintf(stderr, "blind_generate: %s: %s\n", arguments->out, strerror(errno));
        failed = 5;
    }
    blind_record_close(&planned);
    blind_record_close(&random);
    return failed;
}

/* The case is drawn again from what its truth says it was drawn from: the same seed gives the same plant. */
static int generate_next(const struct arguments *arguments, const struct bend_table *table) {
    static struct blind_case blind;
    struct blind_field field;
    struct blind_draw draw;
    struct blind_excitation plan;
    double seconds = 0.0;
    char id[BLIND_ID_BYTES], error[ERROR_BYTES];
    if (!blind_truth_read(arguments->truth, &draw, id, error, sizeof error) ||
        !blind_plan_open(arguments->plan, &plan, &seconds, error, sizeof error)) {
        (void)fprintf(stderr, "blind_generate: %s\n", error);
        return 3;
    }
    int failed = blind_field_open(&field, table) ? 0 : 4;
    if (failed == 0 && (!blind_case_open(&blind, &field, &draw) || strcmp(blind.id, id) != 0)) {
        (void)fprintf(stderr, "blind_generate: %s: its case cannot be drawn again: was it made with another table?\n", arguments->truth);
        failed = 4;
    } else if (failed == 0) {
        failed = run_next(arguments, table, &blind, &field, &plan, seconds);
    }
    blind_case_close(&blind);
    blind_field_close(&field);
    blind_excitation_close(&plan);
    return failed;
}

int main(int argc, char **argv) {
    struct arguments arguments = {.seed = 1, .corpus = "single", .count = 1, .seconds = 30.0};
    struct bend_table table;
    size_t size = 0;
    (void)argp_parse(&parser, argc, argv, 0, NULL, &arguments);
    unsigned char *bytes = read_file(arguments.table, &size);
    const enum bend_table_status status =
        bytes == NULL ? BEND_TABLE_TOO_SHORT : bend_table_open(&table, bytes, size, arguments.module);
    if (status != BEND_TABLE_OK) {
        (void)fprintf(stderr, "blind_generate: %s: %s\n", arguments.table, bend_table_status_text(status));
        free(bytes);
        return 3;
    }
    const bool next = arguments.truth != NULL;
    if (!make_folder(arguments.out, "") ||
        (!next && (!make_folder(arguments.out, "logs") || !make_folder(arguments.out, "truth")))) {
        (void)fprintf(stderr, "blind_generate: %s: %s\n", arguments.out, strerror(errno));
        free(bytes);
        return 5;
    }
    const int code = next ? generate_next(&arguments, &table) : generate(&arguments, &table);
    free(bytes);
    return code;
}
