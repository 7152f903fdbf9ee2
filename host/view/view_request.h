/* What of a request is looked at before it may do anything: where it comes from, whether it knows the token,
 * what it commands. Pure: text in, a verdict or a reason for people out. Not here: HTTP itself
 * (view_server.h). */
#ifndef TRIBEND_VIEW_REQUEST_H
#define TRIBEND_VIEW_REQUEST_H

#include "control/controller.h"
#include "view/view_arm.h"

#define VIEW_TOKEN_BYTES 65u
#define VIEW_TOKEN_LEAST 16u /* characters of a token that people choose */

struct view_access {
    char token[VIEW_TOKEN_BYTES];
    bool loopback; /* the page is given the token, but only under a loopback name */
};

/* 256 bits from the kernel, in hex. False: it gave none. */
bool view_token_make(char token[VIEW_TOKEN_BYTES]);
/* The first line of a file that nobody else may read. False: `error` names the file and the remedy. */
bool view_token_read(const char *path, char token[VIEW_TOKEN_BYTES], char *error, size_t error_bytes);
/* In a time that does not tell where they differ. `given` may be NULL. */
bool view_token_matches(const struct view_access *access, const char *given);
/* "Host:" names this machine itself: what a page gets that some other name was made to point here does not.
 */
bool view_host_is_loopback(const char *host);
/* "Origin:" is absent, or the page's own: what "Host:" says. */
bool view_origin_is_own(const char *origin, const char *host);
/* IPv4 or IPv6 address of this machine itself. */
bool view_address_is_loopback(const char *address);

/* {"page": ..} */
bool view_request_page(const char *body, char page[VIEW_PAGE_BYTES], char *error, size_t error_bytes);
/* {"page": .., "bend_deg": .., "direction_deg": .., "co_contraction_kpa": ..}, within what the module takes.
 */
bool view_request_command(const char *body, const struct bend_table_module *module,
                          char page[VIEW_PAGE_BYTES], struct controller_command *command, char *error,
                          size_t error_bytes);

#endif
