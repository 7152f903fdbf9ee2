/* The fault campaign: every fault, alone and in pairs, at random times of random missions, with and without what a lab can
 * fit to its air. Prints tables, writes a row a trial. Options in --help. */
#include <argp.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "campaign/emulated.h"
#include "campaign/series.h"
#include "campaign/tally.h"
#include "program/program.h"
#include "program/table_file.h"

#define TABLE "tables/paper-semicircle.tbt"
#define FITTING_SHARE 20 /* each fitting is tried with so much of the trials */

struct options {
    size_t missions;
    size_t emulated;
    const char *elf;
    uint64_t seed;
    const char *only;
    const char *csv;
};

struct fitting {
    const char *name;
    bool no_shut_off;
    bool shut_off_vents;
    double relief_share;        /* of the working pressure; 0: none */
    double supply_relief_share; /* of the nominal supply */
};

static const struct fitting fittings[] = {
    {"shut-off valve (nominal)", false, false, 0.0, 0.0},
    {"nothing", true, false, 0.0, 0.0},
    {"relief on each chamber", true, false, 1.05, 0.0},
    {"relief on the supply", true, false, 0.0, 1.2},
    {"shut-off, relief on each chamber", false, false, 1.05, 0.0},
    {"shut-off, relief on the supply", false, false, 0.0, 1.2},
    {"shut-off that vents the rail", false, true, 0.0, 0.0},
    {"the last, and both reliefs", false, true, 1.05, 1.2},
};

static const struct argp_option option_list[] = {
    {"missions", 'n', "N", 0, "how many in all (10000)", 0},
    {"seed", 's', "SEED", 0, "of everything (1)", 0},
    {"fault", 'f', "TEXT", 0, "only what has TEXT in its name or in its row of faults.def", 0},
    {"emulated", 'e', "N", 0, "so many more on the emulated board (0)", 0},
    {"elf", 'E', "FILE", 0, "what the emulated board runs (build/firmware/tribend.elf)", 0},
    {"csv", 'o', "FILE", 0, "a row a trial", 0},
    {0}};

