/* A recording of a module that the test knows, diagnosed: what `tribend gap diagnose` does with the logs. Header only. */
#ifndef TRIBEND_TEST_DIAGNOSED_H
#define TRIBEND_TEST_DIAGNOSED_H

#include "gap/diagnosis.h"
#include "host/recording.h"

struct diagnosed {
    struct gap_data data;
    struct search search;
    struct diagnosis diagnosis;
};

static inline void diagnosed_open(struct diagnosed *diagnosed, const struct recording *recording,
                                  const struct search_options *options) {
    static const struct search_options plain = {.threads = 1};
    struct plant_parameters nominal;
    plant_default_parameters(&nominal);
    recording_take(recording, &diagnosed->data);
    assert_true(search_run(&diagnosed->search, &diagnosed->data, &recording_table.table, &nominal, options != NULL ? options : &plain));
    assert_true(diagnosis_conclude(&diagnosed->diagnosis, &diagnosed->search));
}

static inline void diagnosed_close(struct diagnosed *diagnosed) {
    search_close(&diagnosed->search);
    gap_data_free(&diagnosed->data);
}

static inline void assert_verdict(const struct diagnosis *diagnosis, enum gap_verdict expected) {
    if (diagnosis->verdict != expected) {
        fail_msg("%s (structure %.2f, %.2f, %.2f; first effect %s), expected %s", gap_verdict_name(diagnosis->verdict),
                 diagnosis->structure[0], diagnosis->structure[1], diagnosis->structure[2],
                 diagnosis->effects > 0 ? diagnosis->effect[0].kind->name : "none", gap_verdict_name(expected));
    }
}

static inline void assert_holds(const struct diagnosis_interval *interval, double truth) {
    if (!(interval->low <= truth && truth <= interval->high)) {
        fail_msg("%.6g (%.6g to %.6g) does not hold %.6g", interval->value, interval->low, interval->high, truth);
    }
}

/* The effect of that name in the verdict; NULL: none. */
static inline const struct diagnosis_effect *diagnosed_effect(const struct diagnosis *diagnosis, const char *name) {
    for (size_t e = 0; e < diagnosis->effects; e++) {
        if (strcmp(diagnosis->effect[e].kind->name, name) == 0) {
            return &diagnosis->effect[e];
        }
    }
    return NULL;
}

static inline bool diagnosed_in_group(const struct diagnosis *diagnosis, const char *name) {
    for (size_t i = 0; i < diagnosis->group; i++) {
        if (strcmp(diagnosis->group_name[i], name) == 0) {
            return true;
        }
    }
    return false;
}

#endif
