/* `tribend effects`: what one may add to the simulated module, and what each leaves in a recording. */
#include <argp.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

#include "cli/commands.h"

static void print_kind(const struct effect_kind *kind) {
    printf("%s  (%s%s)\n    %s\n    seen as: %s\n", kind->name, effect_stage_name(kind->stage),
           kind->scope == EFFECT_GLOBAL        ? ""
           : kind->scope == EFFECT_ONE_CHAMBER ? ", of one chamber: chamber=1..3"
                                               : ", of all chambers or one: chamber=0..3",
           kind->what, kind->signature);
    for (size_t i = 0; i < kind->parameter_count; i++) {
        const struct effect_parameter *parameter = &kind->parameter[i];
        printf("    %-18s %g to %g%s%s, typically %g\n", parameter->name, parameter->least, parameter->most,
               strcmp(parameter->unit, "1") == 0 ? "" : " ", strcmp(parameter->unit, "1") == 0 ? "" : parameter->unit,
               parameter->typical);
    }
    if (kind->remembers) {
        printf("    %-18s 0 or 1, with an onset: what it remembers runs from the start, unseen\n", "latent");
    }
}

static json_t *parameters_json(const struct effect_kind *kind) {
    json_t *array = json_array();
    for (size_t i = 0; i < kind->parameter_count; i++) {
        const struct effect_parameter *parameter = &kind->parameter[i];
        json_t *object = json_object();
        (void)json_object_set_new(object, "name", json_string(parameter->name));
        (void)json_object_set_new(object, "unit", json_string(parameter->unit));
        (void)json_object_set_new(object, "least", json_real(parameter->least));
        (void)json_object_set_new(object, "most", json_real(parameter->most));
        (void)json_object_set_new(object, "typical", json_real(parameter->typical));
        (void)json_array_append_new(array, object);
    }
    return array;
}

static json_t *kind_json(const struct effect_kind *kind) {
    json_t *object = json_object();
    (void)json_object_set_new(object, "name", json_string(kind->name));
    (void)json_object_set_new(object, "stage", json_string(effect_stage_name(kind->stage)));
    (void)json_object_set_new(object, "chambers",
                              json_string(kind->scope == EFFECT_GLOBAL        ? "none"
                                          : kind->scope == EFFECT_ONE_CHAMBER ? "one"
                                                                              : "all or one"));
    (void)json_object_set_new(object, "what", json_string(kind->what));
    (void)json_object_set_new(object, "signature", json_string(kind->signature));
    (void)json_object_set_new(object, "remembers", json_boolean(kind->remembers));
    (void)json_object_set_new(object, "parameters", parameters_json(kind));
    return object;
}

static int print_json(void) {
    json_t *array = json_array();
    for (size_t i = 0; i < effect_kind_count(); i++) {
        (void)json_array_append_new(array, kind_json(effect_kind_at(i)));
    }
    const int failed = json_dumpf(array, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    json_decref(array);
    printf("\n");
    return failed == 0 ? EXIT_OK : program_fail(EXIT_OUTPUT, "cannot write to standard output");
}

static const struct argp_option options[] = {{"json", 'j', NULL, 0, "for programs: a JSON array", 0}, {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    bool *json = state->input;
    switch (key) {
    case 'j':
        *json = true;
        return 0;
    case ARGP_KEY_ARG:
        argp_error(state, "effects takes no argument, '%s' is too much", argument);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

int cli_effects(int argc, char **argv) {
    const struct argp parser = {options, parse, "",
                                "List the effects that --effect adds to the simulated module and that `tribend gap` looks for.\v"
                                "Examples:\n"
                                "  tribend effects\n"
                                "  tribend effects --json",
                                NULL, NULL, NULL};
    bool json = false;
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &json) != 0) {
        return EXIT_USAGE;
    }
    if (json) {
        return print_json();
    }
    for (size_t i = 0; i < effect_kind_count(); i++) {
        print_kind(effect_kind_at(i));
    }
    printf("every effect also takes onset=SECONDS: nothing happens before\n");
    return EXIT_OK;
}
