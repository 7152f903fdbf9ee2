/* Boards for tests of the host's side: the real firmware node on the simulated HAL, in real time, behind a
 * Unix socket or a pseudo-terminal that speaks SLCAN.
 *
 *     board_stub [-n NODE]... [-p PROTOCOL] [-t TABLE] [-d DELAY] [-l] PATH
 *
 * A line on standard output for every change of state: time, node, state, faults and the plant's greatest
 * pressure. SIGUSR1 cuts the bus or mends it; a reset is obeyed; what a board stores lasts as long as this
 * program. -p   claim to speak another version of the protocol -d   so many milliseconds pass before a board has
 * what a host sent -l   PATH becomes a link to the terminal of an SLCAN adapter */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "comms/node.h"
#include "link/slcan.h"
#include "link/socketcan.h"
#include "program/table_file.h"
#include "sim/sim_hal.h"
#include "support/sim_storage.h"

#define BOARDS_MOST 4
#define HOSTS_MOST 4
#define QUEUE 512
#define TABLE_SLOT_BYTES SIM_STORAGE_TABLE_BYTES
#define STEP_NS 1000000
#define BEHIND_NS 200000000

struct board {
    struct sim sim;
    struct hal hal;
    struct hal_bus bus;
    struct sim_storage storage;
    struct node_setup setup;
    struct node node;
    struct hal_can_frame queue[QUEUE];
    size_t first, queued;
    uint32_t lost;
    enum supervisor_state shown;
    uint32_t id;
};

static struct board boards[BOARDS_MOST];
static size_t board_count;
static struct sockaddr_un hosts[HOSTS_MOST];
static size_t host_count;
static int bus = -1;
static bool is_slcan;
static struct slcan_reader reader;
static const struct bend_table *module_table;
static uint32_t protocol = MESSAGE_PROTOCOL;
static struct delayed {
    struct hal_can_frame frame;
    uint64_t due; /* step */
} delayed[QUEUE];
static size_t first_delayed, delayed_count;
static uint64_t steps, delay;
static volatile sig_atomic_t cut, ended;

/* --- the bus */

static void queue_frame(struct board *board, const struct hal_can_frame *frame) {
    if (board->queued == QUEUE) {
        board->lost++;
        return;
    }
    board->queue[(board->first + board->queued++) % QUEUE] = *frame;
}

static bool take_queued(void *context, struct hal_can_frame *frame) {
    struct board *board = context;
    if (board->queued == 0) {
        return false;
    }
    *frame = board->queue[board->first];
    board->first = (board->first + 1) % QUEUE;
    board->queued--;
    return true;
}

/* What a board of another version would say. */
static void claim_protocol(struct hal_can_frame *frame) {
    if (frame->id >> MESSAGE_NODE_BITS == message_row(MESSAGE_IDENTITY)->number) {
        frame->data[0] = (uint8_t)protocol;
    }
}

/* All but the sender hear it, as on any bus. */
static void give_hosts(const struct hal_can_frame *frame, const char *sender) {
    struct canfd_frame can;
    char line[SLCAN_LINE_BYTES];
    if (is_slcan) {
        const size_t bytes = slcan_format(frame, line);
        (void)!write(bus, line, bytes);
        return;
    }
    const size_t bytes = socketcan_from_frame(frame, &can);
    for (size_t h = 0; h < host_count; h++) {
        if (strcmp(hosts[h].sun_path, sender) != 0 &&
            sendto(bus, &can, bytes, MSG_DONTWAIT, (struct sockaddr *)&hosts[h], sizeof hosts[h]) < 0 && errno != EAGAIN) {
            hosts[h--] = hosts[--host_count]; /* that host is gone */
        }
    }
}

static bool send_out(void *context, const struct hal_can_frame *frame) {
    const struct board *sender = context;
    struct hal_can_frame claimed = *frame;
    claim_protocol(&claimed);
    for (size_t b = 0; b < board_count; b++) {
        if (&boards[b] != sender) {
            queue_frame(&boards[b], frame);
        }
    }
    if (!cut) {
        give_hosts(&claimed, "");
    }
    return true;
}

