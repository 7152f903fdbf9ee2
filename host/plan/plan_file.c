#include "plan/plan_file.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <yaml.h>

#include "description/yaml_file.h"
#include "program/output_file.h"
#include "units/units.h"

#define QUANTITY_MOST 63
#define STEP_TONES_MOST 32
#define DEGREES (180.0 / M_PI)

#define OPTIONAL CYAML_FLAG_OPTIONAL
#define OPTIONAL_POINTER (CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL)

/* --- the file, as libcyaml hands it over --- */

struct yaml_tone {
    int *chambers;
    unsigned chambers_count;
    char *amplitude;
    char *mean;
    char *period;
    char *phase; /* NULL: 0deg */
};

struct yaml_step {
    char *length;
    char **pressure; /* of the six kinds, one is there */
    char **ramp_to;
    char *bend;
    char *toward;
    char *co_contraction;
    struct yaml_tone *sine;
    struct yaml_tone *sines;
    unsigned sines_count;
    bool *vent;
};

struct yaml_plan {
    char *module;
    char *note;
    struct yaml_step *steps;
    unsigned steps_count;
};

static const cyaml_schema_value_t quantity_value = {
    CYAML_VALUE_STRING(CYAML_FLAG_POINTER, char, 1, QUANTITY_MOST)};
static const cyaml_schema_value_t chamber_value = {CYAML_VALUE_INT(CYAML_FLAG_DEFAULT, int)};

static const cyaml_schema_field_t tone_fields[] = {
    CYAML_FIELD_SEQUENCE("chambers", CYAML_FLAG_POINTER, struct yaml_tone, chambers, &chamber_value, 1, 3),
    CYAML_FIELD_STRING_PTR("amplitude", CYAML_FLAG_POINTER, struct yaml_tone, amplitude, 1, QUANTITY_MOST),
    CYAML_FIELD_STRING_PTR("mean", CYAML_FLAG_POINTER, struct yaml_tone, mean, 1, QUANTITY_MOST),
    CYAML_FIELD_STRING_PTR("period", CYAML_FLAG_POINTER, struct yaml_tone, period, 1, QUANTITY_MOST),
    CYAML_FIELD_STRING_PTR("phase", OPTIONAL_POINTER, struct yaml_tone, phase, 1, QUANTITY_MOST),
    CYAML_FIELD_END};
static const cyaml_schema_value_t tone_value = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct yaml_tone, tone_fields)};

static const cyaml_schema_field_t step_fields[] = {
    CYAML_FIELD_STRING_PTR("for", CYAML_FLAG_POINTER, struct yaml_step, length, 1, QUANTITY_MOST),
    CYAML_FIELD_SEQUENCE_FIXED("pressure", OPTIONAL_POINTER, struct yaml_step, pressure, &quantity_value, 3),
    CYAML_FIELD_SEQUENCE_FIXED("ramp_to", OPTIONAL_POINTER, struct yaml_step, ramp_to, &quantity_value, 3),
    CYAML_FIELD_STRING_PTR("bend", OPTIONAL_POINTER, struct yaml_step, bend, 1, QUANTITY_MOST),
    CYAML_FIELD_STRING_PTR("toward", OPTIONAL_POINTER, struct yaml_step, toward, 1, QUANTITY_MOST),
    CYAML_FIELD_STRING_PTR("co_contraction", OPTIONAL_POINTER, struct yaml_step, co_contraction, 1,
                           QUANTITY_MOST),
    CYAML_FIELD_MAPPING_PTR("sine", OPTIONAL_POINTER, struct yaml_step, sine, tone_fields),
    CYAML_FIELD_SEQUENCE("sines", OPTIONAL_POINTER, struct yaml_step, sines, &tone_value, 1, STEP_TONES_MOST),
    CYAML_FIELD_BOOL_PTR("vent", OPTIONAL_POINTER, struct yaml_step, vent),
    CYAML_FIELD_END};
static const cyaml_schema_value_t step_value = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct yaml_step, step_fields)};

static const cyaml_schema_field_t plan_fields[] = {
    CYAML_FIELD_STRING_PTR("module", CYAML_FLAG_POINTER, struct yaml_plan, module, 1,
                           BEND_TABLE_NAME_BYTES - 1),
    CYAML_FIELD_STRING_PTR("note", OPTIONAL_POINTER, struct yaml_plan, note, 0, PLAN_NOTE_BYTES - 1),
    CYAML_FIELD_SEQUENCE("steps", CYAML_FLAG_POINTER, struct yaml_plan, steps, &step_value, 1,
                         PLAN_STEPS_MAX),
    CYAML_FIELD_END};
