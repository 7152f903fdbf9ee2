/* The page's files, built into the program: our own from host/view/page, the plotting library as npm brought
 * it. */
#ifndef TRIBEND_VIEW_ASSETS_H
#define TRIBEND_VIEW_ASSETS_H

#include <stdbool.h>
#include <stddef.h>

struct view_asset {
    const char *path; /* of the URL */
    const char *type;
    const unsigned char *bytes;
    size_t size;
};

/* NULL: there is no such file. */
const struct view_asset *view_asset_find(const char *path);
/* False: there was no npm when this program was built, and the page could not plot. */
bool view_assets_complete(void);

#endif
