#include "program/program.h"

#include <errno.h>
#include <libgen.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "program/version.h"

volatile sig_atomic_t program_interrupted = 0;

static const char *program_name = "tribend";

static void on_interrupt(int signal_number) {
    (void)signal_number;
    program_interrupted = 1;
}

void program_catch_interrupt(void) {
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_interrupt;
    action.sa_flags = (int)SA_RESETHAND;
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
}

int program_fail(int code, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    (void)fflush(stdout); /* in the order in which it happened */
    fprintf(stderr, "%s: ", program_name);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    return code;
}

static bool find_beside(const char *folder, const char *between, const char *relative,
                        char path[PROGRAM_PATH_BYTES]) {
    char beside[2 * PROGRAM_PATH_BYTES];
    (void)snprintf(beside, sizeof beside, "%s%s/%s", folder, between, relative);
    if (access(beside, R_OK) != 0 || strlen(beside) >= PROGRAM_PATH_BYTES) {
        return false;
    }
    memcpy(path, beside, strlen(beside) + 1);
    return true;
}

void program_find(const char *relative, char path[PROGRAM_PATH_BYTES]) {
    static const char *const between[] = {"", "/..", "/../share/tribend"};
    char program[PROGRAM_PATH_BYTES];
    (void)snprintf(path, PROGRAM_PATH_BYTES, "%s", relative);
    const ssize_t count = readlink("/proc/self/exe", program, sizeof program - 1);
    if (access(path, R_OK) == 0 || count <= 0) {
        return;
    }
    program[count] = '\0';
    const char *folder = dirname(program);
    for (size_t i = 0; i < sizeof between / sizeof between[0]; i++) {
        if (find_beside(folder, between[i], relative, path)) {
            return;
        }
    }
}

static void print_help(FILE *stream, const struct program_subcommand *subcommands, size_t count) {
    fprintf(stream, "Usage: %s SUBCOMMAND ...\n\n", program_name);
    for (size_t i = 0; i < count; i++) {
        fprintf(stream, "  %-10s %s\n", subcommands[i].name, subcommands[i].what);
    }
    fprintf(stream, "\n`%s SUBCOMMAND --help` lists its options.\n", program_name);
}

int program_run(const char *name, const struct program_subcommand *subcommands, size_t count, int argc, char **argv) {
    program_name = name;
    if (argc < 2 || strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "help") == 0) {
        print_help(argc < 2 ? stderr : stdout, subcommands, count);
        return argc < 2 ? EXIT_USAGE : EXIT_OK;
    }
    if (strcmp(argv[1], "--version") == 0) {
        printf("%s " TRIBEND_VERSION "\n", name);
        return EXIT_OK;
    }
    for (size_t i = 0; i < count; i++) {
        if (strcmp(argv[1], subcommands[i].name) == 0) {
            char with_subcommand[64];
            (void)snprintf(with_subcommand, sizeof with_subcommand, "%s %s", name, subcommands[i].name);
            argv[1] = with_subcommand;
            const int code = subcommands[i].run(argc - 1, argv + 1);
            return fflush(stdout) == 0
                       ? code
                       : program_fail(EXIT_OUTPUT, "cannot write to standard output: %s", strerror(errno));
        }
    }
    (void)program_fail(EXIT_USAGE, "there is no subcommand '%s'", argv[1]);
    print_help(stderr, subcommands, count);
    return EXIT_USAGE;
}

int64_t program_now_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}
