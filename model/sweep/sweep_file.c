#include "sweep/sweep_file.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

#define MAGIC "TBSWEEP1"
#define RECORD_MOST (1u << 28)

struct record {
    uint64_t task;
    uint64_t size;
    uint64_t crc;
};

static uint64_t record_crc(uint64_t task, const struct sweep_result *result) {
    const uLong head = crc32(0, (const Bytef *)&task, sizeof task);
    return crc32(head, result->bytes, (uInt)result->size);
}

/* The records of a file of this job; returns the offset behind the last sound one, 0 for an empty file, -1 for another's. */
static long read_records(FILE *stream, uint64_t key, struct sweep_result *results, size_t count) {
    char magic[sizeof MAGIC - 1] = "";
    uint64_t found = 0;
    if (fread(magic, 1, sizeof magic, stream) == 0) {
        return 0;
    }
    if (memcmp(magic, MAGIC, sizeof magic) != 0 ||
        fread(&found, sizeof found, 1, stream) != 1 || found != key) {
        return -1;
    }
    long sound = ftell(stream);
    struct record record;
    while (fread(&record, sizeof record, 1, stream) == 1 && record.task < count && record.size < RECORD_MOST) {
        struct sweep_result result = {malloc(record.size + 1), record.size};
        if (result.bytes == NULL || fread(result.bytes, 1, record.size, stream) != record.size ||
            record_crc(record.task, &result) != record.crc || results[record.task].bytes != NULL) {
            free(result.bytes);
            break;
        }
        results[record.task] = result;
        sound = ftell(stream);
    }
    return sound;
}

bool sweep_file_open(struct sweep_file *file, const char *path, uint64_t key, struct sweep_result *results, size_t count,
                     char *error, size_t error_bytes) {
    memset(file, 0, sizeof *file);
    if (path == NULL) {
        return true;
    }
    (void)snprintf(file->path, sizeof file->path, "%s", path);
    file->stream = fopen(path, "r+b");
    long end = 0;
    if (file->stream != NULL) {
        end = read_records(file->stream, key, results, count);
    } else {
        file->stream = fopen(path, "w+b");
    }
    if (end < 0) {
        (void)fclose(file->stream);
        file->stream = NULL;
        (void)snprintf(error, error_bytes,
                       "%s holds the points of another job (or is no file of points): remove it, or name another output",
                       path);
        return false;
    }
    bool sound = file->stream != NULL && ftruncate(fileno(file->stream), end) == 0 &&
                 fseek(file->stream, end, SEEK_SET) == 0;
    if (sound && end == 0) {
        sound = fwrite(MAGIC, sizeof MAGIC - 1, 1, file->stream) == 1 && fwrite(&key, sizeof key, 1, file->stream) == 1 &&
                fflush(file->stream) == 0;
    }
    if (!sound) {
        (void)snprintf(error, error_bytes, "%s: %s (finished points are kept there)", path, strerror(errno));
    }
    return sound;
}

bool sweep_file_append(struct sweep_file *file, uint64_t task, const struct sweep_result *result) {
    const struct record record = {task, result->size, record_crc(task, result)};
    return file->stream == NULL || (fwrite(&record, sizeof record, 1, file->stream) == 1 &&
                                    fwrite(result->bytes, 1, result->size, file->stream) == result->size &&
                                    fflush(file->stream) == 0);
}

void sweep_file_close(struct sweep_file *file, bool complete) {
    if (file->stream != NULL) {
        (void)fclose(file->stream);
        file->stream = NULL;
        if (complete) {
            (void)remove(file->path);
        }
    }
}
