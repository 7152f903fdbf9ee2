#include "view/view_arm.h"

#include <stdio.h>
#include <string.h>

#define VENT_US 1000000 /* a vent is repeated for so long */

void view_arm_init(struct view_arm *arm, const struct view_arm_parameters *parameters) {
    memset(arm, 0, sizeof *arm);
    arm->parameters = *parameters;
}

static bool holds(const struct view_arm *arm, const char *page) {
    return arm->armed && strcmp(arm->page, page) == 0;
}

bool view_arm_take(struct view_arm *arm, const char *page, int64_t time_us) {
    if (arm->armed && !holds(arm, page)) {
        return false;
    }
    (void)snprintf(arm->page, sizeof arm->page, "%s", page);
    arm->armed = true;
    arm->wanted = (struct controller_command){.kind = COMMAND_NONE};
    arm->heard_us = time_us;
    arm->changed_us = time_us;
    arm->vent_until_us = 0;
    return true;
}

static bool is_same(const struct controller_command *a, const struct controller_command *b) {
    return a->kind == b->kind && a->bend_rad == b->bend_rad && a->direction_rad == b->direction_rad &&
           a->co_contraction_pa == b->co_contraction_pa;
}

bool view_arm_command(struct view_arm *arm, const char *page, const struct controller_command *command,
                      int64_t time_us) {
    if (!holds(arm, page)) {
        return false;
    }
    arm->heard_us = time_us;
    if (!is_same(&arm->wanted, command)) {
        arm->wanted = *command;
        arm->changed_us = time_us;
        arm->next_send_us = time_us;
    }
    return true;
}

static void end_by(struct view_arm *arm, enum view_arm_end end, int64_t time_us) {
    arm->armed = false;
    arm->end = end;
    arm->vent_until_us = time_us + VENT_US;
    arm->next_send_us = time_us;
}

void view_arm_release(struct view_arm *arm, const char *page, enum view_arm_end end, int64_t time_us) {
    if (holds(arm, page)) {
        end_by(arm, end, time_us);
    }
}

void view_arm_lose(struct view_arm *arm, int64_t time_us) {
    if (arm->armed) {
        end_by(arm, VIEW_ARM_LOST, time_us);
    }
}

void view_arm_vent(struct view_arm *arm, int64_t time_us) {
    end_by(arm, VIEW_ARM_VENTED, time_us);
}

void view_arm_clear(struct view_arm *arm) {
    arm->clear = true;
}

static void expire(struct view_arm *arm, enum supervisor_state state, int64_t time_us) {
    if (!arm->armed) {
        return;
    }
    if (state == SUPERVISOR_FAULT) {
        end_by(arm, VIEW_ARM_FAULT, time_us);
    } else if (time_us - arm->heard_us > arm->parameters.lease_us) {
        end_by(arm, VIEW_ARM_SILENT, time_us);
    } else if (time_us - arm->changed_us > arm->parameters.idle_us) {
        end_by(arm, VIEW_ARM_IDLE, time_us);
    }
}

bool view_arm_step(struct view_arm *arm, enum supervisor_state state, int64_t time_us,
                   struct controller_command *command) {
    expire(arm, state, time_us);
    if (time_us < arm->next_send_us) {
        return false;
    }
    arm->next_send_us = time_us + VIEW_REPEAT_US;
    if (time_us < arm->vent_until_us) {
        *command = (struct controller_command){.kind = COMMAND_VENT};
    } else if (arm->clear) {
        *command = (struct controller_command){.kind = COMMAND_CLEAR};
        arm->clear = false;
    } else if (arm->armed && arm->wanted.kind != COMMAND_NONE) {
        *command = arm->wanted;
    } else {
        return false;
    }
    return true;
}

const char *view_arm_end_text(enum view_arm_end end) {
    switch (end) {
    case VIEW_ARM_DISARMED:
        return "disarmed: vented";
    case VIEW_ARM_VENTED:
        return "vented by hand";
    case VIEW_ARM_SILENT:
        return "the page that was armed fell silent: vented";
    case VIEW_ARM_GONE:
        return "the page that was armed was closed: vented";
    case VIEW_ARM_IDLE:
        return "nothing was changed for long: vented";
    case VIEW_ARM_FAULT:
        return "the controller latched a fault";
    case VIEW_ARM_LOST:
        return "the board fell silent; it vents by itself then";
    case VIEW_ARM_NEVER:
    default:
        return "not armed";
    }
}
