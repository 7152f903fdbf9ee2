/* gap_share: shares the steps of a job out over cores, or over MPI ranks under mpirun and Slurm.
 *
 *     gap_share [-j JOBS] STEPS PHASE...
 *
 * For each phase in turn, rank 0 runs `STEPS list PHASE`, which prints a line for each step; then `STEPS PHASE LINE` is run
 * for each, dealt out as workers come free, because steps take unlike times. All ranks finish a phase before the next one
 * begins. A step keeps what it made itself, and `list` leaves out what is done: that is how a job goes on after a stop. */
#include <errno.h>
#include <mpi.h>
#include <omp.h>
#include <signal.h>
#include <spawn.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>

#include "sweep/sweep.h"

#define WORDS_MAX 16
#define JOBS_MAX 256
#define STOP (-1L)

enum { EXIT_USAGE_WRONG = 2, EXIT_STEP_FAILED = 4, EXIT_STOPPED = 130 };

/* One phase: its lines, each ended by a zero. */
struct phase {
    const char *steps;
    const char *name;
    char *text;
    size_t count;
    char **line;
    char **environment;
};

static volatile sig_atomic_t stop;
/* The process groups of the steps under way, by worker; 0: none. */
static atomic_int group[JOBS_MAX];

/* Steps under way are ended as well: what they had not finished is done again. */
static void on_signal(int number) {
    (void)number;
    stop = 1;
    for (size_t i = 0; i < JOBS_MAX; i++) {
        const int at = atomic_load(&group[i]);
        if (at > 0) {
            (void)kill(-at, SIGTERM);
        }
    }
}

/* --- one step --- */

/* A program that is started by a rank is none itself: without the launcher's variables. */
static char **plain_environment(void) {
    static const char *const launcher[] = {"OMPI_", "PMIX_", "PMI_", "PRTE_", "ORTE_"};
    extern char **environ;
    size_t count = 0, kept = 0;
    while (environ[count] != NULL) {
        count++;
    }
    char **out = calloc(count + 1, sizeof *out);
    for (size_t i = 0; i < count && out != NULL; i++) {
        bool theirs = false;
        for (size_t k = 0; k < sizeof launcher / sizeof launcher[0]; k++) {
            theirs = theirs || strncmp(environ[i], launcher[k], strlen(launcher[k])) == 0;
        }
        if (!theirs) {
            out[kept++] = environ[i];
        }
    }
    return out;
}

/* The step's exit code; 127 where it could not be started. */
static unsigned char run_step(const struct phase *phase, const char *line) {
    char *words = strdup(line), *rest = NULL, *argument[WORDS_MAX + 3] = {(char *)phase->steps, (char *)phase->name};
    atomic_int *mine = &group[omp_get_thread_num() % JOBS_MAX];
    size_t count = 2;
    int status = 0;
    pid_t child = 0;
    posix_spawnattr_t attributes;
    for (char *word = words != NULL ? strtok_r(words, " ", &rest) : NULL; word != NULL && count < WORDS_MAX + 2;
         word = strtok_r(NULL, " ", &rest)) {
        argument[count++] = word;
    }
    (void)posix_spawnattr_init(&attributes);
    (void)posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP); /* a group of its own: it is ended as a whole */
    const bool started =
        words != NULL && posix_spawnp(&child, phase->steps, NULL, &attributes, argument, phase->environment) == 0;
    atomic_store(mine, started ? (int)child : 0);
    if (started && stop != 0) { /* the signal came before the group was known */
        (void)kill(-child, SIGTERM);
    }
    while (started && waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    atomic_store(mine, 0);
    (void)posix_spawnattr_destroy(&attributes);
    free(words);
    return started ? (unsigned char)(WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status)) : 127;
}

static void *open_worker(void *context, char *error, size_t error_bytes) {
    (void)error;
    (void)error_bytes;
    return context; /* a worker has nothing of its own */
}

static void close_worker(void *worker) {
    (void)worker;
}

static bool work(void *context, void *worker, size_t task, struct sweep_result *result) {
    const struct phase *phase = context;
    (void)worker;
    result->bytes = malloc(1);
    if (result->bytes == NULL) {
        return false;
    }
    result->bytes[0] = run_step(phase, phase->line[task]);
    result->size = 1;
    if (stop != 0) { /* the step was stopped as well */
        free(result->bytes);
        *result = (struct sweep_result){NULL, 0};
        return false;
    }
    return true;
}

/* --- one phase --- */

/* All that the command prints; NULL: it failed. */
static char *output_of(const char *command, size_t *size) {
    FILE *pipe = popen(command, "r");
    char *text = NULL, *larger;
    size_t room = 0, got = 1;
    *size = 0;
    while (pipe != NULL && got > 0) {
        room = *size + 65536;
        larger = realloc(text, room + 1);
        if (larger == NULL) {
            break;
        }
        text = larger;
        got = fread(text + *size, 1, room - *size, pipe);
        *size += got;
    }
    if (pipe == NULL || pclose(pipe) != 0) {
        free(text);
        text = NULL;
    }
    return text;
}

