#include "blind_truth.h"

#include <jansson.h>
#include <stdio.h>
#include <string.h>

/* With a logged temperature the stiffness changes by the kelvin, else by the second. */
static const char *parameter_name(const struct blind_effect *effect, size_t i) {
    const bool by_kelvin = strcmp(effect->kind->name, "temperature_stiffness") == 0 && effect->variant == 0;
    return by_kelvin ? "per_kelvin" : effect->kind->parameter[i];
}

static json_t *truth_parameters(const struct blind_effect *effect) {
    json_t *parameters = json_object();
    for (size_t i = 0; i < BLIND_PARAMETERS_MAX; i++) {
        if (effect->kind->parameter[i] != NULL) {
            (void)json_object_set_new(parameters, parameter_name(effect, i), json_real(effect->parameter[i]));
        }
    }
    return parameters;
}

static json_t *truth_effects(const struct blind_case *blind) {
    json_t *effects = json_array();
    for (size_t i = 0; i < blind->effects; i++) {
        const struct blind_effect *effect = &blind->effect[i];
        (void)json_array_append_new(
            effects, json_pack("{s:s, s:s, s:i, s:f, s:o, s:f, s:i, s:[f, f, f, f]}", "name", effect->kind->name, "stage",
                               effect->kind->stage, "chamber", effect->chamber, "onset_s", effect->onset_s, "parameters",
                               truth_parameters(effect), "gap_ratio", blind->effect_gap[i], "variant", effect->variant,
                               "form", effect->form[0], effect->form[1], effect->form[2], effect->form[3]));
    }
    return effects;
}

static json_t *truth_files(const struct blind_case *blind) {
    json_t *files = json_array();
    for (size_t r = 0; r < BLIND_RUNS; r++) {
        char name[64];
        (void)snprintf(name, sizeof name, "%s-%zu.csv", blind->id, r + 1);
        (void)json_array_append_new(files, json_string(name));
    }
    return files;
}

static json_t *truth_group(const struct blind_case *blind) {
    json_t *group = json_array();
    for (size_t i = 0; i < blind->groups; i++) {
        (void)json_array_append_new(group, json_string(blind->group[i]));
    }
    return group;
}

bool blind_truth_write(const char *path, const struct blind_case *blind) {
    const struct blind_nominal *nominal = &blind->rig[0].nominal;
    json_t *truth = json_pack(
        "{s:s, s:s, s:o, s:s, s:o, s:{s:f, s:f}, s:f, s:s?, s:o, s:{s:b, s:b, s:b}, s:{s:I, s:s, s:I, s:f}}", "id", blind->id, "corpus",
        blind->corpus, "files", truth_files(blind), "verdict", blind->verdict, "effects", truth_effects(blind), "nominal",
        "stiffness_scale", nominal->stiffness_scale, "supply_scale", nominal->supply_scale, "gap_ratio", blind->gap_ratio,
        "removed", blind->removed, "group", truth_group(blind), "rig", "controlled",
        blind->rig[0].drive == BLIND_DRIVE_CONTROLLER, "supply_logged", blind->form.supply, "temperature_logged",
        blind->form.temperature, "draw", "seed", (json_int_t)blind->draw.seed, "corpus", blind->draw.corpus, "index",
        (json_int_t)blind->draw.index, "seconds", blind->draw.seconds);
    const bool written =
        truth != NULL && json_dump_file(truth, path, JSON_INDENT(2) | JSON_REAL_PRECISION(9) | JSON_PRESERVE_ORDER) == 0;
    json_decref(truth);
    return written;
}

bool blind_truth_read(const char *path, struct blind_draw *draw, char id[BLIND_ID_BYTES], char *error, size_t error_bytes) {
    json_error_t why;
    json_int_t seed = 0, index = 0;
    const char *name = NULL, *corpus = NULL;
    json_t *truth = json_load_file(path, 0, &why);
    if (truth == NULL) {
        (void)snprintf(error, error_bytes, "%s:%d: %s", path, why.line, why.text);
        return false;
    }
    const bool known = json_unpack_ex(truth, &why, 0, "{s:s, s:{s:I, s:s, s:I, s:F}}", "id", &name, "draw", "seed", &seed, "corpus",
                                      &corpus, "index", &index, "seconds", &draw->seconds) == 0 &&
                       blind_corpus_find(corpus) != NULL && seed >= 0 && index >= 0 && strlen(name) < BLIND_ID_BYTES;
    if (known) {
        draw->seed = (uint64_t)seed;
        draw->index = (size_t)index;
        draw->corpus = blind_corpus_find(corpus);
        (void)snprintf(id, BLIND_ID_BYTES, "%s", name);
    } else {
        (void)snprintf(error, error_bytes, "%s: it does not say from what it was drawn (draw): generate the case anew", path);
    }
    json_decref(truth);
    return known;
}
