/* Following commands that change with time: what a plan is to run_command()'s one command. */
#ifndef TRIBEND_RUN_COURSE_H
#define TRIBEND_RUN_COURSE_H

#include "cli/commands.h"

struct run_course {
    const void *context;
    /* What is commanded so long after the controller was ready. */
    void (*command_at)(const void *context, double since_s, struct controller_command *command);
    const struct controller_command
        *steady;      /* where it is one command all the time: how well it was followed is summed up */
    const char *plan; /* its file; NULL where there is none */
    const char *note; /* stands before what the log's note says of the bus */
};

/* Follow `course` for the options' duration, vent, say how it went; returns an exit code. */
int run_course(const struct bus_options *options, const struct run_course *course);

#endif
