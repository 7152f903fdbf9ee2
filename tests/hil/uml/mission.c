/* A commander on LCM, on liblcm and the generated types alone: bends the module in two steps, then vents.
 *
 *     mission arm SECONDS     arms first, as a commander should; each step until the module is there, and
 *                             three times as long again
 *     mission fly SECONDS     starts without, and goes on with the first step until SECONDS are over; says so
 *                             once it has begun
 *     mission steady SECONDS  arms, and goes on with the first step until SECONDS are over
 *     mission listen SECONDS  commands nothing; prints the bridge's last status
 *     mission get PARAMETER   asks the board for a parameter and prints the answer
 *
 * Not here: what it leads to (lcm_clients.sh). */
#include <inttypes.h>
#include <lcm/lcm.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "tribend_bridge_t.h"
#include "tribend_command_t.h"
#include "tribend_parameter_t.h"
#include "tribend_status_t.h"

#define PERIOD_US 50000
#define MARGIN_US 1000000
#define THERE_URAD 10000 /* 0.6 degrees: the noise of a report */
#define THERE_TIMES 10
#define ARM 0
#define VENT 1
#define BEND 4
#define FIRST_URAD 1047198 /* 60 degrees */
#define SECOND_URAD 610865 /* 35 degrees */
#define DIRECTION_URAD 523599

static int64_t now_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

static bool command(lcm_t *lcm, int kind, int bend_urad) {
    const tribend_command_t message = {
        .utime = now_us(), .kind = (int8_t)kind, .bend_urad = bend_urad, .direction_urad = DIRECTION_URAD};
    return tribend_command_t_publish(lcm, "TRIBEND_COMMAND", &message) == 0;
}

static void on_report(const lcm_recv_buf_t *buffer, const char *channel, const tribend_status_t *report,
                      void *bend) {
    (void)buffer;
    (void)channel;
    *(int32_t *)bend = report->bend_urad;
}

/* Take what has come, for so long. */
static void hear(lcm_t *lcm, int64_t duration_us) {
    const int64_t end_us = now_us() + duration_us;
    for (int64_t left_us = duration_us; left_us > 0; left_us = end_us - now_us()) {
        (void)lcm_handle_timeout(lcm, (int)(left_us / 1000) + 1);
    }
}

/* Until the module has been there for a while, then three times as long again and MARGIN_US: a replay is given
 * more time than it needs, also by a machine that is busier then. */
static bool fly_to(lcm_t *lcm, int32_t target_urad, const int32_t *bend_urad, int64_t limit_us) {
    const int64_t start_us = now_us();
    int64_t end_us = start_us + limit_us;
    int there = 0;
    bool sent = true;
    while (sent && now_us() < end_us) {
        sent = command(lcm, BEND, target_urad);
        hear(lcm, PERIOD_US);
        there = abs(*bend_urad - target_urad) < THERE_URAD ? there + 1 : 0;
        if (there == THERE_TIMES) {
            end_us = now_us() + 3 * (now_us() - start_us) + MARGIN_US;
        }
    }
    return sent && there >= THERE_TIMES;
}

static int fly_steps(lcm_t *lcm, int64_t limit_us) {
    int32_t bend_urad = INT32_MIN / 2;
    (void)tribend_status_t_subscribe(lcm, "TRIBEND_STATUS", on_report, &bend_urad);
    bool done = command(lcm, ARM, 0);
    done = done && fly_to(lcm, FIRST_URAD, &bend_urad, limit_us) &&
           fly_to(lcm, SECOND_URAD, &bend_urad, limit_us);
    return command(lcm, VENT, 0) && done ? 0 : 1;
}

static int fly(lcm_t *lcm, int64_t duration_us) {
    const struct timespec wait = {.tv_nsec = PERIOD_US * 1000};
    const int64_t end_us = now_us() + duration_us;
    bool sent = true;
    for (bool begun = false; sent && now_us() < end_us; begun = true) {
        sent = command(lcm, BEND, FIRST_URAD);
        if (!begun) {
            printf("flying\n");
            (void)fflush(stdout);
        }
        (void)nanosleep(&wait, NULL);
    }
    return sent ? 0 : 1;
}

static void on_status(const lcm_recv_buf_t *buffer, const char *channel, const tribend_bridge_t *status,
                      void *last) {
    (void)buffer;
    (void)channel;
    memcpy(last, status, sizeof *status);
}

static int listen_to(lcm_t *lcm, int64_t duration_us) {
    const int64_t end_us = now_us() + duration_us;
    tribend_bridge_t last = {.utime = 0};
    (void)tribend_bridge_t_subscribe(lcm, "TRIBEND_BRIDGE", on_status, &last);
    while (now_us() < end_us) {
        (void)lcm_handle_timeout(lcm, 100);
    }
    printf("offset_us %" PRId64 "\ndrift_ppb %d\nwindows %d\nheard %d\nopen %d\nflying %" PRId64
           "\nforwarded %" PRId64 "\nreopened %" PRId64 "\nrestarts %" PRId64 "\nsilences %" PRId64 "\n",
           last.clock_offset_us, last.clock_drift_ppb, last.clock_windows, last.board_is_heard,
           last.gate_is_open, last.commands_flying, last.commands_forwarded, last.bus_reopened,
           last.board_restarts, last.board_silences);
    return last.utime > 0 ? 0 : 1;
}

static void on_parameter(const lcm_recv_buf_t *buffer, const char *channel, const tribend_parameter_t *answer,
                         void *last) {
    (void)buffer;
    (void)channel;
    memcpy(last, answer, sizeof *answer);
}

static int get(lcm_t *lcm, int parameter) {
    const tribend_parameter_t request = {.utime = now_us(), .parameter = parameter};
    tribend_parameter_t answer = {.utime = 0};
    (void)tribend_parameter_t_subscribe(lcm, "TRIBEND_PARAMETER", on_parameter, &answer);
    (void)tribend_parameter_t_publish(lcm, "TRIBEND_PARAMETER_REQUEST", &request);
    for (int i = 0; i < 50 && answer.utime == 0; i++) {
        (void)lcm_handle_timeout(lcm, 100);
    }
    printf("parameter %d value %d status %d\n", answer.parameter, answer.value, answer.status);
    return answer.utime > 0 && answer.status == 0 ? 0 : 1;
}

int main(int argc, char **argv) {
    lcm_t *lcm = lcm_create(NULL);
    if (lcm == NULL || argc != 3) {
        fprintf(stderr, "usage: mission arm|fly|steady|listen SECONDS, or mission get PARAMETER\n");
        return 2;
    }
    const double number = strtod(argv[2], NULL);
    int code = 2;
    if (strcmp(argv[1], "get") == 0) {
        code = get(lcm, (int)number);
    } else if (strcmp(argv[1], "listen") == 0) {
        code = listen_to(lcm, (int64_t)(1e6 * number));
    } else if (strcmp(argv[1], "arm") == 0) {
        code = fly_steps(lcm, (int64_t)(1e6 * number));
    } else {
        const bool armed = strcmp(argv[1], "steady") != 0 || command(lcm, ARM, 0);
        code = armed ? fly(lcm, (int64_t)(1e6 * number)) : 1;
    }
    lcm_destroy(lcm);
    return code;
}
