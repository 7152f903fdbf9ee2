/* The bridge on a full bus: a board's telemetry among 8,000 frames a second, a bare reader of the same bus
 * beside it. Printed: what came, what was lost and where, how long it took, what it cost.
 *
 *     bench_bridge TRIBEND BUS SECONDS RATE [BRIDGE-OPTION..]     BUS: unix:PATH, which is made here, or a
 * CAN interface
 *
 * TRIBEND "-": the load alone. Fails where a frame is neither taken nor counted, or where the bridge's memory
 * grows. Not here: a bus (tests/hil/uml). */
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <lcm/lcm.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "comms/codec.h"
#include "link/socketcan.h"
#include "support/scratch.h"
#include "safety/supervisor.h"
#include "tribend_status_t.h"

#define NODE 7u
#define REPORT_US 5000
#define UNIX_GROUP 4u /* frames sent in one go; a Unix socket holds ten */
#define INTERFACE_GROUP 40u
#define OWN 6u       /* frames of the board in each report's time */
#define CODES 16000u /* a report is known by its pressure, in steps of 2 Pa */
#define STEP_PA 2u
#define TIMES 2000000u
#define PEERS_MOST 2
#define FULL_TRIES 200 /* of 100 us each */
#define SETTLE_S 2
#define GROWTH_KB 256
#define SOCKET_BYTES (4 << 20)

struct times {
    uint32_t count;
    int32_t us[TIMES];
};

static struct shared {
    int64_t sent_us[CODES];
    struct times read, published;
    uint64_t frames_read;
    bool ended;
} * shared;

static int bus = -1;
static bool is_unix;
static struct sockaddr_un peer[PEERS_MOST];
static size_t peers;
static uint64_t frames, waits, refused;
static struct canfd_frame waiting_frame[INTERFACE_GROUP];
static size_t waiting_bytes[INTERFACE_GROUP];
static uint32_t waiting;

