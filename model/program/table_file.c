#include "program/table_file.h"

#include <stdlib.h>

#include "program/input_file.h"
#include "program/program.h"

int table_file_open(struct table_file *file, const char *path, const char *module) {
    char message[PROGRAM_ERROR_BYTES];
    file->bytes = input_file_read(path, &file->size, message, sizeof message);
    if (file->bytes == NULL) {
        return program_fail(EXIT_BAD_INPUT, "%s", message);
    }
    const enum bend_table_status status = bend_table_open(&file->table, file->bytes, file->size, module);
    if (status == BEND_TABLE_WRONG_MODULE) {
        (void)program_fail(EXIT_BAD_INPUT, "%s: the table is of module %s, not %s", path, file->table.module.name, module);
    } else if (status != BEND_TABLE_OK) {
        (void)program_fail(EXIT_BAD_INPUT, "%s: %s", path, bend_table_status_text(status));
    }
    if (status != BEND_TABLE_OK) {
        table_file_close(file);
        return EXIT_BAD_INPUT;
    }
    return EXIT_OK;
}

void table_file_close(struct table_file *file) {
    free(file->bytes);
    file->bytes = NULL;
}
