/* `tribend-tables`: from a material to a bend table. One file a subcommand. */
#include <errno.h>
#include <libgen.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cli/cli.h"

struct subcommand {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *what;
};

static const struct subcommand subcommands[] = {
    {"solve", cli_solve, "follow a module's equilibria under pressure, up to a pressure or a bend"},
    {"build", cli_build, "build a module's bend table"},
    {"show", cli_show, "print what a bend table holds"},
    {"plot", cli_plot, "draw a bend table"},
    {"fit", cli_fit, "fit a material law to a tensile test"},
    {"published", cli_published, "hold the solver against the founding paper's figures"}};

volatile sig_atomic_t cli_interrupted = 0;

static void on_interrupt(int signal_number) {
    (void)signal_number;
    cli_interrupted = 1;
}

void cli_catch_interrupt(void) {
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_interrupt;
    action.sa_flags = (int)SA_RESETHAND; /* a second Ctrl-C ends the program at once */
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
}

int cli_fail(int code, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fputs("tribend-tables: ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    return code;
}

void cli_module_path(const char *name, char path[CLI_PATH_BYTES]) {
    const size_t length = strlen(name);
    char program[CLI_PATH_BYTES];
    (void)snprintf(path, CLI_PATH_BYTES, "%s", name);
    if (strchr(name, '/') != NULL || (length > 5 && strcmp(name + length - 5, ".yaml") == 0)) {
        return;
    }
    (void)snprintf(path, CLI_PATH_BYTES, "tables/modules/%s.yaml", name);
    const ssize_t count = readlink("/proc/self/exe", program, sizeof program - 1);
    if (access(path, R_OK) != 0 && count > 0) {
        program[count] = '\0';
        char beside[2 * CLI_PATH_BYTES];
        (void)snprintf(beside, sizeof beside, "%s/../tables/modules/%s.yaml", dirname(program), name);
        if (access(beside, R_OK) == 0 && strlen(beside) < CLI_PATH_BYTES) {
            memcpy(path, beside, strlen(beside) + 1);
        }
    }
}

unsigned char *cli_read_file(const char *path, size_t *size, char *error, size_t error_bytes) {
    FILE *file = fopen(path, "rb");
    unsigned char *bytes = NULL;
    long end = -1;
    if (file != NULL && fseek(file, 0, SEEK_END) == 0) {
        end = ftell(file);
        rewind(file);
    }
    if (end >= 0) {
        bytes = malloc((size_t)end + 1);
    }
    if (bytes != NULL) {
        *size = fread(bytes, 1, (size_t)end, file);
        if (ferror(file) != 0 || *size != (size_t)end) {
            free(bytes);
            bytes = NULL;
        }
    }
    if (bytes == NULL) {
        (void)snprintf(error, error_bytes, "cannot read %s: %s", path, strerror(errno));
    }
    if (file != NULL) {
        (void)fclose(file);
    }
    return bytes;
}

void cli_print_material(const struct material *material) {
    static const char *const laws[] = {"neo-Hookean", "reduced polynomial", "Yeoh"};
    printf("material  %s (%s:", material->name, laws[material->law]);
    for (size_t i = 0; i < material->terms; i++) {
        printf(" C%zu0 = %.6g Pa%s", i + 1, material->coefficient_pa[i], i + 1 < material->terms ? "," : "");
    }
    printf("; bulk modulus %.3g Pa)\n          %s\n", material->bulk_modulus_pa, material->source);
}

static void print_help(FILE *stream) {
    fputs("Usage: tribend-tables SUBCOMMAND ...\n\n", stream);
    for (size_t i = 0; i < sizeof subcommands / sizeof subcommands[0]; i++) {
        fprintf(stream, "  %-10s %s\n", subcommands[i].name, subcommands[i].what);
    }
    fputs("\n`tribend-tables SUBCOMMAND --help` lists its options.\n", stream);
}

int main(int argc, char **argv) {
    if (argc < 2 || strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "help") == 0) {
        print_help(argc < 2 ? stderr : stdout);
        return argc < 2 ? EXIT_USAGE : EXIT_OK;
    }
    for (size_t i = 0; i < sizeof subcommands / sizeof subcommands[0]; i++) {
        if (strcmp(argv[1], subcommands[i].name) == 0) {
            char name[64];
            (void)snprintf(name, sizeof name, "tribend-tables %s", subcommands[i].name);
            argv[1] = name;
            const int code = subcommands[i].run(argc - 1, argv + 1);
            if (fflush(stdout) != 0) {
                return cli_fail(EXIT_OUTPUT, "cannot write to standard output: %s", strerror(errno));
            }
            return code;
        }
    }
    (void)cli_fail(EXIT_USAGE, "there is no subcommand '%s'", argv[1]);
    print_help(stderr);
    return EXIT_USAGE;
}