static int64_t now_us(clockid_t clock) {
    struct timespec now;
    (void)clock_gettime(clock, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

static void stop(const char *what) {
    fprintf(stderr, "bench_bridge: %s: %s\n", what, strerror(errno));
    exit(EXIT_FAILURE);
}

/* --- sockets --- */

static int open_interface(const char *name) {
    const int on = 1, bytes = SOCKET_BYTES;
    const struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(name)};
    const int descriptor = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    (void)setsockopt(descriptor, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes);
    (void)setsockopt(descriptor, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    if (descriptor < 0 || bind(descriptor, (const struct sockaddr *)&address, sizeof address) != 0) {
        stop(name);
    }
    return descriptor;
}

static int open_unix(const struct sockaddr_un *own) {
    (void)unlink(own->sun_path);
    const int descriptor = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (descriptor < 0 || bind(descriptor, (const struct sockaddr *)own, sizeof *own) != 0) {
        stop(own->sun_path);
    }
    return descriptor;
}

/* Whoever speaks to the board is answered. */
static void hear_peers(void) {
    struct sockaddr_un sender = {.sun_family = AF_UNIX};
    struct canfd_frame can;
    socklen_t bytes = sizeof sender;
    while (recvfrom(bus, &can, sizeof can, MSG_DONTWAIT, (struct sockaddr *)&sender, &bytes) >= 0) {
        size_t known = 0;
        while (known < peers && strcmp(peer[known].sun_path, sender.sun_path) != 0) {
            known++;
        }
        if (is_unix && known == peers && peers < PEERS_MOST) {
            peer[peers++] = sender;
        }
        bytes = sizeof sender;
    }
}

static void give(const struct hal_can_frame *frame, const struct sockaddr_un *to) {
    const struct timespec pause = {.tv_nsec = 100000};
    struct canfd_frame can;
    const size_t bytes = socketcan_from_frame(frame, &can);
    for (int tries = 0; tries < FULL_TRIES; tries++) {
        if (sendto(bus, &can, bytes, MSG_DONTWAIT, (const struct sockaddr *)to,
                   to != NULL ? sizeof *to : 0) == (ssize_t)bytes) {
            return;
        }
        waits++;
        (void)nanosleep(&pause, NULL);
    }
    refused++;
}

static void put(const struct hal_can_frame *frame) {
    frames++;
    for (size_t p = 0; p < peers; p++) {
        give(frame, &peer[p]);
    }
    if (!is_unix) {
        waiting_bytes[waiting] = socketcan_from_frame(frame, &waiting_frame[waiting]);
        waiting++;
    }
}

/* What waits for an interface, in one call: the load should not be what takes the time. */
static void flush(void) {
    const struct timespec pause = {.tv_nsec = 100000};
    struct mmsghdr messages[INTERFACE_GROUP];
    struct iovec parts[INTERFACE_GROUP];
    memset(messages, 0, sizeof messages);
    for (uint32_t i = 0; i < waiting; i++) {
        parts[i] = (struct iovec){.iov_base = &waiting_frame[i], .iov_len = waiting_bytes[i]};
        messages[i].msg_hdr = (struct msghdr){.msg_iov = &parts[i], .msg_iovlen = 1};
    }
    uint32_t sent = 0;
    for (int tries = 0; sent < waiting && tries < FULL_TRIES; tries++) {
        const int count = sendmmsg(bus, &messages[sent], waiting - sent, MSG_DONTWAIT);
        if (count > 0) {
            sent += (uint32_t)count;
        } else {
            waits++;
            (void)nanosleep(&pause, NULL);
        }
    }
    refused += waiting - sent;
    waiting = 0;
}

/* --- what the board and the others say --- */

static void put_message(enum message_id id, const void *message) {
    struct message_trouble trouble = {.out_of_range = 0};
    struct hal_can_frame frame;
    message_frame(id, NODE, message, &frame, &trouble);
    put(&frame);
}

static void put_own(uint32_t report, uint32_t which) {
    const uint16_t step = (uint16_t)(report * (REPORT_US / 1000));
    union message message;
    memset(&message, 0, sizeof message);
    switch (which) {
    case 0:
        shared->sent_us[report % CODES] = now_us(CLOCK_MONOTONIC);
        message.pressures = (struct message_pressures){(float)(STEP_PA * (report % CODES)), 0.0f, 0.0f, step};
        put_message(MESSAGE_PRESSURES, &message);
        return;
    case 1:
        message.time = (struct message_time){.time_us = (uint64_t)report * REPORT_US, .step = step};
        put_message(MESSAGE_TIME, &message);
        return;
    case 2:
        message.status = (struct message_status){.state = SUPERVISOR_SAFE, .protocol = MESSAGE_PROTOCOL};
        put_message(MESSAGE_STATUS, &message);
        return;
    default: {
        static const enum message_id others[] = {MESSAGE_TARGETS, MESSAGE_ESTIMATES, MESSAGE_DUTIES};
        put_message(others[which % 3u], &message);
    }
    }
}

static void put_foreign(uint64_t number) {
    struct hal_can_frame frame = {.id = 0x6a0u + (uint32_t)(number % NODE), .length = 8};
    memcpy(frame.data, &number, sizeof number);
    put(&frame);
}

static void load(double seconds, double rate) {
    const uint32_t in_a_report = (uint32_t)(rate * REPORT_US * 1e-6);
    const uint32_t group = is_unix ? UNIX_GROUP : INTERFACE_GROUP;
    const int64_t start_us = now_us(CLOCK_MONOTONIC);
    struct timespec due;
    (void)clock_gettime(CLOCK_MONOTONIC, &due);
    const uint64_t total = (uint64_t)(seconds * rate);
    waiting = 0;
    for (uint64_t i = 0; i < total && now_us(CLOCK_MONOTONIC) < start_us + (int64_t)(1e6 * seconds); i++) {
        const uint32_t at = (uint32_t)(i % in_a_report), every = in_a_report / OWN;
        if (at % every == 0 && at / every < OWN) {
            put_own((uint32_t)(i / in_a_report), at / every);
        } else {
            put_foreign(i);
        }
        if (i % group == group - 1u) {
            flush();
            due.tv_nsec += (long)(1e9 * group / rate);
            due.tv_sec += due.tv_nsec / 1000000000;
            due.tv_nsec %= 1000000000;
            (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
            hear_peers();
        }
    }
}

/* --- those who listen, a process each --- */

static void note(struct times *times, uint32_t code) {
    const int64_t delay_us = now_us(CLOCK_MONOTONIC) - shared->sent_us[code % CODES];
    if (times->count < TIMES) {
        times->us[times->count++] = (int32_t)delay_us;
    }
}

/* As a bare candump reads: one frame, one call. */
static void read_bus(int descriptor, const struct sockaddr_un *board) {
    struct canfd_frame can;
    struct pollfd wait = {.fd = descriptor, .events = POLLIN};
    if (board != NULL) {
        (void)socketcan_send(descriptor, &(struct hal_can_frame){.id = 0x7ff}, board);
    }
    while (!shared->ended) {
        if (poll(&wait, 1, 100) <= 0 || recv(descriptor, &can, sizeof can, 0) <= 0) {
            continue;
        }
        shared->frames_read++;
        if (can.can_id == message_identifier(MESSAGE_PRESSURES, NODE)) {
            note(&shared->read, (uint32_t)(can.data[0] | can.data[1] << 8));
        }
    }
}

static void on_status(const lcm_recv_buf_t *buffer, const char *channel, const tribend_status_t *status,
                      void *context) {
    (void)buffer;
    (void)channel;
    (void)context;
    note(&shared->published, (uint32_t)status->pressure_pa[0] / STEP_PA);
}

static void read_lcm(void) {
    lcm_t *lcm = lcm_create(NULL);
    if (lcm == NULL) {
        stop("LCM (multicast needs a route: ip route add 224.0.0.0/4 dev lo)");
    }
    tribend_status_t_subscription_t *status =
        tribend_status_t_subscribe(lcm, "TRIBEND_STATUS", on_status, NULL);
    (void)tribend_status_t_subscription_set_queue_capacity(status, 10000);
    while (!shared->ended) {
        (void)lcm_handle_timeout(lcm, 100);
    }
}

static pid_t start_bridge(char **argv, const char *said) {
    const pid_t child = fork();
    if (child == 0) {
        const int file = open(said, O_CREAT | O_TRUNC | O_WRONLY, 0600);
        char *command[32] = {argv[1], "bridge", "--quiet", "--node", "7", "--bus", argv[2]};
        for (size_t i = 0; argv[5 + i] != NULL && i < 24; i++) {
            command[7 + i] = argv[5 + i];
        }
        (void)dup2(file, STDOUT_FILENO);
        (void)execv(argv[1], command);
        _exit(127);
    }
    return child;
}

static pid_t start_listener(int descriptor, const struct sockaddr_un *board) {
    const pid_t child = fork();
    if (child == 0) {
        (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (descriptor >= 0) {
            read_bus(descriptor, board);
        } else {
            read_lcm();
        }
        _exit(0);
    }
    return child;
}

/* --- figures --- */

static int by_size(const void *a, const void *b) {
    const int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
    return (x > y) - (x < y);
}

static void print_times(const char *title, struct times *times) {
    if (times->count == 0) {
        printf("%-10s nothing came\n", title);
        return;
    }
    qsort(times->us, times->count, sizeof times->us[0], by_size);
    const int32_t median_us = times->us[times->count / 2];
    const int32_t p99_us = times->us[(uint64_t)times->count * 99 / 100],
                  most_us = times->us[times->count - 1];
    printf("%-10s %" PRIu32 " reports, after %.2f ms in the median, %.2f ms at p99, %.2f ms at most\n", title,
           times->count, 1e-3 * median_us, 1e-3 * p99_us, 1e-3 * most_us);
}

static long resident_kb(pid_t process) {
    char path[64];
    long pages = 0;
    (void)snprintf(path, sizeof path, "/proc/%ld/statm", (long)process);
    FILE *file = fopen(path, "r");
    if (file == NULL || fscanf(file, "%*d %ld", &pages) != 1) {
        pages = 0;
    }
    if (file != NULL) {
        (void)fclose(file);
    }
    return pages * (sysconf(_SC_PAGESIZE) / 1024);
}

static uint64_t counter(const char *said, const char *name) {
    char line[256];
    uint64_t value = 0;
    FILE *file = fopen(said, "r");
    while (file != NULL && fgets(line, sizeof line, file) != NULL) {
        if (strncmp(line, name, strlen(name)) == 0 && line[strlen(name)] == ' ') {
            value = strtoull(line + strlen(name), NULL, 10);
        }
    }
    if (file != NULL) {
        (void)fclose(file);
    }
    return value;
}

int main(int argc, char **argv) {
    char said[SCRATCH_BYTES];
    if (argc < 5) {
        fprintf(stderr, "usage: bench_bridge TRIBEND BUS SECONDS RATE [BRIDGE-OPTION..]\n");
        return 2;
    }
    const double seconds = strtod(argv[3], NULL), rate = strtod(argv[4], NULL);
    shared = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (shared == MAP_FAILED) {
        stop("memory");
    }
    is_unix = strncmp(argv[2], "unix:", 5) == 0;
    struct sockaddr_un board = {.sun_family = AF_UNIX}, own = {.sun_family = AF_UNIX};
    (void)snprintf(board.sun_path, sizeof board.sun_path, "%s", is_unix ? argv[2] + 5 : "");
    (void)snprintf(own.sun_path, sizeof own.sun_path, "%s.ear", is_unix ? argv[2] + 5 : "");
    bus = is_unix ? open_unix(&board) : open_interface(argv[2]);
    if (strcmp(argv[1], "-") == 0) {
        load(seconds, rate);
        printf("bus        %" PRIu64 " frames in %.0f s, %.0f a second\n", frames, seconds,
               (double)frames / seconds);
        return 0;
    }
    const int file = scratch_file(said);
    if (file < 0 || close(file) != 0) {
        stop("a file below TMPDIR");
    }
    const int ear = is_unix ? open_unix(&own) : open_interface(argv[2]);
    const pid_t reader = start_listener(ear, is_unix ? &board : NULL), listener = start_listener(-1, NULL);
    const pid_t bridge = start_bridge(argv, said);
    sleep(1);
    hear_peers();
    load(SETTLE_S, rate);
    const long before_kb = resident_kb(bridge);
    const int64_t start_us = now_us(CLOCK_MONOTONIC);
    const uint64_t frames_before = frames;
    shared->read.count = shared->published.count = 0;
    load(seconds, rate);
    const double took_s = 1e-6 * (double)(now_us(CLOCK_MONOTONIC) - start_us);
    const uint64_t measured = frames - frames_before;
    const long after_kb = resident_kb(bridge);
    sleep(SETTLE_S); /* what the sockets still hold */
    struct rusage used;
    int status = 0;
    (void)kill(bridge, SIGINT);
    (void)wait4(bridge, &status, 0, &used);
    shared->ended = true;
    (void)waitpid(reader, NULL, 0);
    (void)waitpid(listener, NULL, 0);
    const uint64_t received = counter(said, "frames_received"), dropped = counter(said, "frames_overflowed"),
                   missing = counter(said, "reports_missing");
    const double cpu_s = (double)(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                         1e-6 * (double)(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
    printf("bus        %" PRIu64 " frames in %.1f s, %.0f a second; the sockets were full %" PRIu64
           " times, refused %" PRIu64 "\n",
           measured, took_s, (double)measured / took_s, waits, refused);
    printf("bridge     %" PRIu64 " of %" PRIu64 " frames received, %" PRIu64
           " dropped by the kernel, %" PRIu64 " reports missing, %" PRIu64 " published\n",
           received, frames, dropped, missing, counter(said, "published"));
    (void)remove(said);
    printf("reader     %" PRIu64 " of %" PRIu64 " frames\n", shared->frames_read, frames);
    print_times("read", &shared->read);
    print_times("on LCM", &shared->published);
    printf("cost       %.2f s of processor time, %.1f us a frame received; resident %ld kB, then %ld kB\n",
           cpu_s, received > 0 ? 1e6 * cpu_s / (double)received : 0.0, before_kb, after_kb);
    (void)unlink(said);
    if (is_unix) {
        (void)unlink(board.sun_path);
        (void)unlink(own.sun_path);
    }
    return received > 0 && after_kb <= before_kb + GROWTH_KB && (dropped > 0 || missing == 0) ? 0 : 1;
}
