/* Who may command from the page, and until when: one page at a time, for as long as it says so again, and no
 * longer than people touch it. Pure: time comes in, the command to send goes out. Not here: requests
 * (view_request.h), the link (view_pump.h). Units: rad, Pa, us. */
#ifndef TRIBEND_VIEW_ARM_H
#define TRIBEND_VIEW_ARM_H

#include "control/controller.h"

#define VIEW_PAGE_BYTES 40u
#define VIEW_REPEAT_US 100000 /* a command is repeated so often */

struct view_arm_parameters {
    int64_t lease_us; /* a page that is silent for so long loses the arm, and the module vents */
    int64_t idle_us;  /* so does one on which nothing was changed */
};

enum view_arm_end {
    VIEW_ARM_NEVER = 0, /* not armed yet */
    VIEW_ARM_DISARMED,
    VIEW_ARM_VENTED,
    VIEW_ARM_SILENT, /* the lease ran out */
    VIEW_ARM_GONE,   /* the page's event stream ended */
    VIEW_ARM_IDLE,
    VIEW_ARM_FAULT, /* the controller is in FAULT */
    VIEW_ARM_LOST   /* nothing came from the controller */
};

struct view_arm {
    struct view_arm_parameters parameters;
    bool armed;
    char page[VIEW_PAGE_BYTES]; /* that holds the arm */
    int64_t heard_us;           /* when the page last spoke, */
    int64_t changed_us;         /* and last said something new */
    int64_t vent_until_us;
    int64_t next_send_us;
    bool clear; /* asked for, not sent yet */
    struct controller_command wanted;
    enum view_arm_end end;
};

void view_arm_init(struct view_arm *arm, const struct view_arm_parameters *parameters);
/* False: another page holds it. */
bool view_arm_take(struct view_arm *arm, const char *page, int64_t time_us);
/* Command, and keep the arm; false: this page does not hold it. */
bool view_arm_command(struct view_arm *arm, const char *page, const struct controller_command *command,
                      int64_t time_us);
/* The page's stream ended, or it gave the arm back; nothing, where it does not hold it. */
void view_arm_release(struct view_arm *arm, const char *page, enum view_arm_end end, int64_t time_us);
/* Nothing came from the controller for long: whoever holds the arm loses it. */
void view_arm_lose(struct view_arm *arm, int64_t time_us);
/* Vent, whoever holds the arm. */
void view_arm_vent(struct view_arm *arm, int64_t time_us);
void view_arm_clear(struct view_arm *arm);
/* What is to be sent now; false: nothing. */
bool view_arm_step(struct view_arm *arm, enum supervisor_state state, int64_t time_us,
                   struct controller_command *command);
/* Why nobody is armed, for people; never NULL. */
const char *view_arm_end_text(enum view_arm_end end);

#endif
