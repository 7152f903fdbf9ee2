/* A scored case: the sealed truth and the answer of the diagnosis side by side. */
#ifndef TRIBEND_BLIND_SCORE_CASE_H
#define TRIBEND_BLIND_SCORE_CASE_H

#include <stdbool.h>
#include <stddef.h>

#define SCORE_NAME_BYTES 48
#define SCORE_NAMES_MAX 8
#define SCORE_PARAMETERS_MAX 8

struct score_parameter {
    char name[SCORE_NAME_BYTES];
    double value;
    double low; /* of the answer's interval; NaN where it gives none */
    double high;
};

struct score_effect {
    char name[SCORE_NAME_BYTES];
    char stage[SCORE_NAME_BYTES];
    int chamber;        /* truth: 1..3, 0: all or none in particular */
    double onset_s;     /* truth */
    double gap_ratio;   /* truth */
    double probability; /* answer */
    struct score_parameter parameter[SCORE_PARAMETERS_MAX];
    size_t parameters;
};

struct score_case {
    char id[SCORE_NAME_BYTES];
    char corpus[SCORE_NAME_BYTES];
    /* truth */
    char verdict[SCORE_NAME_BYTES];
    struct score_effect effect[SCORE_NAMES_MAX];
    size_t effects;
    char removed[SCORE_NAME_BYTES];
    double gap_ratio;
    /* answer, its effects most probable first */
    bool answered;
    char said_verdict[SCORE_NAME_BYTES];
    char said_stage[SCORE_NAME_BYTES];
    bool said_chamber[3];
    struct score_effect said[SCORE_NAMES_MAX];
    size_t said_effects;
    char said_group[SCORE_NAMES_MAX][SCORE_NAME_BYTES];
    size_t said_groups;
    double closed_fraction; /* NaN: none given */
};

/* Reads DIR/ID.json of every truth and its answer, in the order of the ids. False: `*count` is what was read before the
 * trouble, which was printed. The caller frees `*cases`. */
bool score_cases_read(const char *truth_folder, const char *answer_folder, struct score_case **cases, size_t *count);

/* The truth has an effect of that name. */
bool score_is_true(const struct score_case *scored, const char *name);
/* The answer's verdict is that effects were found. */
bool score_names_effects(const struct score_case *scored);
/* The most probable effect of an answer that names effects, else NULL. */
const struct score_effect *score_top(const struct score_case *scored);
/* Whether the truth's first effect is in the answer's effects or its group. */
bool score_in_group(const struct score_case *scored);
/* What the answer amounts to in one word: the top effect's name, or the verdict, or "no answer". */
const char *score_word(const struct score_case *scored);

#endif
