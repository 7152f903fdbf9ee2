#include "campaign/tally.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char *const wrong_names[] = {"false alarm", "over the burst limit", "over the working limit for over 50 ms",
                                          "undetected", "air may flow though a fault is latched"};

static bool has_row(const struct trial *trial, const char *row) {
    for (size_t i = 0; i < 2; i++) {
        if (trial->injection[i] != TRIAL_NONE && strcmp(injection_at(trial->injection[i])->row, row) == 0) {
            return true;
        }
    }
    return false;
}

uint32_t tally_judge(const struct trial *trial, const struct trial_result *result) {
    const struct oracle *oracle = &result->oracle;
    const bool single = trial->injection[1] == TRIAL_NONE;
    const int64_t open_most_us =
        has_row(trial, "FAULT_OUTPUTS_REFUSED") ? TALLY_REFUSED_MOST_US : TALLY_LEFT_OPEN_MOST_US;
    return (result->false_alarm ? (uint32_t)TALLY_FALSE_ALARM : 0u) | (oracle->burst ? (uint32_t)TALLY_BURST : 0u) |
           (single && oracle->over_longest_us > TALLY_OVER_MOST_US ? (uint32_t)TALLY_OVER_WORKING : 0u) |
           (result->end == TRIAL_UNDETECTED ? (uint32_t)TALLY_UNSEEN : 0u) |
           (oracle->left_open_us > open_most_us ? (uint32_t)TALLY_LEFT_OPEN : 0u);
}

bool tally_row_open(struct tally_row *row, size_t trials) {
    memset(row, 0, sizeof *row);
    row->seen_us = calloc(trials + 1, sizeof row->seen_us[0]);
    row->vent_us = calloc(trials + 1, sizeof row->vent_us[0]);
    return row->seen_us != NULL && row->vent_us != NULL;
}

void tally_row_close(struct tally_row *row) {
    free(row->seen_us);
    free(row->vent_us);
}

void tally_row_add(struct tally_row *row, const struct trial *trial, const struct trial_result *result) {
    const struct oracle *oracle = &result->oracle;
    const uint32_t wrong = tally_judge(trial, result);
    row->trials++;
    row->end[result->end]++;
    row->highest_pa = fmax(row->highest_pa, oracle->highest_pa);
    row->over_longest_us = oracle->over_longest_us > row->over_longest_us ? oracle->over_longest_us : row->over_longest_us;
    row->apart_pa = result->end == TRIAL_HARMLESS ? fmax(row->apart_pa, result->apart_pa) : row->apart_pa;
    for (size_t w = 0; w < 5; w++) {
        row->wrong[w] += wrong >> w & 1u;
    }
    if (result->seen_us != ORACLE_NEVER) {
        row->seen_us[row->seen++] = result->seen_us;
    }
    if (result->end == TRIAL_LATCHED && !result->cleared) {
        if (oracle->vented_us == ORACLE_NEVER) {
            row->never_vented++;
        } else {
            row->vent_us[row->vented++] = oracle->vented_us;
        }
    }
}

static int by_value(const void *a, const void *b) {
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

static void print_times(FILE *file, int64_t *times_us, size_t count) {
    if (count == 0) {
        fprintf(file, "       -        -");
        return;
    }
    qsort(times_us, count, sizeof times_us[0], by_value);
    fprintf(file, " %7lld %8lld", (long long)(times_us[count / 2] / 1000), (long long)(times_us[count - 1] / 1000));
}

void tally_print_head(FILE *file) {
    fprintf(file, "%-24s %6s %7s %6s %8s %10s  %-16s  %-16s %6s %8s %9s\n", "", "", "", "", "", "", "    seen, ms",
            "   vented, ms", "never", "highest", "over 11,");
    fprintf(file, "%-24s %6s %7s %6s %8s %10s %8s %8s %8s %8s %7s %8s %9s\n", "what was broken", "trials", "latched",
            "warned", "harmless", "undetected", "median", "worst", "median", "worst", "vented", "kPa", "ms");
}

void tally_print_row(FILE *file, const char *name, struct tally_row *row) {
    fprintf(file, "%-24s %6zu %7zu %6zu %8zu %10zu ", name, row->trials, row->end[TRIAL_LATCHED], row->end[TRIAL_WARNED],
            row->end[TRIAL_HARMLESS], row->end[TRIAL_UNDETECTED]);
    print_times(file, row->seen_us, row->seen);
    fprintf(file, " ");
    print_times(file, row->vent_us, row->vented);
    fprintf(file, " %7zu %8.2f %9lld\n", row->never_vented, 1e-3 * row->highest_pa,
            (long long)(row->over_longest_us / 1000));
}

void tally_print_wrong(FILE *file, uint32_t wrong) {
    const char *between = "";
    for (size_t w = 0; w < 5; w++) {
        if ((wrong >> w & 1u) != 0u) {
            fprintf(file, "%s%s", between, wrong_names[w]);
            between = ", ";
        }
    }
}