static bool whole(const char *text, uint64_t *value) {
    char *end = NULL;
    errno = 0;
    *value = strtoull(text, &end, 10);
    return errno == 0 && end != text && *end == '\0' && *text != '-';
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct options *options = state->input;
    uint64_t value = 0;
    switch (key) {
    case 'n':
        if (!whole(argument, &value) || value == 0 || value > 10000000) {
            argp_error(state, "missions '%s': a whole number from 1 to 10000000 is wanted", argument);
        }
        options->missions = (size_t)value;
        return 0;
    case 's':
        if (!whole(argument, &options->seed)) {
            argp_error(state, "seed '%s': a whole number is wanted", argument);
        }
        return 0;
    case 'f':
        options->only = *argument != '\0' ? argument : NULL;
        return 0;
    case 'e':
        if (!whole(argument, &value) || value > 100000) {
            argp_error(state, "emulated '%s': a whole number from 0 to 100000 is wanted", argument);
        }
        options->emulated = (size_t)value;
        return 0;
    case 'E':
        options->elf = argument;
        return 0;
    case 'o':
        options->csv = argument;
        return 0;
    case ARGP_KEY_ARG:
        argp_error(state, "there is no argument '%s'", argument);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {option_list, parse, "", "Break the simulated board and plant, and see what happens.",
                                   NULL, NULL, NULL};

static struct plant_parameters plant_of(const struct fitting *fitting, const struct bend_table *table) {
    struct plant_parameters plant;
    plant_default_parameters(&plant);
    plant.no_shut_off = fitting->no_shut_off;
    plant.shut_off_vents = fitting->shut_off_vents;
    plant.relief_pa = fitting->relief_share * (double)table->module.working_pressure_pa;
    plant.supply_relief_pa = fitting->supply_relief_share * plant.supply_pa;
    return plant;
}

static const char *name_of(size_t injection) {
    return injection != TRIAL_NONE ? injection_at(injection)->name : "";
}

static void write_rows(FILE *file, const char *fitting, const struct series *series, const struct trial_result *result,
                       const bool *done) {
    static const char *const ends[TRIAL_END_COUNT] = {"latched", "warned", "harmless", "undetected"};
    for (size_t i = 0; i < series->trials; i++) {
        struct trial trial;
        const struct oracle *oracle = &result[i].oracle;
        if (!done[i]) {
            continue;
        }
        series_trial(series, i, &trial);
        fprintf(file, "%s,%llu,%s,%s,%zu,%zu,%lld,%lld,%s,%u,%u,%lld,%lld,%.1f,%lld,%.1f,%d,%u\n", fitting,
                (unsigned long long)trial.seed, name_of(trial.injection[0]), name_of(trial.injection[1]),
                result[i].chamber[0] + 1, result[i].chamber[1] + 1, (long long)result[i].fault_us[0],
                (long long)result[i].fault_us[1], ends[result[i].end], oracle->faults, oracle->warnings,
                (long long)result[i].seen_us, (long long)oracle->vented_us, oracle->highest_pa,
                (long long)oracle->over_longest_us, result[i].apart_pa, result[i].cleared ? 1 : 0,
                tally_judge(&trial, &result[i]));
    }
}

/* What is wrong in a trial, with what it takes to see it again. */
static void name_wrong(const struct series *series, const struct trial_result *result, const bool *done, size_t *wrong) {
    for (size_t i = 0; i < series->trials; i++) {
        struct trial trial;
        if (!done[i]) {
            continue;
        }
        series_trial(series, i, &trial);
        const uint32_t bits = tally_judge(&trial, &result[i]);
        if (bits != 0u && (*wrong)++ < 40) {
            printf("  seed %llu: %s%s%s, chamber %zu: ", (unsigned long long)trial.seed, name_of(trial.injection[0]),
                   trial.injection[1] != TRIAL_NONE ? " and " : "", name_of(trial.injection[1]), result[i].chamber[0] + 1);
            tally_print_wrong(stdout, bits);
            printf(" (%.2f kPa, over for %lld ms, apart by %.2f kPa, faults 0x%x)\n", 1e-3 * result[i].oracle.highest_pa,
                   (long long)(result[i].oracle.over_longest_us / 1000), 1e-3 * result[i].apart_pa, result[i].oracle.faults);
        }
    }
}

/* Pairs may hold a chamber over the working limit, but never burst it: the ones that did, by name. */
static void list_pairs(const struct series *series, const struct trial_result *result, const bool *done) {
    for (size_t i = 0; i < series->trials; i++) {
        struct trial trial;
        const struct oracle *oracle = &result[i].oracle;
        if (done[i] && oracle->over_longest_us > TALLY_OVER_MOST_US) {
            series_trial(series, i, &trial);
            printf("  over the working limit: %s and %s, chambers %zu and %zu, %.2f kPa, %lld ms, seed %llu\n",
                   name_of(trial.injection[0]), name_of(trial.injection[1]), result[i].chamber[0] + 1,
                   result[i].chamber[1] + 1, 1e-3 * oracle->highest_pa, (long long)(oracle->over_longest_us / 1000),
                   (unsigned long long)trial.seed);
        }
    }
}

static void print_singles(const struct series *series, const struct trial_result *result, const bool *done) {
    tally_print_head(stdout);
    for (size_t k = 0; k < injection_count(); k++) {
        struct tally_row row;
        if (!tally_row_open(&row, series->trials)) {
            return;
        }
        for (size_t i = 0; i < series->trials; i++) {
            struct trial trial;
            series_trial(series, i, &trial);
            if (done[i] && trial.injection[0] == k) {
                tally_row_add(&row, &trial, &result[i]);
            }
        }
        if (row.trials > 0) {
            tally_print_row(stdout, injection_at(k)->name, &row);
        }
        if (row.end[TRIAL_HARMLESS] > 0) {
            printf("  harmless: the valves were off and pressures only fell, or they were within %.2f kPa of those "
                   "without it\n",
                   1e-3 * row.apart_pa);
        }
        tally_row_close(&row);
    }
}

static void print_all(const char *name, const struct series *series, const struct trial_result *result, const bool *done) {
    struct tally_row row;
    if (!tally_row_open(&row, series->trials)) {
        return;
    }
    for (size_t i = 0; i < series->trials; i++) {
        struct trial trial;
        series_trial(series, i, &trial);
        if (done[i]) {
            tally_row_add(&row, &trial, &result[i]);
        }
    }
    tally_print_row(stdout, name, &row);
    tally_row_close(&row);
}

/* How often air that came in cannot be told from what the fittings do about it: bursts, and over the working limit. */
static void print_fitting(const char *name, const char *what, const struct series *series, const struct trial_result *result,
                          const bool *done) {
    size_t trials = 0, bursts = 0, over = 0, never = 0;
    double highest_pa = 0.0;
    for (size_t i = 0; i < series->trials; i++) {
        const struct oracle *oracle = &result[i].oracle;
        if (!done[i]) {
            continue;
        }
        trials++;
        bursts += oracle->burst ? 1 : 0;
        over += oracle->over_longest_us > TALLY_OVER_MOST_US ? 1 : 0;
        never += oracle->latched_us != ORACLE_NEVER && oracle->vented_us == ORACLE_NEVER && !result[i].cleared ? 1 : 0;
        highest_pa = fmax(highest_pa, oracle->highest_pa);
    }
    printf("%-34s %-18s %7zu %8zu %12zu %13zu %9.2f\n", name, what, trials, bursts, over, never, 1e-3 * highest_pa);
}

struct campaign {
    struct options options;
    struct table_file file;
    FILE *csv;
    size_t wrong;
};

enum shown { SHOW_SINGLES, SHOW_ALL, SHOW_FITTING };

static bool run(struct campaign *campaign, const struct fitting *fitting, const struct series *series, enum shown shown,
                const char *name) {
    const struct plant_parameters plant = plant_of(fitting, &campaign->file.table);
    struct trial_result *result = calloc(series->trials, sizeof *result);
    bool *done = calloc(series->trials, sizeof *done);
    const bool ran = result != NULL && done != NULL &&
                     series_run(series, &campaign->file.table, &plant, result, done, true);
    if (ran) {
        if (shown == SHOW_SINGLES) {
            print_singles(series, result, done);
        } else if (shown == SHOW_ALL) {
            print_all(name, series, result, done);
            list_pairs(series, result, done);
        } else {
            print_fitting(fitting->name, name, series, result, done);
        }
        if (shown != SHOW_FITTING) {
            name_wrong(series, result, done, &campaign->wrong);
        }
        if (campaign->csv != NULL) {
            write_rows(campaign->csv, fitting->name, series, result, done);
        }
    }
    free(result);
    free(done);
    (void)fflush(stdout);
    return ran;
}

/* The ELF that is flashed: each injection once or more, pairs, and missions in which nothing breaks. */
static bool run_emulated(struct campaign *campaign) {
    const struct options *options = &campaign->options;
    const size_t n = options->emulated;
    const struct series sound = {SERIES_SOUND, options->seed, n / 10 + 1, NULL, options->elf};
    const struct series single = {SERIES_SINGLE, options->seed, n * 7 / 10 + 1, options->only, options->elf};
    const struct series pairs = {SERIES_PAIRS, options->seed, n * 2 / 10 + 1, options->only, options->elf};
    printf("\nSingle faults, on the emulated board:\n");
    for (size_t k = 0; k < injection_count(); k++) {
        if (emulated_left_out(injection_at(k)) != NULL) {
            printf("left out: %s: %s\n", injection_at(k)->name, emulated_left_out(injection_at(k)));
        }
    }
    return run(campaign, &fittings[0], &single, SHOW_SINGLES, "") &&
           run(campaign, &fittings[0], &pairs, SHOW_ALL, "all pairs") &&
           run(campaign, &fittings[0], &sound, SHOW_ALL, "nothing");
}

static bool run_all(struct campaign *campaign) {
    const struct options *options = &campaign->options;
    const size_t n = options->missions;
    const size_t tried = n / FITTING_SHARE / 2 + 1, fitted = sizeof fittings / sizeof fittings[0];
    const size_t main_part = n > 2 * fitted * tried ? n - 2 * fitted * tried : 1;
    const struct series sound = {SERIES_SOUND, options->seed, main_part / 10 + 1, NULL, NULL};
    const struct series single = {SERIES_SINGLE, options->seed, main_part * 5 / 10 + 1, options->only, NULL};
    const struct series pairs = {SERIES_PAIRS, options->seed, main_part * 4 / 10 + 1, options->only, NULL};
    printf("\nSingle faults, with the shut-off valve:\n");
    bool ran = run(campaign, &fittings[0], &single, SHOW_SINGLES, "");
    printf("\nPairs, and missions in which nothing breaks:\n");
    tally_print_head(stdout);
    ran = ran && run(campaign, &fittings[0], &pairs, SHOW_ALL, "all pairs") &&
          run(campaign, &fittings[0], &sound, SHOW_ALL, "nothing");
    printf("\nWhat may be fitted to the air, with valves that fail, and with a supply that rises and something else:\n");
    printf("%-34s %-18s %7s %8s %12s %13s %9s\n", "fitted", "broken", "trials", "bursts", "over 50 ms", "never vented",
           "kPa");
    for (size_t f = 0; f < fitted && ran; f++) {
        struct series stuck = {SERIES_SINGLE, options->seed + 1, tried, "FAULT_VALVE", NULL};
        ran = run(campaign, &fittings[f], &stuck, SHOW_FITTING, "valves");
        struct series over = {SERIES_PAIRS, options->seed + 2, tried, "SUPPLY_HIGH", NULL};
        ran = ran && run(campaign, &fittings[f], &over, SHOW_FITTING, "supply and another");
    }
    return ran && (options->emulated == 0 || run_emulated(campaign));
}

int main(int argc, char **argv) {
    struct campaign campaign = {.options = {.missions = 10000, .seed = 1, .elf = "build/firmware/tribend.elf"}};
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &campaign.options) != 0) {
        return EXIT_USAGE;
    }
    const struct series asked = {SERIES_SINGLE, 1, 1, campaign.options.only, NULL};
    if (series_variants(&asked) == 0) {
        return program_fail(EXIT_USAGE, "no fault has '%s' in its name; tests/campaign/injection.c lists them",
                            campaign.options.only);
    }
    const int code = table_file_open(&campaign.file, TABLE, NULL);
    if (code != EXIT_OK) {
        return code;
    }
    program_catch_interrupt();
    campaign.csv = campaign.options.csv != NULL ? fopen(campaign.options.csv, "w") : NULL;
    if (campaign.options.csv != NULL && campaign.csv == NULL) {
        return program_fail(EXIT_OUTPUT, "cannot write %s: %s", campaign.options.csv, strerror(errno));
    }
    if (campaign.csv != NULL) {
        fprintf(campaign.csv, "fitting,seed,injection1,injection2,chamber1,chamber2,fault1_us,fault2_us,end,faults,warnings,"
                              "seen_us,vented_us,highest_pa,over_working_us,apart_pa,cleared,wrong\n");
    }
    const bool ran = run_all(&campaign);
    const bool written = campaign.csv == NULL || fclose(campaign.csv) == 0;
    table_file_close(&campaign.file);
    if (!ran) {
        return program_fail(EXIT_OUTPUT, "not all of it was run");
    }
    if (!written) {
        return program_fail(EXIT_OUTPUT, "cannot write %s", campaign.options.csv);
    }
    printf("\n%zu trials went wrong\n", campaign.wrong);
    return program_interrupted != 0 ? EXIT_INTERRUPTED : (campaign.wrong == 0 ? EXIT_OK : EXIT_FAULT);
}
