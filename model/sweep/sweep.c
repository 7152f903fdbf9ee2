#include "sweep/sweep.h"

#include <mpi.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "sweep/sweep_file.h"

#define TAG_RESULT 1
#define TAG_TASK 2
#define NO_TASK UINT64_MAX
#define POLL_NS 500000

static int rank, ranks = 1;
static bool joined;

bool sweep_join(void) {
    /* set by mpirun (Open MPI), Slurm's PMI and PMIx; a plain start does not pay for MPI */
    if (getenv("OMPI_COMM_WORLD_SIZE") == NULL && getenv("PMI_RANK") == NULL && getenv("PMIX_RANK") == NULL) {
        return true;
    }
    int provided = 0;
    joined = MPI_Init_thread(NULL, NULL, MPI_THREAD_FUNNELED, &provided) == MPI_SUCCESS;
    if (joined) {
        (void)MPI_Comm_rank(MPI_COMM_WORLD, &rank);
        (void)MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    }
    return rank == 0;
}

void sweep_leave(void) {
    if (joined) {
        (void)MPI_Finalize();
        joined = false;
    }
}

size_t sweep_ranks(void) {
    return (size_t)ranks;
}

/* The dealer's state, shared by the threads of rank 0. */
struct deal {
    const struct sweep_job *job;
    struct sweep_result *results;
    struct sweep_file file;
    size_t next;
    size_t done;
    bool failed;
    char *error;
    size_t error_bytes;
};

static bool stopped(const struct sweep_job *job) {
    return job->stop != NULL && *job->stop != 0;
}

static uint64_t take_task(struct deal *deal) {
    uint64_t task = NO_TASK;
#pragma omp critical(sweep_deal)
    {
        while (deal->next < deal->job->count && deal->results[deal->next].bytes != NULL) {
            deal->next++;
        }
        if (deal->next < deal->job->count && !deal->failed && !stopped(deal->job)) {
            task = deal->next++;
        }
    }
    return task;
}

static void fail(struct deal *deal, const char *why) {
#pragma omp critical(sweep_deal)
    {
        if (!deal->failed) {
            (void)snprintf(deal->error, deal->error_bytes, "%s", why);
        }
        deal->failed = true;
    }
}

static void put_result(struct deal *deal, uint64_t task, struct sweep_result result, bool remote) {
    bool kept = true;
#pragma omp critical(sweep_deal)
    {
        deal->results[task] = result;
        deal->done++;
        kept = sweep_file_append(&deal->file, task, &result);
        if (remote && deal->job->arrived != NULL) {
            deal->job->arrived(deal->job->context, task);
        }
    }
    if (!kept) {
        fail(deal, "the file of finished points cannot be written: is the disk full?");
    }
}

/* Tasks until there are none left; on rank 0. */
static void work_here(struct deal *deal) {
    const struct sweep_job *job = deal->job;
    char error[256] = "out of memory for a worker";
    void *worker = job->open(job->context, error, sizeof error);
    if (worker == NULL) {
        fail(deal, error);
        return;
    }
    for (uint64_t task = take_task(deal); task != NO_TASK; task = take_task(deal)) {
        struct sweep_result result = {NULL, 0};
        if (job->work(job->context, worker, task, &result)) {
            put_result(deal, task, result, false);
        } else if (!stopped(job)) {
            fail(deal, "out of memory for a point of the sweep");
        }
    }
    job->close(worker);
}

/* --- other ranks --- */

