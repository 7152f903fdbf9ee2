#include "blind_plan.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <yaml.h>

#define TARGET_S (1e-6 * BLIND_TARGET_US)
#define VENTED_S 1.0
#define LENGTH_MOST_S 600.0

/* A file that is being read; the first thing that is wrong is kept. */
struct reader {
    const char *path;
    yaml_document_t document;
    char *error;
    size_t error_bytes;
    bool failed;
};

static void refuse(struct reader *reader, const yaml_node_t *node, const char *what) {
    if (!reader->failed) {
        (void)snprintf(reader->error, reader->error_bytes, "%s:%zu: %s", reader->path,
                       node != NULL ? node->start_mark.line + 1 : (size_t)1, what);
    }
    reader->failed = true;
}

/* --- values --- */

struct unit {
    const char *name;
    double si;
};

/* A number with its unit, in SI units. */
static double quantity(struct reader *reader, const yaml_node_t *node) {
    static const struct unit units[] = {{"s", 1.0},     {"ms", 1e-3},      {"Pa", 1.0},           {"mbar", 100.0},
                                        {"kPa", 1e3},   {"bar", 1e5},      {"deg", M_PI / 180.0}, {"rad", 1.0}};
    const char *text = node != NULL && node->type == YAML_SCALAR_NODE ? (const char *)node->data.scalar.value : "";
    char *end = NULL;
    const double value = strtod(text, &end);
    for (size_t i = 0; i < sizeof units / sizeof units[0] && end != text && isfinite(value); i++) {
        if (strcmp(end, units[i].name) == 0) {
            return value * units[i].si;
        }
    }
    refuse(reader, node, "a number with its unit is wanted here");
    return 0.0;
}

/* NULL: the mapping has no such key. */
static yaml_node_t *child(struct reader *reader, const yaml_node_t *mapping, const char *key) {
    if (mapping == NULL || mapping->type != YAML_MAPPING_NODE) {
        return NULL;
    }
    for (const yaml_node_pair_t *pair = mapping->data.mapping.pairs.start; pair < mapping->data.mapping.pairs.top; pair++) {
        const yaml_node_t *name = yaml_document_get_node(&reader->document, pair->key);
        if (name->type == YAML_SCALAR_NODE && strcmp((const char *)name->data.scalar.value, key) == 0) {
            return yaml_document_get_node(&reader->document, pair->value);
        }
    }
    return NULL;
}

static size_t length_of(const yaml_node_t *list) {
    return list != NULL && list->type == YAML_SEQUENCE_NODE
               ? (size_t)(list->data.sequence.items.top - list->data.sequence.items.start)
               : 0;
}

static yaml_node_t *item(struct reader *reader, const yaml_node_t *list, size_t index) {
    return yaml_document_get_node(&reader->document, list->data.sequence.items.start[index]);
}

static void three_pressures(struct reader *reader, const yaml_node_t *list, double pressure_pa[3]) {
    if (length_of(list) != 3) {
        refuse(reader, list, "three pressures are wanted here");
        return;
    }
    for (size_t c = 0; c < 3; c++) {
        pressure_pa[c] = quantity(reader, item(reader, list, c));
    }
}

/* --- steps --- */

/* The values of one step: `target_pa` and `bend` are its part of the excitation, `before_pa` what held before. */
struct part {
    size_t count;
    double (*target_pa)[3];
    struct blind_bend *bend;
    double before_pa[3];
};

static void fill_pressures(struct part *part, const double pressure_pa[3], bool ramp) {
    for (size_t i = 0; i < part->count; i++) {
        const double share = ramp ? (double)(i + 1) / (double)part->count : 1.0;
        for (size_t c = 0; c < 3; c++) {
            part->target_pa[i][c] = part->before_pa[c] + share * (pressure_pa[c] - part->before_pa[c]);
        }
    }
}

static void add_sine(struct reader *reader, const yaml_node_t *sine, struct part *part) {
    const yaml_node_t *chambers = child(reader, sine, "chambers"), *phase = child(reader, sine, "phase");
    const double amplitude_pa = quantity(reader, child(reader, sine, "amplitude"));
    const double mean_pa = quantity(reader, child(reader, sine, "mean"));
    const double period_s = quantity(reader, child(reader, sine, "period"));
    const double phase_rad = phase != NULL ? quantity(reader, phase) : 0.0;
    for (size_t k = 0; k < length_of(chambers); k++) {
        const long chamber = strtol((const char *)item(reader, chambers, k)->data.scalar.value, NULL, 10);
        if (chamber < 1 || chamber > 3) {
            refuse(reader, chambers, "chambers are 1 to 3");
            return;
        }
        for (size_t i = 0; i < part->count; i++) {
            part->target_pa[i][chamber - 1] +=
                mean_pa + amplitude_pa * sin(2.0 * M_PI * TARGET_S * (double)i / period_s + phase_rad);
        }
    }
}

