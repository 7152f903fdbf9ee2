/* Writes docs/faults.md from faults.def to standard output; a test compares the two. Numbers are those of the default
 * parameters. */
#include <stdio.h>

#include "control/controller.h"

static const char head[] =
    "# Faults and warnings\n"
    "\n"
    "This page is made from `firmware/safety/faults.def` (`make docs-faults`), the table that the firmware is built from too.\n"
    "`tribend status` prints the titles below. Numbers are the defaults for the founding paper's module; most are parameters.\n"
    "\n"
    "**A fault** latches: all valves vent and the supply is shut in the step that sees it, and the state is FAULT until somebody\n"
    "clears it (`tribend clear`). A clear is refused while the cause is there and for 0.1 s after, and within 0.5 s after\n"
    "another clear, so that a stream of clears clears nothing. It leads to the self-test (no chamber over 2 kPa) and then to\n"
    "SAFE. Nothing moves by that: a host that went on sending motion commands is refused until it has paused for 0.5 s; then a\n"
    "new command starts the module. The same holds after the board was switched on or restarted: its first self-test lasts\n"
    "0.5 s, and a command that came meanwhile counts as part of such a stream.\n"
    "\n"
    "**A warning** is reported and degrades what it says.\n"
    "\n"
    "Whatever leaves pressure uncontrolled or unseen is a fault, because people stand next to the module. The last line of each\n"
    "row says why it is the one or the other.\n"
    "\n"
    "`make campaign` measures all of them, alone and in pairs.\n";

static void begin(const char *name, const char *title, const char *sees, const char *detector) {
    printf("\n### %s\n\n%s\n\n- **name** `%s`\n- **detector** %s\n- **limit** ", title, sees, name, detector);
}

static void end(const char *time, const char *last_name, const char *last, const char *remedy, const char *why_name,
                const char *why) {
    printf("\n- **time to react** %s\n- **%s** %s\n- **what to do** %s\n- **%s** %s\n", time, last_name, last, remedy,
           why_name, why);
}

int main(void) {
    struct controller_parameters parameters;
    const struct controller_parameters *p = &parameters;
    controller_default_parameters(&parameters, NULL);
    fputs(head, stdout);
    puts("\n## Faults");
#define FAULT(NAME, title, sees, detector, limit, time, clear, remedy, why)                                         \
    begin("FAULT_" #NAME, title, sees, detector);                                                                  \
    printf limit;                                                                                                  \
    end(time, "can be cleared once", clear, remedy, "why it latches", why);
#include "safety/faults.def"
    puts("\n## Warnings");
#define WARNING(NAME, title, sees, detector, limit, time, reaction, remedy, why)                                    \
    begin("WARNING_" #NAME, title, sees, detector);                                                                \
    printf limit;                                                                                                  \
    end(time, "reaction", reaction, remedy, "why it does not latch", why);
#include "safety/faults.def"
    return 0;
}
