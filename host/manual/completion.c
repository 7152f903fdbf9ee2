#include <ctype.h>
#include <string.h>

#include "manual/manual.h"
#include "sim/effect.h"

static void put_effects(FILE *out) {
    for (size_t i = 0; i < effect_kind_count(); i++) {
        fprintf(out, "%s%s", i > 0 ? " " : "", effect_kind_at(i)->name);
    }
}

static void put_function_name(FILE *out, const char *program) {
    fputc('_', out);
    for (; *program != '\0'; program++) {
        fputc(isalnum((unsigned char)*program) ? *program : '_', out);
    }
}

/* What may follow an option that takes a value: by its name, else whatever is there as a file. */
static void put_values(FILE *out, const struct argp_option *option) {
    if (strcmp(option->name, "effect") == 0 || strcmp(option->name, "without") == 0) {
        fputs("words='", out);
        put_effects(out);
        fputs("'", out);
    } else if (strcmp(option->name, "bus") == 0) {
        fputs("words=\"sim $(ls /sys/class/net 2>/dev/null | grep can)\"", out);
    } else {
        fputs("return 0", out); /* bash's own: files */
    }
}

static bool is_short(const struct argp_option *option) {
    return option->key > 0 && option->key < 0x80 && isgraph(option->key);
}

static void put_value_cases(FILE *out, const struct manual_command *command) {
    for (size_t i = 0; i < command->options; i++) {
        const struct argp_option *option = &command->option[i];
        if (!manual_is_option(option) || option->arg == NULL) {
            continue;
        }
        fprintf(out, "    '%s --%s'", command->path, option->name);
        if (is_short(option)) {
            fprintf(out, " | '%s -%c'", command->path, option->key);
        }
        fputs(") ", out);
        put_values(out, option);
        fputs(" ;;\n", out);
    }
}

static void put_words_of(FILE *out, const struct manual *manual, const struct manual_command *command) {
    fprintf(out, "    '%s') words='", command->path);
    for (size_t i = 0; i < manual->commands; i++) {
        if (manual_is_below(&manual->command[i], command)) {
            fprintf(out, "%s ", strrchr(manual->command[i].path, ' ') + 1);
        }
    }
    for (size_t i = 0; i < command->options; i++) {
        if (manual_is_option(&command->option[i])) {
            fprintf(out, "--%s ", command->option[i].name);
        }
    }
    fputs("--help' ;;\n", out);
}

static void put_paths(FILE *out, const struct manual *manual) {
    for (size_t i = 1; i < manual->commands; i++) {
        fprintf(out, "%s'%s'", i > 1 ? " | " : "        ", manual->command[i].path);
    }
    fputs(") path=\"$path ${COMP_WORDS[i]}\" ;;\n", out);
}

void manual_write_completion(FILE *out, const struct manual *manual) {
    const char *program = manual->command[0].path;
    fprintf(out, "# bash completion for %s; made from its option tables\n", program);
    put_function_name(out, program);
    fprintf(
        out,
        "() {\n    local i words= path=%s cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]}\n",
        program);
    fputs("    COMPREPLY=()\n"
          "    for ((i = 1; i < COMP_CWORD; i++)); do\n        case \"$path ${COMP_WORDS[i]}\" in\n",
          out);
    put_paths(out, manual);
    fputs("        esac\n    done\n"
          "    # --option=value is three words\n"
          "    [ \"$cur\" != = ] || cur=\n"
          "    [ \"$prev\" != = ] || prev=${COMP_WORDS[COMP_CWORD - 2]}\n"
          "    case \"$path $prev\" in\n",
          out);
    for (size_t i = 1; i < manual->commands; i++) {
        put_value_cases(out, &manual->command[i]);
    }
    fputs("    *)\n    case \"$path\" in\n", out);
    for (size_t i = 0; i < manual->commands; i++) {
        put_words_of(out, manual, &manual->command[i]);
    }
    fputs("    esac ;;\n    esac\n    # shellcheck disable=SC2207\n    COMPREPLY=($(compgen -W \"$words\" -- "
          "\"$cur\"))\n}\n",
          out);
    fputs("complete -o default -F ", out);
    put_function_name(out, program);
    fprintf(out, " %s\n", program);
}
