#include "blind_score_case.h"

#include <dirent.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PATH_BYTES 4096

static void copy_text(char to[SCORE_NAME_BYTES], const json_t *value) {
    (void)snprintf(to, SCORE_NAME_BYTES, "%s", json_is_string(value) ? json_string_value(value) : "");
}

static double number_of(const json_t *value, double otherwise) {
    return json_is_number(value) ? json_number_value(value) : otherwise;
}

/* A parameter is a number (truth) or an object with value, low and high (answer). */
static void read_parameters(json_t *object, struct score_effect *effect) {
    const char *name;
    json_t *value;
    json_object_foreach(object, name, value) {
        if (effect->parameters == SCORE_PARAMETERS_MAX) {
            return;
        }
        struct score_parameter *parameter = &effect->parameter[effect->parameters++];
        const bool interval = json_is_object(value);
        (void)snprintf(parameter->name, sizeof parameter->name, "%s", name);
        parameter->value = number_of(interval ? json_object_get(value, "value") : value, NAN);
        parameter->low = number_of(interval ? json_object_get(value, "low") : NULL, NAN);
        parameter->high = number_of(interval ? json_object_get(value, "high") : NULL, NAN);
    }
}

static size_t read_effects(json_t *list, struct score_effect *effect) {
    size_t index, count = 0;
    json_t *item;
    json_array_foreach(list, index, item) {
        if (count == SCORE_NAMES_MAX) {
            break;
        }
        struct score_effect *into = &effect[count++];
        copy_text(into->name, json_object_get(item, "name"));
        copy_text(into->stage, json_object_get(item, "stage"));
        into->chamber = (int)number_of(json_object_get(item, "chamber"), 0.0);
        into->onset_s = number_of(json_object_get(item, "onset_s"), 0.0);
        into->gap_ratio = number_of(json_object_get(item, "gap_ratio"), NAN);
        into->probability = number_of(json_object_get(item, "probability"), NAN);
        read_parameters(json_object_get(item, "parameters"), into);
    }
    return count;
}

static int less_probable(const void *a, const void *b) {
    const struct score_effect *one = a, *two = b;
    return (one->probability < two->probability) - (one->probability > two->probability);
}

static bool read_truth(const char *folder, struct score_case *scored) {
    char path[PATH_BYTES];
    json_error_t error;
    (void)snprintf(path, sizeof path, "%s/%s.json", folder, scored->id);
    json_t *truth = json_load_file(path, 0, &error);
    if (truth == NULL) {
        (void)fprintf(stderr, "blind_score: %s:%d: %s\n", path, error.line, error.text);
        return false;
    }
    copy_text(scored->corpus, json_object_get(truth, "corpus"));
    copy_text(scored->verdict, json_object_get(truth, "verdict"));
    copy_text(scored->removed, json_object_get(truth, "removed"));
    scored->gap_ratio = number_of(json_object_get(truth, "gap_ratio"), NAN);
    scored->effects = read_effects(json_object_get(truth, "effects"), scored->effect);
    json_decref(truth);
    return true;
}

static void read_locus(const json_t *locus, struct score_case *scored) {
    size_t index;
    json_t *item;
    copy_text(scored->said_stage, json_object_get(locus, "stage"));
    json_array_foreach(json_object_get(locus, "chambers"), index, item) {
        const double chamber = number_of(item, 0.0);
        for (int c = 1; c <= 3; c++) {
            scored->said_chamber[c - 1] = scored->said_chamber[c - 1] || fabs(chamber - c) < 0.5;
        }
    }
}

/* A missing or broken answer leaves the case unanswered, which every measure counts as wrong. */
static void read_answer(const char *folder, struct score_case *scored) {
    char path[PATH_BYTES];
    json_error_t error;
    size_t index;
    json_t *item;
    scored->closed_fraction = NAN;
    (void)snprintf(path, sizeof path, "%s/%s.json", folder, scored->id);
    json_t *answer = json_load_file(path, 0, &error);
    if (answer == NULL) {
        return;
    }
    scored->answered = json_is_string(json_object_get(answer, "verdict"));
    copy_text(scored->said_verdict, json_object_get(answer, "verdict"));
    read_locus(json_object_get(answer, "locus"), scored);
    scored->said_effects = read_effects(json_object_get(answer, "effects"), scored->said);
    qsort(scored->said, scored->said_effects, sizeof scored->said[0], less_probable);
    json_array_foreach(json_object_get(answer, "group"), index, item) {
        if (scored->said_groups < SCORE_NAMES_MAX) {
            copy_text(scored->said_group[scored->said_groups++], item);
        }
    }
    scored->closed_fraction = number_of(json_object_get(json_object_get(answer, "closed_fraction"), "value"), NAN);
    json_decref(answer);
}

static int is_json(const struct dirent *entry) {
    const size_t length = strlen(entry->d_name);
    return length > 5 && length - 5 < SCORE_NAME_BYTES && strcmp(entry->d_name + length - 5, ".json") == 0;
}

bool score_cases_read(const char *truth_folder, const char *answer_folder, struct score_case **cases, size_t *count) {
    struct dirent **entry = NULL;
    const int found = scandir(truth_folder, &entry, is_json, alphasort);
    bool sound = found >= 0;
    *count = 0;
    *cases = calloc(found > 0 ? (size_t)found : 1, sizeof **cases);
    if (!sound) {
        (void)fprintf(stderr, "blind_score: %s cannot be read\n", truth_folder);
    }
    for (int i = 0; i < found; i++) {
        if (sound && *cases != NULL) {
            struct score_case *scored = &(*cases)[*count];
            (void)snprintf(scored->id, sizeof scored->id, "%.*s", (int)strlen(entry[i]->d_name) - 5, entry[i]->d_name);
            sound = read_truth(truth_folder, scored);
            read_answer(answer_folder, scored);
            *count += sound ? 1 : 0;
        }
        free(entry[i]);
    }
    free(entry);
    return sound && *cases != NULL;
}

bool score_is_true(const struct score_case *scored, const char *name) {
    for (size_t i = 0; i < scored->effects; i++) {
        if (strcmp(scored->effect[i].name, name) == 0) {
            return true;
        }
    }
    return false;
}

bool score_names_effects(const struct score_case *scored) {
    const bool named = strcmp(scored->said_verdict, "effect") == 0 || strcmp(scored->said_verdict, "effects") == 0;
    return scored->answered && named && scored->said_effects > 0;
}

const struct score_effect *score_top(const struct score_case *scored) {
    return score_names_effects(scored) ? &scored->said[0] : NULL;
}

bool score_in_group(const struct score_case *scored) {
    bool found = false;
    for (size_t i = 0; i < scored->said_effects; i++) {
        found = found || score_is_true(scored, scored->said[i].name);
    }
    for (size_t i = 0; i < scored->said_groups; i++) {
        found = found || score_is_true(scored, scored->said_group[i]);
    }
    return scored->answered && found;
}

const char *score_word(const struct score_case *scored) {
    const struct score_effect *top = score_top(scored);
    if (!scored->answered) {
        return "no answer";
    }
    return top != NULL ? top->name : scored->said_verdict;
}