static void say_state(void *context, struct hal_can_state *state) {
    const struct board *board = context;
    *state = (struct hal_can_state){.receive_lost = board->lost};
}

static void take_from_host(const struct hal_can_frame *frame) {
    if (!cut && delayed_count < QUEUE) {
        delayed[(first_delayed + delayed_count++) % QUEUE] = (struct delayed){*frame, steps + delay};
    }
}

static void give_boards(void) {
    for (; delayed_count > 0 && delayed[first_delayed].due <= steps; delayed_count--) {
        for (size_t b = 0; b < board_count; b++) {
            queue_frame(&boards[b], &delayed[first_delayed].frame);
        }
        first_delayed = (first_delayed + 1) % QUEUE;
    }
}

static void remember_host(const struct sockaddr_un *host) {
    for (size_t h = 0; h < host_count; h++) {
        if (strcmp(hosts[h].sun_path, host->sun_path) == 0) {
            return;
        }
    }
    hosts[host_count < HOSTS_MOST ? host_count++ : HOSTS_MOST - 1] = *host;
}

static void take_socket(void) {
    struct canfd_frame can;
    struct transport_frame frame;
    struct sockaddr_un host = {.sun_family = AF_UNIX};
    socklen_t host_bytes = sizeof host;
    for (;;) {
        const ssize_t size =
            recvfrom(bus, &can, sizeof can, MSG_DONTWAIT, (struct sockaddr *)&host, &host_bytes);
        if (size < 0) {
            return;
        }
        if (host_bytes > sizeof host.sun_family) {
            remember_host(&host);
        }
        if (socketcan_to_frame(&can, (size_t)size, &frame)) {
            take_from_host(&frame.frame);
            if (!cut) {
                give_hosts(&frame.frame, host.sun_path);
            }
        }
        host_bytes = sizeof host;
    }
}

static void take_terminal(void) {
    struct hal_can_frame frame;
    char bytes[256];
    const ssize_t count = read(bus, bytes, sizeof bytes);
    for (ssize_t i = 0; i < count; i++) {
        if (slcan_take(&reader, bytes[i], &frame) == SLCAN_FRAME) {
            take_from_host(&frame);
        }
    }
}

static bool open_socket(const char *path) {
    struct sockaddr_un own = {.sun_family = AF_UNIX};
    (void)snprintf(own.sun_path, sizeof own.sun_path, "%s", path);
    (void)unlink(path);
    bus = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    return bus >= 0 && bind(bus, (struct sockaddr *)&own, sizeof own) == 0;
}

/* The other end stays open here, so that a host may come and go. */
static bool open_terminal(const char *path) {
    struct termios terminal;
    bus = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (bus < 0 || grantpt(bus) != 0 || unlockpt(bus) != 0) {
        return false;
    }
    const int other = open(ptsname(bus), O_RDWR | O_NOCTTY);
    (void)unlink(path);
    if (other < 0 || tcgetattr(other, &terminal) != 0) {
        return false;
    }
    cfmakeraw(&terminal);
    return tcsetattr(other, TCSANOW, &terminal) == 0 && symlink(ptsname(bus), path) == 0;
}

/* --- the boards */

/* The module is vented when this is allowed: plant and clock begin anew. */
static void power_up(struct board *board) {
    struct sim_parameters parameters;
    sim_default_parameters(&parameters);
    sim_init(&board->sim, module_table, &parameters, board->id);
    sim_bind(&board->sim, &board->hal);
}

static void start(struct board *board) {
    node_init(&board->node, &board->setup);
    board->node.node_id = board->id;
    board->shown = SUPERVISOR_STATE_COUNT;
}

