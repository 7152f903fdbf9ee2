/* blind_score: joins the answers of the diagnosis with the sealed truth and prints the design page's table of measures. */
#include <argp.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "blind_score_measure.h"
#include "blind_score_plan.h"

#define WORDS_MAX 128
#define BINS 5

struct arguments {
    const char *truth;
    const char *answers;
    const char *planned;
    const char *random;
    const char *csv;
    bool strict;
};

static const struct argp_option options[] = {
    {"truth", 't', "DIR", 0, "the sealed truth, ID.json", 0},
    {"answers", 'a', "DIR", 0, "the reports of the diagnosis, ID.json", 0},
    {"planned", 'p', "DIR", 0, "the reports with the log of the planned experiment added, for answers that are a group", 0},
    {"random", 'r', "DIR", 0, "the same with the log of a random experiment", 0},
    {"csv", 'c', "FILE", 0, "write the confusion matrix there", 0},
    {"strict", 's', NULL, 0, "exit with 1 where a measure is surely missed (its whole interval)", 0},
    {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 't':
        arguments->truth = argument;
        return 0;
    case 'a':
        arguments->answers = argument;
        return 0;
    case 'p':
        arguments->planned = argument;
        return 0;
    case 'r':
        arguments->random = argument;
        return 0;
    case 'c':
        arguments->csv = argument;
        return 0;
    case 's':
        arguments->strict = true;
        return 0;
    case ARGP_KEY_END:
        if (arguments->truth == NULL || arguments->answers == NULL) {
            argp_error(state, "--truth and --answers are wanted");
        }
        if ((arguments->planned == NULL) != (arguments->random == NULL)) {
            argp_error(state, "--planned and --random go together");
        }
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "", "Scores the diagnosis on blind cases.", NULL, NULL, NULL};

/* --- rates --- */

/* Returns whether the whole interval misses the target. */
static bool print_measure(const struct score_measure *measure, const struct score_case *cases, size_t count) {
    size_t counted = 0, hits = 0;
    double low = 0.0, high = 1.0;
    for (size_t i = 0; i < count; i++) {
        if (measure->counts(&cases[i])) {
            counted++;
            hits += measure->hit(&cases[i]) ? 1 : 0;
        }
    }
    if (counted == 0) {
        return false;
    }
    score_wilson(hits, counted, &low, &high);
    const double rate = (double)hits / (double)counted;
    const bool met = measure->at_most ? rate <= measure->target : rate >= measure->target;
    printf("%-52s | %s %5.1f %% | %6.1f %% | %4zu of %4zu | %5.1f to %5.1f %% | %s\n", measure->name,
           measure->at_most ? "<=" : ">=", 100.0 * measure->target, 100.0 * rate, hits, counted, 100.0 * low, 100.0 * high,
           met ? "met" : "missed");
    return measure->at_most ? low > measure->target : high < measure->target;
}

static void print_number(const char *name, const char *target, double value, const char *unit, size_t count) {
    if (count > 0) {
        printf("%-52s | %10s | %6.3g %s | %12zu | \n", name, target, value, unit, count);
    }
}

static void print_parameters(const struct score_case *cases, size_t count) {
    struct score_parameters sum = {.error = calloc((count + 1) * SCORE_NAMES_MAX * SCORE_PARAMETERS_MAX, sizeof(double))};
    for (size_t i = 0; i < count && sum.error != NULL; i++) {
        score_add_parameters(&cases[i], &sum);
    }
    if (sum.errors > 0) {
        print_number("parameter error, median", "<= 10 %", 100.0 * score_median(sum.error, sum.errors), "%", sum.errors);
    }
    if (sum.intervals > 0) {
        double low, high;
        score_wilson(sum.covered, sum.intervals, &low, &high);
        printf("%-52s | 85 to 95 %% | %6.1f %% | %4zu of %4zu | %5.1f to %5.1f %% |\n", "90 % interval covers the truth",
               100.0 * (double)sum.covered / (double)sum.intervals, sum.covered, sum.intervals, 100.0 * low, 100.0 * high);
    }
    free(sum.error);
}

static void print_closed(const struct score_case *cases, size_t count) {
    double *closed = calloc(count + 1, sizeof *closed);
    size_t used = 0;
    for (size_t i = 0; i < count && closed != NULL; i++) {
        if (cases[i].effects > 0 && score_names_effects(&cases[i]) && !isnan(cases[i].closed_fraction)) {
            closed[used++] = cases[i].closed_fraction;
        }
    }
    print_number("gap closed by a named effect, median", ">= 0.90", score_median(closed, used), " ", used);
    free(closed);
}

static bool print_measures(const struct score_case *cases, size_t count) {
    bool missed = false;
    size_t used = 0;
    printf("%-52s | %10s | %8s | %12s | 95 %% interval (Wilson)\n", "measure", "to reach", "reached", "count");
    for (size_t m = 0; m < score_measure_count; m++) {
        missed = print_measure(&score_measures[m], cases, count) || missed;
    }
    const double calibration = score_calibration(cases, count, BINS, &used);
    print_parameters(cases, count);
    print_number("calibration of the probabilities (ECE, 5 bins)", "<= 0.08", calibration, " ", used);
    print_closed(cases, count);
    return missed;
}

/* --- the next experiment --- */

#define HALVED_LEAST 0.70

static void print_halved(const char *name, const char *target, size_t halved, size_t groups) {
    double low, high;
    score_wilson(halved, groups, &low, &high);
    printf("%-52s | %10s | %6.1f %% | %4zu of %4zu | %5.1f to %5.1f %% | ", name, target, 100.0 * (double)halved / (double)groups,
           halved, groups, 100.0 * low, 100.0 * high);
}

/* Returns whether the whole interval misses the target. */
static bool print_plans(const struct arguments *arguments, const struct score_case *cases, size_t count) {
    struct score_case *planned = NULL, *random = NULL;
    size_t planned_count = 0, random_count = 0;
    bool missed = false;
    if (arguments->planned != NULL && score_cases_read(arguments->truth, arguments->planned, &planned, &planned_count) &&
        score_cases_read(arguments->truth, arguments->random, &random, &random_count) && planned_count == count &&
        random_count == count) {
        const struct score_plan plan = score_plans(cases, planned, random, count);
        double low, high;
        if (plan.groups > 0) {
            print_halved("gap plan: its experiment halves the group", ">=  70.0 %", plan.planned_halved, plan.groups);
            printf("%s\n", (double)plan.planned_halved >= HALVED_LEAST * (double)plan.groups ? "met" : "missed");
            print_halved("  a random one of equal length does", "", plan.random_halved, plan.groups);
            printf("\n  fewer names are left after the plan in %zu, after the random one in %zu; groups without the truth: %zu\n",
                   plan.planned_better, plan.random_better, plan.outside);
            score_wilson(plan.planned_halved, plan.groups, &low, &high);
            missed = high < HALVED_LEAST;
        }
    }
    free(planned);
    free(random);
    return missed;
}

/* --- confusion --- */

struct confusion {
    const char *word[WORDS_MAX];
    size_t words;
    size_t count[WORDS_MAX][WORDS_MAX]; /* [truth][answer] */
};

static size_t place_of(struct confusion *confusion, const char *word) {
    for (size_t i = 0; i < confusion->words; i++) {
        if (strcmp(confusion->word[i], word) == 0) {
            return i;
        }
    }
    if (confusion->words == WORDS_MAX) {
        return WORDS_MAX - 1;
    }
    confusion->word[confusion->words] = word;
    return confusion->words++;
}

/* Pairs count once for each of their effects, against the same effect where the answer has it; cases whose true entry was
 * removed from the catalogue do not count. */
static const char *answer_to(const struct score_case *scored, size_t effect) {
    for (size_t i = 0; i < scored->said_effects && score_names_effects(scored); i++) {
        if (strcmp(scored->said[i].name, scored->effect[effect].name) == 0) {
            return scored->said[i].name;
        }
    }
    return score_word(scored);
}

static void fill_confusion(struct confusion *confusion, const struct score_case *cases, size_t count) {
    memset(confusion, 0, sizeof *confusion);
    for (size_t i = 0; i < count; i++) {
        if (cases[i].removed[0] != '\0') {
            continue;
        }
        for (size_t k = 0; k < cases[i].effects; k++) {
            const size_t truth = place_of(confusion, cases[i].effect[k].name);
            confusion->count[truth][place_of(confusion, answer_to(&cases[i], k))]++;
        }
        if (cases[i].effects == 0) {
            confusion->count[place_of(confusion, cases[i].verdict)][place_of(confusion, score_word(&cases[i]))]++;
        }
    }
}

static void print_confusion(const struct confusion *confusion) {
    printf("\ntruth: answers (count)\n");
    for (size_t t = 0; t < confusion->words; t++) {
        size_t all = 0;
        for (size_t a = 0; a < confusion->words; a++) {
            all += confusion->count[t][a];
        }
        if (all > 0) {
            printf("  %-22s", confusion->word[t]);
            for (size_t a = 0; a < confusion->words; a++) {
                if (confusion->count[t][a] > 0) {
                    printf(" %s (%zu)", confusion->word[a], confusion->count[t][a]);
                }
            }
            printf("\n");
        }
    }
}

static bool write_confusion(const struct confusion *confusion, const char *path) {
    FILE *file = fopen(path, "w");
    if (file == NULL) {
        return false;
    }
    fputs("truth", file);
    for (size_t a = 0; a < confusion->words; a++) {
        fprintf(file, ",%s", confusion->word[a]);
    }
    for (size_t t = 0; t < confusion->words; t++) {
        fprintf(file, "\n%s", confusion->word[t]);
        for (size_t a = 0; a < confusion->words; a++) {
            fprintf(file, ",%zu", confusion->count[t][a]);
        }
    }
    fputs("\n", file);
    return fclose(file) == 0;
}

/* --- failures --- */

static void print_effect(const struct score_effect *effect, bool answer) {
    printf(" %s", effect->name);
    if (effect->chamber > 0) {
        printf(" of chamber %d", effect->chamber);
    }
    if (effect->onset_s > 0.0) {
        printf(" from %.1f s", effect->onset_s);
    }
    for (size_t i = 0; i < effect->parameters; i++) {
        printf(" %s=%.3g", effect->parameter[i].name, effect->parameter[i].value);
    }
    if (answer) {
        printf(" (p %.2f)", effect->probability);
    }
    printf(";");
}

static void print_failure(const struct score_case *scored) {
    printf("  %s %-11s gap %.3g x floor\n    truth  %s:", scored->id, scored->corpus, scored->gap_ratio, scored->verdict);
    for (size_t i = 0; i < scored->effects; i++) {
        print_effect(&scored->effect[i], false);
    }
    printf("\n    answer %s, %s:", scored->answered ? scored->said_verdict : "none", scored->said_stage);
    for (size_t i = 0; i < scored->said_effects; i++) {
        print_effect(&scored->said[i], true);
    }
    for (size_t i = 0; i < scored->said_groups; i++) {
        printf("%s%s", i == 0 ? " group " : ", ", scored->said_group[i]);
    }
    printf("\n");
}

static void print_failures(const struct score_case *cases, size_t count) {
    size_t failed = 0;
    printf("\nnot as it should be\n");
    for (size_t i = 0; i < count; i++) {
        if (score_failed(&cases[i])) {
            print_failure(&cases[i]);
            failed++;
        }
    }
    printf("%zu of %zu cases\n", failed, count);
}

int main(int argc, char **argv) {
    static struct confusion confusion;
    struct arguments arguments = {0};
    struct score_case *cases = NULL;
    size_t count = 0, missing = 0;
    (void)argp_parse(&parser, argc, argv, 0, NULL, &arguments);
    if (!score_cases_read(arguments.truth, arguments.answers, &cases, &count) || count == 0) {
        free(cases);
        return 3;
    }
    bool missed = print_measures(cases, count);
    missed = print_plans(&arguments, cases, count) || missed;
    fill_confusion(&confusion, cases, count);
    print_confusion(&confusion);
    print_failures(cases, count);
    for (size_t i = 0; i < count; i++) {
        missing += cases[i].answered ? 0 : 1;
    }
    if (missing > 0) {
        printf("%zu cases have no answer\n", missing);
    }
    const bool written = arguments.csv == NULL || write_confusion(&confusion, arguments.csv);
    if (!written) {
        (void)fprintf(stderr, "blind_score: %s cannot be written\n", arguments.csv);
    }
    free(cases);
    return !written ? 5 : (arguments.strict && missed ? 1 : 0);
}