static void fill_bend(struct reader *reader, const yaml_node_t *step, struct part *part) {
    const yaml_node_t *toward = child(reader, step, "toward"), *together = child(reader, step, "co_contraction");
    const struct blind_bend bend = {.wanted = true,
                                    .bend_rad = quantity(reader, child(reader, step, "bend")),
                                    .direction_rad = toward != NULL ? quantity(reader, toward) : 0.0,
                                    .co_contraction_pa = together != NULL ? quantity(reader, together) : 0.0};
    for (size_t i = 0; i < part->count; i++) {
        part->bend[i] = bend;
    }
}

static void fill_step(struct reader *reader, const yaml_node_t *step, struct part *part) {
    const yaml_node_t *pressure = child(reader, step, "pressure"), *ramp = child(reader, step, "ramp_to");
    const yaml_node_t *sine = child(reader, step, "sine"), *sines = child(reader, step, "sines");
    double pressure_pa[3] = {0.0, 0.0, 0.0};
    if (pressure != NULL || ramp != NULL) {
        three_pressures(reader, pressure != NULL ? pressure : ramp, pressure_pa);
        fill_pressures(part, pressure_pa, ramp != NULL);
    } else if (sine != NULL) {
        add_sine(reader, sine, part);
    } else if (sines != NULL) {
        for (size_t k = 0; k < length_of(sines); k++) {
            add_sine(reader, item(reader, sines, k), part);
        }
    } else if (child(reader, step, "bend") != NULL) {
        fill_bend(reader, step, part);
    } else if (child(reader, step, "vent") == NULL) {
        refuse(reader, step, "a step is one of pressure, ramp_to, sine, sines, bend, vent");
    }
}

static double step_length_s(struct reader *reader, const yaml_node_t *step) {
    const double length_s = quantity(reader, child(reader, step, "for"));
    if (!(length_s > 0.0)) {
        refuse(reader, step, "a step lasts for some time (for)");
    }
    return length_s;
}

static void fill_steps(struct reader *reader, const yaml_node_t *steps, struct blind_excitation *excitation) {
    struct part part = {.before_pa = {0.0, 0.0, 0.0}};
    double end_s = BLIND_REST_S;
    for (size_t k = 0; k < length_of(steps) && !reader->failed; k++) {
        const yaml_node_t *step = item(reader, steps, k);
        const size_t from = (size_t)llround(end_s / TARGET_S);
        end_s += step_length_s(reader, step);
        part.count = (size_t)llround(end_s / TARGET_S) - from;
        part.target_pa = excitation->target_pa + from;
        part.bend = excitation->bend + from;
        fill_step(reader, step, &part);
        if (part.count > 0) {
            memcpy(part.before_pa, part.target_pa[part.count - 1], sizeof part.before_pa);
        }
    }
}

static void read_steps(struct reader *reader, struct blind_excitation *excitation, double *seconds) {
    const yaml_node_t *root = yaml_document_get_root_node(&reader->document), *steps = child(reader, root, "steps");
    *seconds = BLIND_REST_S + VENTED_S;
    for (size_t k = 0; k < length_of(steps); k++) {
        *seconds += step_length_s(reader, item(reader, steps, k));
    }
    if (length_of(steps) == 0 || !(*seconds < LENGTH_MOST_S)) {
        refuse(reader, steps != NULL ? steps : root, "steps of at most ten minutes in all are wanted");
    }
    if (reader->failed) {
        return;
    }
    *seconds = 0.01 * ceil(100.0 * *seconds - 1e-6); /* whole PWM periods */
    excitation->count = (size_t)ceil(*seconds / TARGET_S) + 2;
    excitation->target_pa = calloc(excitation->count, sizeof *excitation->target_pa);
    excitation->bend = calloc(excitation->count, sizeof *excitation->bend);
    if (excitation->target_pa == NULL || excitation->bend == NULL) {
        refuse(reader, root, "out of memory");
    } else {
        fill_steps(reader, steps, excitation);
    }
}

bool blind_plan_open(const char *path, struct blind_excitation *excitation, double *seconds, char *error, size_t error_bytes) {
    struct reader reader = {.path = path, .error = error, .error_bytes = error_bytes};
    yaml_parser_t parser;
    FILE *file = fopen(path, "r");
    memset(excitation, 0, sizeof *excitation);
    if (file == NULL || !yaml_parser_initialize(&parser)) {
        (void)snprintf(error, error_bytes, "%s: %s", path, file == NULL ? strerror(errno) : "out of memory");
        if (file != NULL) {
            (void)fclose(file);
        }
        return false;
    }
    yaml_parser_set_input_file(&parser, file);
    if (yaml_parser_load(&parser, &reader.document)) {
        read_steps(&reader, excitation, seconds);
        yaml_document_delete(&reader.document);
    } else {
        (void)snprintf(error, error_bytes, "%s:%zu: %s", path, parser.problem_mark.line + 1,
                       parser.problem != NULL ? parser.problem : "no YAML");
        reader.failed = true;
    }
    yaml_parser_delete(&parser);
    (void)fclose(file);
    if (reader.failed) {
        blind_excitation_close(excitation);
    }
    return !reader.failed;
}
