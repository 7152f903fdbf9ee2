/* The message table as text: a DBC file for other programs, and a page for people. Both are written from
 * messages.def. */
#ifndef TRIBEND_MESSAGE_TEXT_H
#define TRIBEND_MESSAGE_TEXT_H

#include <stdbool.h>
#include <stdio.h>

/* Identifiers are those of board `node`, 1 to 15. False: the file could not be written. */
bool message_dbc_write(FILE *file, unsigned node);
/* Markdown. */
bool message_page_write(FILE *file);
/* The shortest decimal that is this very float, into `text`. */
void message_print_real(float value, char text[32]);

#endif
