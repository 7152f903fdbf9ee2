/* One case of a corpus: which effects, how strong, on which rig; its two runs; and how large a gap they leave. */
#ifndef TRIBEND_BLIND_CASE_H
#define TRIBEND_BLIND_CASE_H

#include "blind_log.h"
#include "blind_run.h"

#define BLIND_RUNS 2
#define BLIND_ID_BYTES 12
#define BLIND_GROUP_MAX 4

/* From what a case was drawn: the same again gives the same case. */
struct blind_draw {
    uint64_t seed;
    const char *corpus; /* as asked for: "mixed" stays that */
    size_t index;
    double seconds;
};

struct blind_case {
    char id[BLIND_ID_BYTES];
    struct blind_draw draw;
    const char *corpus;
    const char *verdict; /* the answer to give */
    struct blind_effect effect[BLIND_EFFECTS_MAX];
    double effect_gap[BLIND_EFFECTS_MAX]; /* what each alone is worth, of the noise floor */
    size_t effects;
    const char *group[BLIND_GROUP_MAX]; /* what the data cannot tell apart */
    size_t groups;
    const char *removed; /* from the catalogue at run time; NULL: none */
    bool faint;          /* made so weak that the gap is one to three times the floor */
    enum blind_excitation_kind excitation;
    struct blind_rig rig[BLIND_RUNS];
    struct blind_log_form form;
    struct blind_record record[BLIND_RUNS];
    double gap_ratio; /* greatest over the channels, against the same duties without any effect */
};

/* The name of a corpus that can be drawn, or NULL. */
const char *blind_corpus_find(const char *name);
/* Draws a case and runs it. False: `blind_case_close` all the same; out of memory, or no draw fitted. */
bool blind_case_open(struct blind_case *blind, struct blind_field *field, const struct blind_draw *draw);
/* The module stayed within its range and no fault was latched. */
bool blind_record_fits(const struct blind_record *record, const struct bend_table *table);
void blind_case_close(struct blind_case *blind);

#endif