static char *list_steps(const char *steps, const char *name, long *size) {
    char command[4096];
    size_t bytes = 0;
    (void)snprintf(command, sizeof command, "'%s' list '%s'", steps, name);
    char *text = output_of(command, &bytes);
    if (text == NULL) {
        (void)fprintf(stderr, "gap_share: %s failed\n", command);
    }
    *size = text != NULL ? (long)bytes : STOP;
    return text;
}

/* What rank 0 has listed, on every rank. False: rank 0 says stop. */
static bool share_list(struct phase *phase, bool first, long size) {
    if (sweep_ranks() > 1) {
        (void)MPI_Bcast(&size, 1, MPI_LONG, 0, MPI_COMM_WORLD);
        if (size > 0 && !first) {
            phase->text = malloc((size_t)size + 1);
        }
        if (size > 0 && phase->text == NULL) {
            (void)MPI_Abort(MPI_COMM_WORLD, EXIT_STEP_FAILED);
        }
        if (size > 0) {
            (void)MPI_Bcast(phase->text, (int)size, MPI_BYTE, 0, MPI_COMM_WORLD);
        }
    }
    if (size < 0) {
        return false;
    }
    for (long i = 0; i < size; i++) {
        phase->count += phase->text[i] == '\n' ? 1 : 0;
    }
    phase->line = calloc(phase->count + 1, sizeof *phase->line);
    char *at = phase->text;
    for (size_t k = 0; k < phase->count && phase->line != NULL; k++) {
        phase->line[k] = at;
        at = strchr(at, '\n');
        *at++ = '\0';
    }
    return phase->line != NULL;
}

/* Steps that failed, named; on rank 0. */
static size_t print_failed(const struct phase *phase, const struct sweep_result *results) {
    size_t failed = 0;
    for (size_t i = 0; i < phase->count; i++) {
        if (results[i].bytes != NULL && results[i].bytes[0] != 0) {
            (void)fprintf(stderr, "gap_share: %s %s %s: exit code %d\n", phase->steps, phase->name, phase->line[i],
                          (int)results[i].bytes[0]);
            failed++;
        }
    }
    return failed;
}

static int run_phase(struct phase *phase, bool first) {
    char error[256] = "out of memory";
    const struct sweep_job job = {.count = phase->count, .context = phase, .open = open_worker, .close = close_worker, .work = work, .stop = &stop};
    struct sweep_result *results = calloc(phase->count + 1, sizeof *results);
    int code = 0;
    if (results == NULL) {
        (void)fprintf(stderr, "gap_share: out of memory\n");
        return EXIT_STEP_FAILED;
    }
    const enum sweep_outcome outcome = sweep_run(&job, results, error, sizeof error);
    if (outcome == SWEEP_STOPPED) {
        code = EXIT_STOPPED;
    } else if (outcome == SWEEP_FAILED) {
        (void)fprintf(stderr, "gap_share: %s\n", error);
        code = EXIT_STEP_FAILED;
    } else if (first && print_failed(phase, results) > 0) {
        code = EXIT_STEP_FAILED;
    }
    for (size_t i = 0; i < phase->count; i++) {
        free(results[i].bytes);
    }
    free(results);
    return code;
}

/* Every rank goes through the same phases; rank 0's code is the job's. */
static int run_phases(const char *steps, char *const *names, int count, char **environment, bool first) {
    int code = 0;
    for (int p = 0; p <= count; p++) {
        struct phase phase = {.steps = steps, .name = p < count ? names[p] : "", .environment = environment};
        long size = STOP;
        if (first && p < count && code == 0) {
            phase.text = list_steps(steps, names[p], &size);
            code = size == STOP ? EXIT_STEP_FAILED : code;
        }
        const bool goes_on = share_list(&phase, first, size);
        if (goes_on) {
            const int now = run_phase(&phase, first);
            code = code == 0 ? now : code;
        }
        free(phase.line);
        free(phase.text);
        if (!goes_on) {
            break;
        }
    }
    return code;
}

int main(int argc, char **argv) {
    int at = 1;
    if (argc > 2 && strcmp(argv[1], "-j") == 0) {
        const int jobs = atoi(argv[2]);
        omp_set_num_threads(jobs < 1 ? 1 : jobs > JOBS_MAX ? JOBS_MAX : jobs);
        at = 3;
    }
    if (argc < at + 2) {
        (void)fprintf(stderr, "usage: gap_share [-j JOBS] STEPS PHASE...\n");
        return EXIT_USAGE_WRONG;
    }
    const struct sigaction action = {.sa_handler = on_signal};
    const bool first = sweep_join();
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    char **environment = plain_environment();
    const int code = environment == NULL ? EXIT_STEP_FAILED : run_phases(argv[at], argv + at + 1, argc - at - 1, environment, first);
    free(environment);
    sweep_leave();
    return code;
}