static const cyaml_schema_value_t plan_value = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct yaml_plan, plan_fields)};

/* --- lines --- */

static yaml_node_t *child(yaml_document_t *document, const yaml_node_t *mapping, const char *key,
                          yaml_node_t **key_node) {
    const yaml_node_pair_t *pair = mapping->data.mapping.pairs.start;
    for (; mapping->type == YAML_MAPPING_NODE && pair < mapping->data.mapping.pairs.top; pair++) {
        yaml_node_t *node = yaml_document_get_node(document, pair->key);
        if (node->type == YAML_SCALAR_NODE && strcmp((const char *)node->data.scalar.value, key) == 0) {
            *key_node = node;
            return yaml_document_get_node(document, pair->value);
        }
    }
    return NULL;
}

/* A key of a step, or of its sine; of several sines, their own. */
static yaml_node_t *find_key(yaml_document_t *document, yaml_node_t *step, const char *key) {
    yaml_node_t *found = NULL, *at = NULL;
    if (child(document, step, key, &found) == NULL) {
        const yaml_node_t *sine = child(document, step, "sine", &at);
        if (sine != NULL) {
            (void)child(document, sine, key, &found);
        } else {
            (void)child(document, step, "sines", &found);
        }
    }
    return found;
}

static size_t line_in(yaml_document_t *document, size_t step, const char *key) {
    yaml_node_t *root = yaml_document_get_root_node(document), *at = NULL;
    if (root == NULL) {
        return 0;
    }
    if (strcmp(key, "module") == 0) {
        return child(document, root, key, &at) != NULL ? at->start_mark.line + 1 : 0;
    }
    const yaml_node_t *steps = child(document, root, "steps", &at);
    if (steps == NULL || steps->type != YAML_SEQUENCE_NODE ||
        steps->data.sequence.items.top - steps->data.sequence.items.start <= (ptrdiff_t)step) {
        return at == NULL ? 0 : at->start_mark.line + 1;
    }
    yaml_node_t *own = yaml_document_get_node(document, steps->data.sequence.items.start[step]);
    yaml_node_t *found = find_key(document, own, key);
    return (found != NULL ? found : own)->start_mark.line + 1;
}

/* Line of a key of a step, else of the step, or of the module; 0: not found. */
static size_t line_of(const char *path, size_t step, const char *key) {
    yaml_parser_t parser;
    yaml_document_t document;
    size_t line = 0;
    FILE *file = fopen(path, "r");
    if (file == NULL) {
        return 0;
    }
    if (yaml_parser_initialize(&parser)) {
        yaml_parser_set_input_file(&parser, file);
        if (yaml_parser_load(&parser, &document)) {
            line = line_in(&document, step, key);
            yaml_document_delete(&document);
        }
        yaml_parser_delete(&parser);
    }
    (void)fclose(file);
    return line;
}

/* --- from the file to a plan --- */

struct reader {
    const char *path;
    size_t step;
    char *error;
    size_t error_bytes;
};