/* A message of a worker: task (NO_TASK at first, or where it failed), then the result's bytes. */
static int work_for_rank_0(const struct sweep_job *job, char *error, size_t error_bytes) {
    void *worker = job->open(job->context, error, error_bytes);
    uint64_t task = NO_TASK;
    struct sweep_result result = {NULL, 0};
    do {
        const size_t size = sizeof task + result.size;
        unsigned char *message = malloc(size);
        if (message == NULL) {
            (void)MPI_Abort(MPI_COMM_WORLD, 4);
            return SWEEP_FAILED;
        }
        memcpy(message, &task, sizeof task);
        if (result.size > 0) {
            memcpy(message + sizeof task, result.bytes, result.size);
        }
        (void)MPI_Send(message, (int)size, MPI_BYTE, 0, TAG_RESULT, MPI_COMM_WORLD);
        free(message);
        free(result.bytes);
        result = (struct sweep_result){NULL, 0};
        (void)MPI_Recv(&task, (int)sizeof task, MPI_BYTE, 0, TAG_TASK, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
        if (task != NO_TASK && (worker == NULL || !job->work(job->context, worker, task, &result))) {
            fprintf(stderr, "rank %d: %s\n", rank, worker == NULL ? error : "a point could not be solved");
            (void)MPI_Abort(MPI_COMM_WORLD, 4);
        }
    } while (task != NO_TASK);
    if (worker != NULL) {
        job->close(worker);
    }
    return worker != NULL ? SWEEP_HELPED : SWEEP_FAILED;
}

/* Answers one worker's message, if there is one; true where a worker went home. */
static bool serve(struct deal *deal, bool *idle) {
    int waiting = 0, size = 0;
    MPI_Status status;
    (void)MPI_Iprobe(MPI_ANY_SOURCE, TAG_RESULT, MPI_COMM_WORLD, &waiting, &status);
    *idle = waiting == 0;
    if (waiting == 0) {
        return false;
    }
    (void)MPI_Get_count(&status, MPI_BYTE, &size);
    unsigned char *message = malloc((size_t)size);
    uint64_t task = NO_TASK;
    if (message == NULL) {
        (void)MPI_Abort(MPI_COMM_WORLD, 4);
        return false;
    }
    (void)MPI_Recv(message, size, MPI_BYTE, status.MPI_SOURCE, TAG_RESULT, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    memcpy(&task, message, sizeof task);
    if (task < deal->job->count) {
        struct sweep_result result = {NULL, (size_t)size - sizeof task};
        result.bytes = malloc(result.size + 1);
        if (result.bytes == NULL) {
            (void)MPI_Abort(MPI_COMM_WORLD, 4);
        } else {
            memcpy(result.bytes, message + sizeof task, result.size);
            put_result(deal, task, result, true);
        }
    }
    free(message);
    task = take_task(deal);
    (void)MPI_Send(&task, (int)sizeof task, MPI_BYTE, status.MPI_SOURCE, TAG_TASK, MPI_COMM_WORLD);
    return task == NO_TASK;
}

/* Rank 0's main thread: deals until every other rank has gone home. It sleeps between messages: its core is a worker's. */
static void deal_out(struct deal *deal) {
    for (int away = 1; away < ranks;) {
        bool idle = false;
        away += serve(deal, &idle);
        if (idle) {
            const struct timespec pause = {0, POLL_NS};
            (void)nanosleep(&pause, NULL);
        }
    }
}

static void run_here(struct deal *deal) {
    if (ranks == 1) {
#pragma omp parallel
        work_here(deal);
        return;
    }
#pragma omp parallel num_threads(2)
    {
        if (omp_get_thread_num() == 0) {
            deal_out(deal);
        } else {
            work_here(deal);
        }
    }
}

enum sweep_outcome sweep_run(const struct sweep_job *job, struct sweep_result *results, char *error,
                             size_t error_bytes) {
    if (rank != 0) {
        return (enum sweep_outcome)work_for_rank_0(job, error, error_bytes);
    }
    struct deal deal = {.job = job, .results = results, .error = error, .error_bytes = error_bytes};
    if (!sweep_file_open(&deal.file, job->keep_path, job->key, results, job->count, error, error_bytes)) {
        deal.failed = true; /* the others still have to be sent home */
    }
    for (size_t task = 0; task < job->count; task++) {
        if (results[task].bytes != NULL) {
            deal.done++;
            if (job->arrived != NULL) {
                job->arrived(job->context, task);
            }
        }
    }
    run_here(&deal);
    const bool complete = deal.done == job->count && !deal.failed;
    sweep_file_close(&deal.file, complete);
    return complete ? SWEEP_DONE : deal.failed ? SWEEP_FAILED : SWEEP_STOPPED;
}
