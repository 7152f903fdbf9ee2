/* Independent tasks shared out as workers come free: over the threads of one process, or over MPI ranks under mpirun
 * (rank 0 deals and works, every other rank is one worker). Finished tasks may be kept in a file, so that a sweep that was
 * stopped or killed takes up where it was. What a task yields must not depend on who does it. */
#ifndef TRIBEND_SWEEP_H
#define TRIBEND_SWEEP_H

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct sweep_result {
    unsigned char *bytes; /* malloc'ed; NULL: not done */
    size_t size;
};

struct sweep_job {
    size_t count;
    void *context;
    /* One worker's own state (a solver); NULL with a message where it cannot be made. */
    void *(*open)(void *context, char *error, size_t error_bytes);
    void (*close)(void *worker);
    /* False where memory ends or the job was stopped. A task without an answer is an answer, too: say so in the bytes. */
    bool (*work)(void *context, void *worker, size_t task, struct sweep_result *result);
    /* A result came from elsewhere (another rank, the file); called by one thread at a time. May be NULL. */
    void (*arrived)(void *context, size_t task);
    const char *keep_path; /* file of finished tasks, NULL: none. Removed once all are done. */
    uint64_t key;          /* of the inputs: a file with another key is of another job and is refused */
    const volatile sig_atomic_t *stop; /* may be NULL */
};

enum sweep_outcome {
    SWEEP_DONE,    /* every task has its result here */
    SWEEP_HELPED,  /* this rank has done its part; rank 0 has the results */
    SWEEP_STOPPED,
    SWEEP_FAILED   /* `error` says why */
};

/* Join the other ranks where mpirun started this process; otherwise nothing. Returns true on rank 0. */
bool sweep_join(void);
/* Leave them. */
void sweep_leave(void);
size_t sweep_ranks(void);

/* `results` has job->count entries, zeroed by the caller, who frees their bytes. */
enum sweep_outcome sweep_run(const struct sweep_job *job, struct sweep_result *results, char *error, size_t error_bytes);

#endif
