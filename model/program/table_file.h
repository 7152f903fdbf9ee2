/* A bend table read from a file and checked. */
#ifndef TRIBEND_TABLE_FILE_H
#define TRIBEND_TABLE_FILE_H

#include "control/bend_table.h"

struct table_file {
    struct bend_table table;
    unsigned char *bytes;
    size_t size;
};

/* Returns an exit code, with the message printed. `module` (may be NULL) is the module that the table must be of. */
int table_file_open(struct table_file *file, const char *path, const char *module);
void table_file_close(struct table_file *file);

#endif
