#include "program/output_file.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

bool output_file_open(struct output_file *file, const char *path, char *error, size_t error_bytes) {
    memset(file, 0, sizeof *file);
    const int length = snprintf(file->path, sizeof file->path, "%s", path);
    const int aside = snprintf(file->aside, sizeof file->aside, "%s.part", path);
    if (length <= 0 || aside < 0 || (size_t)aside >= sizeof file->aside) {
        (void)snprintf(error, error_bytes, "'%.64s' cannot be the path of an output file: %s", path,
                       length <= 0 ? "it is empty" : "it is too long");
        return false;
    }
    file->stream = fopen(file->aside, "wb");
    if (file->stream == NULL) {
        (void)snprintf(error, error_bytes, "cannot write %s: %s", file->path, strerror(errno));
        return false;
    }
    return true;
}

bool output_file_can_write(const char *path, char *error, size_t error_bytes) {
    struct output_file file;
    if (!output_file_open(&file, path, error, error_bytes)) {
        return false;
    }
    output_file_discard(&file);
    return true;
}

bool output_file_commit(struct output_file *file, char *error, size_t error_bytes) {
    bool whole = ferror(file->stream) == 0 && fflush(file->stream) == 0;
    whole = whole && (fsync(fileno(file->stream)) == 0 || errno == EINVAL);
    whole = fclose(file->stream) == 0 && whole;
    file->stream = NULL;
    if (!whole || rename(file->aside, file->path) != 0) {
        (void)snprintf(error, error_bytes, "cannot write %s: %s", file->path, strerror(errno));
        (void)remove(file->aside);
        return false;
    }
    return true;
}

void output_file_discard(struct output_file *file) {
    if (file->stream != NULL) {
        (void)fclose(file->stream);
        file->stream = NULL;
        (void)remove(file->aside);
    }
}
