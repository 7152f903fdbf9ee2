/* `tribend effects`: what one may add to the simulated module, and what each leaves in a recording. */
#include <argp.h>
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
}

int cli_effects(int argc, char **argv) {
    const struct argp parser = {NULL, NULL, NULL,
                                "List the effects that --effect adds to the simulated module and that `tribend gap` looks for.\v"
                                "Example: tribend effects",
                                NULL, NULL, NULL};
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, NULL) != 0) {
        return EXIT_USAGE;
    }
    for (size_t i = 0; i < effect_kind_count(); i++) {
        print_kind(effect_kind_at(i));
    }
    printf("every effect also takes onset=SECONDS: nothing happens before\n");
    return EXIT_OK;
}