static bool reject(const struct reader *reader, const char *key, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
static bool reject(const struct reader *reader, const char *key, const char *format, ...) {
    const int length = snprintf(reader->error, reader->error_bytes, "%s:%zu: %s: ", reader->path,
                                line_of(reader->path, reader->step, key), key);
    const size_t used = length < 0 ? 0 : (size_t)length;
    va_list arguments;
    va_start(arguments, format);
    if (used < reader->error_bytes) {
        (void)vsnprintf(reader->error + used, reader->error_bytes - used, format, arguments);
    }
    va_end(arguments);
    return false;
}

/* NULL is 0. */
static bool quantity(const struct reader *reader, const char *key, enum units_kind kind, const char *text,
                     double *value) {
    char why[PLAN_TEXT_BYTES];
    *value = 0.0;
    if (text != NULL && !units_parse(kind, text, value, why, sizeof why)) {
        return reject(reader, key, "%s", why);
    }
    return true;
}

static bool take_pressures(const struct reader *reader, const char *key, char *const *text,
                           double pressure_pa[3]) {
    bool sound = true;
    for (size_t c = 0; c < 3 && sound; c++) {
        sound = quantity(reader, key, UNITS_PRESSURE, text[c], &pressure_pa[c]);
    }
    return sound;
}

static bool take_tone(const struct reader *reader, const struct yaml_tone *yaml, struct plan_tone *tone) {
    *tone = (struct plan_tone){.mean_pa = 0.0};
    for (unsigned i = 0; i < yaml->chambers_count; i++) {
        if (yaml->chambers[i] < 1 || yaml->chambers[i] > 3) {
            return reject(reader, "chambers", "there is no chamber %d; there are 1, 2 and 3",
                          yaml->chambers[i]);
        }
        tone->chamber[yaml->chambers[i] - 1] = true;
    }
    return quantity(reader, "amplitude", UNITS_PRESSURE, yaml->amplitude, &tone->amplitude_pa) &&
           quantity(reader, "mean", UNITS_PRESSURE, yaml->mean, &tone->mean_pa) &&
           quantity(reader, "period", UNITS_TIME, yaml->period, &tone->period_s) &&
           quantity(reader, "phase", UNITS_ANGLE, yaml->phase, &tone->phase_rad);
}

static bool add_sines(const struct reader *reader, const struct yaml_step *yaml, double length_s,
                      struct plan *plan) {
    const struct yaml_tone *from = yaml->sine != NULL ? yaml->sine : yaml->sines;
    const size_t count = yaml->sine != NULL ? 1 : yaml->sines_count;
    struct plan_tone tone[STEP_TONES_MOST];
    for (size_t i = 0; i < count; i++) {
        if (!take_tone(reader, &from[i], &tone[i])) {
            return false;
        }
    }
    return plan_add_sine(plan, length_s, tone, count) ||
           reject(reader, "sines", "a plan has room for %d sines", PLAN_TONES_MAX);
}

static bool add_bend(const struct reader *reader, const struct yaml_step *yaml, double length_s,
                     struct plan *plan) {
    double bend_rad, direction_rad, co_contraction_pa;
    return quantity(reader, "bend", UNITS_ANGLE, yaml->bend, &bend_rad) &&
           quantity(reader, "toward", UNITS_ANGLE, yaml->toward, &direction_rad) &&
           quantity(reader, "co_contraction", UNITS_PRESSURE, yaml->co_contraction, &co_contraction_pa) &&
           plan_add_bend(plan, length_s, bend_rad, direction_rad, co_contraction_pa);
}

/* A step has one kind, and no key of another. */
static bool check_keys(const struct reader *reader, const struct yaml_step *yaml) {
    const int kinds = (yaml->pressure != NULL) + (yaml->ramp_to != NULL) + (yaml->bend != NULL) +
                      (yaml->sine != NULL) + (yaml->sines != NULL) + (yaml->vent != NULL);
    if (kinds != 1) {
        return reject(
            reader, "for",
            "a step has one of pressure, ramp_to, bend, sine, sines and vent; this one has %d of them",
            kinds);
    }
    if (yaml->bend == NULL && (yaml->toward != NULL || yaml->co_contraction != NULL)) {
        return reject(reader, yaml->toward != NULL ? "toward" : "co_contraction", "only a bend has this key");
    }
    if (yaml->vent != NULL && !*yaml->vent) {
        return reject(reader, "vent", "write true; a step that does not vent has another key");
    }
    return true;
}

static bool take_step(const struct reader *reader, const struct yaml_step *yaml, struct plan *plan) {
    double length_s, pressure_pa[3];
    if (!check_keys(reader, yaml) || !quantity(reader, "for", UNITS_TIME, yaml->length, &length_s)) {
        return false;
    }
    if (yaml->pressure != NULL) {
        return take_pressures(reader, "pressure", yaml->pressure, pressure_pa) &&
               plan_add_pressure(plan, length_s, pressure_pa);
    }
    if (yaml->ramp_to != NULL) {
        return take_pressures(reader, "ramp_to", yaml->ramp_to, pressure_pa) &&
               plan_add_ramp(plan, length_s, pressure_pa);
    }
    if (yaml->sine != NULL || yaml->sines != NULL) {
        return add_sines(reader, yaml, length_s, plan);
    }
    return yaml->bend != NULL ? add_bend(reader, yaml, length_s, plan) : plan_add_vent(plan, length_s);
}

static bool take_plan(struct reader *reader, const struct yaml_plan *yaml, const struct bend_table *table,
                      struct plan *plan) {
    struct plan_fault fault;
    plan_init(plan, yaml->module, yaml->note != NULL ? yaml->note : "");
    if (strcmp(yaml->module, table->module.name) != 0) {
        return reject(
            reader, "module",
            "the plan is for module %s, but the table is of module %s: give that module's table with --table",
            yaml->module, table->module.name);
    }
    for (; reader->step < yaml->steps_count; reader->step++) {
        if (!take_step(reader, &yaml->steps[reader->step], plan)) {
            return false;
        }
    }
    if (!plan_check(plan, table, &fault)) {
        reader->step = fault.step;
        return reject(reader, fault.key, "%s", fault.text);
    }
    return true;
}

bool plan_read(const char *path, const struct bend_table *table, struct plan *plan, char *error,
               size_t error_bytes) {
    struct reader reader = {path, 0, error, error_bytes};
    struct description_error why;
    void *data = NULL;
    if (!yaml_file_load(path, &plan_value, &data, &why)) {
        (void)snprintf(error, error_bytes, "%s", why.text);
        return false;
    }
    const bool sound = take_plan(&reader, data, table, plan);
    (void)cyaml_free(&yaml_config, &plan_value, data, 0);
    return sound;
}

/* --- from a plan to a file --- */

/* In double quotes; what would end them or the line is left out. */
static void write_text(FILE *out, const char *key, const char *text) {
    fprintf(out, "%s: \"", key);
    for (; *text != '\0'; text++) {
        fputc(strchr("\"\\\n\r\t", *text) != NULL ? ' ' : *text, out);
    }
    fprintf(out, "\"\n");
}

static void write_pressures(FILE *out, const char *key, const double pressure_pa[3]) {
    fprintf(out, "%s: [%.6gmbar, %.6gmbar, %.6gmbar]", key, 1e-2 * pressure_pa[0], 1e-2 * pressure_pa[1],
            1e-2 * pressure_pa[2]);
}

static void write_tone(FILE *out, const struct plan_tone *tone) {
    const char *before = "";
    fprintf(out, "{ chambers: [");
    for (size_t c = 0; c < 3; c++) {
        if (tone->chamber[c]) {
            fprintf(out, "%s%zu", before, c + 1);
            before = ", ";
        }
    }
    fprintf(out, "], amplitude: %.6gmbar, mean: %.6gmbar, period: %.6gs, phase: %.6gdeg }",
            1e-2 * tone->amplitude_pa, 1e-2 * tone->mean_pa, tone->period_s, DEGREES * tone->phase_rad);
}

static void write_sines(FILE *out, const struct plan *plan, const struct plan_step *step) {
    fprintf(out, "  - for: %.6gs\n    %s:", step->length_s, step->tones == 1 ? "sine" : "sines");
    for (size_t i = 0; i < step->tones; i++) {
        fprintf(out, step->tones == 1 ? " " : "\n      - ");
        write_tone(out, &plan->tone[step->first_tone + i]);
    }
    fputc('\n', out);
}

static void write_step(FILE *out, const struct plan *plan, const struct plan_step *step) {
    if (step->kind == PLAN_SINE) {
        write_sines(out, plan, step);
        return;
    }
    fprintf(out, "  - { for: %.6gs, ", step->length_s);
    if (step->kind == PLAN_BEND) {
        fprintf(out, "bend: %.6gdeg, toward: %.6gdeg, co_contraction: %.6gmbar", DEGREES * step->bend_rad,
                DEGREES * step->direction_rad, 1e-2 * step->co_contraction_pa);
    } else if (step->kind == PLAN_VENT) {
        fprintf(out, "vent: true");
    } else {
        write_pressures(out, step->kind == PLAN_RAMP ? "ramp_to" : "pressure", step->pressure_pa);
    }
    fprintf(out, " }\n");
}

bool plan_write(const char *path, const struct plan *plan, char *error, size_t error_bytes) {
    struct output_file file;
    if (!output_file_open(&file, path, error, error_bytes)) {
        return false;
    }
    fprintf(file.stream, "# %.4g s; follow it with: tribend run PLAN.yaml --record RUN.csv\n",
            plan_length_s(plan));
    write_text(file.stream, "module", plan->module);
    write_text(file.stream, "note", plan->note);
    fprintf(file.stream, "steps:\n");
    for (size_t i = 0; i < plan->steps; i++) {
        write_step(file.stream, plan, &plan->step[i]);
    }
    return output_file_commit(&file, error, error_bytes);
}
