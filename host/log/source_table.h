/* Numbers out of another program's text table: the wanted columns of a delimited file, found by the names in
 * its header or by their position. */
#ifndef TRIBEND_SOURCE_TABLE_H
#define TRIBEND_SOURCE_TABLE_H

#include <stdbool.h>
#include <stddef.h>

#define SOURCE_COLUMNS_MAX 96

struct source_format {
    char delimiter;   /* ' ' stands for any run of blanks and tabs */
    int header_lines; /* the last of them names the columns; 0: columns are numbered from 1 */
    char comment;     /* lines that start with it are skipped; '\0': there are none */
};

struct source_table {
    size_t wanted_count;
    const char *wanted[SOURCE_COLUMNS_MAX]; /* by pointer */
    size_t rows;
    double *value; /* [row * wanted_count + wanted]; NaN where empty, "NA" or "nan" */
    int *line;     /* of the file, by row */
};

/* Ask for a column before reading: its index among the wanted ones, the same for the same name; -1 when there
 * are too many.
 */
int source_table_want(struct source_table *table, const char *column);
/* False: `error` names file, line and column, and which columns there are. */
bool source_table_read(const char *path, const struct source_format *format, struct source_table *table,
                       char *error, size_t error_bytes);
void source_table_free(struct source_table *table);

#endif