static void add(const struct table_file *file, uint32_t id) {
    struct board *board = &boards[board_count++];
    module_table = &file->table;
    board->id = id;
    power_up(board);
    sim_storage_init(&board->storage, TABLE_SLOT_BYTES);
    board->bus =
        (struct hal_bus){.context = board, .receive = take_queued, .send = send_out, .state = say_state};
    board->setup = (struct node_setup){.hal = &board->hal,
                                       .bus = &board->bus,
                                       .storage = &board->storage.hal,
                                       .table_image = file->bytes,
                                       .table_bytes = (uint32_t)file->size,
                                       .firmware = 0x57ABu};
    start(board);
}

static void show(struct board *board) {
    const struct controller_status *status = &board->node.app.controller.status;
    if (status->state != board->shown) {
        board->shown = status->state;
        const double *pressure_pa = board->sim.plant.pressure_pa;
        const double most_pa = fmax(pressure_pa[0], fmax(pressure_pa[1], pressure_pa[2]));
        printf("%.3f node %u %s faults %08x pressure %.0f\n", 1e-6 * (double)board->sim.time_us, board->id,
               supervisor_state_name(status->state), status->faults, most_pa);
        (void)fflush(stdout);
    }
}

static void step(struct board *board) {
    node_step(&board->node);
    (void)app_step(&board->node.app);
    node_report(&board->node);
    show(board);
    sim_advance(&board->sim, CONTROLLER_STEP_US);
    if (board->node.reset_wanted) {
        power_up(board);
        start(board);
    }
}

/* --- time */

static void on_signal(int number) {
    if (number == SIGUSR1) {
        cut = !cut;
    } else {
        ended = 1;
    }
}

static void pace(struct timespec *due) {
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    due->tv_nsec += STEP_NS;
    if (due->tv_nsec >= 1000000000) {
        due->tv_nsec -= 1000000000;
        due->tv_sec++;
    }
    if ((now.tv_sec - due->tv_sec) * 1000000000L + now.tv_nsec - due->tv_nsec > BEHIND_NS) {
        *due = now;
    }
    (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, due, NULL);
}

static void run(void) {
    struct timespec due;
    (void)clock_gettime(CLOCK_MONOTONIC, &due);
    while (!ended) {
        if (is_slcan) {
            take_terminal();
        } else {
            take_socket();
        }
        give_boards();
        for (size_t b = 0; b < board_count; b++) {
            step(&boards[b]);
        }
        steps++;
        pace(&due);
    }
}

int main(int argc, char **argv) {
    const char *table = "tables/paper-semicircle.tbt";
    uint32_t ids[BOARDS_MOST] = {1};
    size_t count = 0;
    static struct table_file file;
    for (int option = getopt(argc, argv, "n:p:t:d:l"); option != -1; option = getopt(argc, argv, "n:p:t:d:l")) {
        if (option == 'n' && count < BOARDS_MOST) {
            ids[count++] = (uint32_t)strtoul(optarg, NULL, 10);
        } else if (option == 'p') {
            protocol = (uint32_t)strtoul(optarg, NULL, 10);
        } else if (option == 'd') {
            delay = strtoul(optarg, NULL, 10);
        } else if (option == 't') {
            table = optarg;
        } else {
            is_slcan = option == 'l';
        }
    }
    if (optind + 1 != argc || table_file_open(&file, table, NULL) != EXIT_SUCCESS ||
        !(is_slcan ? open_terminal(argv[optind]) : open_socket(argv[optind]))) {
        fprintf(stderr, "board_stub: cannot start: %s\n", strerror(errno));
        return EXIT_FAILURE;
    }
    for (size_t i = 0; i < (count > 0 ? count : 1); i++) {
        add(&file, ids[i]);
    }
    (void)signal(SIGUSR1, on_signal);
    (void)signal(SIGTERM, on_signal);
    (void)signal(SIGINT, on_signal);
    run();
    (void)unlink(argv[optind]);
    return EXIT_SUCCESS;
}
