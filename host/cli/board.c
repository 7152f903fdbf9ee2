/* tribend board: hands over to tribend-board, which lies beside this program. */
#include <errno.h>
#include <libgen.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "cli/commands.h"

#define PROGRAM "tribend-board"

int cli_board(int argc, char **argv) {
    char own[PROGRAM_PATH_BYTES], path[PROGRAM_PATH_BYTES + sizeof PROGRAM];
    const ssize_t length = readlink("/proc/self/exe", own, sizeof own - 1);
    (void)argc;
    if (length <= 0) {
        return program_fail(EXIT_OUTPUT, "cannot tell where this program is: %s", strerror(errno));
    }
    own[length] = '\0';
    (void)snprintf(path, sizeof path, "%s/" PROGRAM, dirname(own));
    execv(path, argv);
    return program_fail(EXIT_OUTPUT, "%s: %s (`make all` builds it)", path, strerror(errno));
}
