/* Writes one man page a subcommand, NAME.1, and the program's completion into a folder: manual FOLDER. */
#include <errno.h>
#include <string.h>

#include "manual/manual.h"
#include "program/program.h"

static FILE *create(const char *folder, const char *path, const char *ending) {
    char name[PROGRAM_PATH_BYTES];
    (void)snprintf(name, sizeof name, "%s/%s%s", folder, path, ending);
    for (char *at = name + strlen(folder); *at != '\0'; at++) {
        *at = *at == ' ' ? '-' : *at;
    }
    FILE *out = fopen(name, "w");
    if (out == NULL) {
        (void)program_fail(EXIT_OUTPUT, "%s: %s", name, strerror(errno));
    }
    return out;
}

static bool finish(FILE *out) {
    const bool sound = ferror(out) == 0;
    return fclose(out) == 0 && sound;
}

static bool write_pages(const char *folder, const struct manual *manual) {
    for (size_t i = 0; i < manual->commands; i++) {
        FILE *out = create(folder, manual->command[i].path, ".1");
        if (out == NULL) {
            return false;
        }
        manual_write_page(out, manual, &manual->command[i]);
        if (!finish(out)) {
            return false;
        }
    }
    return true;
}

int main(int argc, char **argv) {
    static struct manual manual;
    if (argc != 2) {
        return program_fail(EXIT_USAGE, "usage: manual FOLDER");
    }
    if (!manual_collect(&manual)) {
        return program_fail(EXIT_BAD_INPUT, "the manual was not written");
    }
    FILE *out = write_pages(argv[1], &manual) ? create(argv[1], manual.command[0].path, ".bash") : NULL;
    if (out == NULL) {
        return EXIT_OUTPUT;
    }
    manual_write_completion(out, &manual);
    return finish(out) ? EXIT_OK : EXIT_OUTPUT;
}
