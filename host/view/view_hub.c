#include "view/view_hub.h"

#include <string.h>
#include <time.h>

int64_t view_hub_now_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

bool view_hub_open(struct view_hub *hub, const struct bend_table *table, const struct view_words *words,
                   const struct view_arm_parameters *parameters) {
    memset(hub, 0, sizeof *hub);
    hub->table = table;
    hub->words = *words;
    view_arm_init(&hub->arm, parameters);
    return pthread_mutex_init(&hub->lock, NULL) == 0;
}

void view_hub_close(struct view_hub *hub) {
    (void)pthread_mutex_destroy(&hub->lock);
}

static bool publish(struct view_hub *hub, const struct link_report *report, int64_t now_us) {
    if (now_us < hub->next_event_us) {
        return false;
    }
    hub->next_event_us = now_us + VIEW_EVENT_US;
    const size_t length = view_event_report(hub->table, &hub->words, report, &hub->arm, hub->event);
    hub->events_unmade += length == 0 ? 1u : 0u;
    hub->event_length = length;
    hub->sequence += length > 0 ? 1u : 0u;
    return length > 0;
}

bool view_hub_report(struct view_hub *hub, const struct link_report *report, int64_t now_us,
                     struct controller_command *command, bool *fresh) {
    (void)pthread_mutex_lock(&hub->lock);
    hub->state = report->status.state;
    const bool send = view_arm_step(&hub->arm, hub->state, now_us, command);
    *fresh = publish(hub, report, now_us);
    (void)pthread_mutex_unlock(&hub->lock);
    return send;
}

void view_hub_lost(struct view_hub *hub) {
    (void)pthread_mutex_lock(&hub->lock);
    view_arm_lose(&hub->arm, view_hub_now_us());
    (void)pthread_mutex_unlock(&hub->lock);
}

size_t view_hub_event(struct view_hub *hub, uint64_t *sequence, char text[VIEW_EVENT_BYTES]) {
    size_t length = 0;
    (void)pthread_mutex_lock(&hub->lock);
    if (hub->sequence != *sequence && hub->event_length > 0) {
        length = hub->event_length;
        memcpy(text, hub->event, length);
        *sequence = hub->sequence;
    }
    (void)pthread_mutex_unlock(&hub->lock);
    return length;
}

bool view_hub_arm(struct view_hub *hub, const char *page, const char **why) {
    (void)pthread_mutex_lock(&hub->lock);
    bool taken = false;
    if (hub->state == SUPERVISOR_FAULT) {
        *why = "the controller is in FAULT: remove the cause, then clear";
    } else if (hub->sequence == 0) {
        *why = "the controller has not reported yet";
    } else {
        taken = view_arm_take(&hub->arm, page, view_hub_now_us());
        *why = taken ? "" : "another page is armed: disarm or close that one, or vent";
    }
    (void)pthread_mutex_unlock(&hub->lock);
    return taken;
}

bool view_hub_command(struct view_hub *hub, const char *page, const struct controller_command *command,
                      const char **why) {
    (void)pthread_mutex_lock(&hub->lock);
    const bool taken = view_arm_command(&hub->arm, page, command, view_hub_now_us());
    *why = taken ? "" : hub->arm.armed ? "another page is armed" : view_arm_end_text(hub->arm.end);
    (void)pthread_mutex_unlock(&hub->lock);
    return taken;
}

void view_hub_release(struct view_hub *hub, const char *page, enum view_arm_end end) {
    (void)pthread_mutex_lock(&hub->lock);
    view_arm_release(&hub->arm, page, end, view_hub_now_us());
    (void)pthread_mutex_unlock(&hub->lock);
}

void view_hub_vent(struct view_hub *hub) {
    (void)pthread_mutex_lock(&hub->lock);
    view_arm_vent(&hub->arm, view_hub_now_us());
    (void)pthread_mutex_unlock(&hub->lock);
}

void view_hub_clear(struct view_hub *hub) {
    (void)pthread_mutex_lock(&hub->lock);
    view_arm_clear(&hub->arm);
    (void)pthread_mutex_unlock(&hub->lock);
}
