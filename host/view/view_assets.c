#include "view/view_assets.h"

#include <stdint.h>
#include <string.h>

/* view_files.S has the bytes. */
#define FILE_BYTES(name) extern const unsigned char view_asset_##name[], view_asset_##name##_end[]
FILE_BYTES(index_html);
FILE_BYTES(view_css);
FILE_BYTES(view_js);
FILE_BYTES(module_js);
FILE_BYTES(uplot_js);
FILE_BYTES(uplot_css);

#define SCRIPT "text/javascript; charset=utf-8"
#define STYLE "text/css; charset=utf-8"

static struct {
    struct view_asset asset;
    const unsigned char *end;
} assets[] = {{{"/", "text/html; charset=utf-8", view_asset_index_html, 0}, view_asset_index_html_end},
              {{"/view.css", STYLE, view_asset_view_css, 0}, view_asset_view_css_end},
              {{"/view.js", SCRIPT, view_asset_view_js, 0}, view_asset_view_js_end},
              {{"/module.js", SCRIPT, view_asset_module_js, 0}, view_asset_module_js_end},
              {{"/uplot.js", SCRIPT, view_asset_uplot_js, 0}, view_asset_uplot_js_end},
              {{"/uplot.css", STYLE, view_asset_uplot_css, 0}, view_asset_uplot_css_end}};

#define ASSETS (sizeof assets / sizeof assets[0])

static size_t size_of(size_t i) {
    return (size_t)((uintptr_t)assets[i].end - (uintptr_t)assets[i].asset.bytes);
}

const struct view_asset *view_asset_find(const char *path) {
    for (size_t i = 0; i < ASSETS; i++) {
        if (strcmp(assets[i].asset.path, path) == 0) {
            assets[i].asset.size = size_of(i);
            return &assets[i].asset;
        }
    }
    return NULL;
}

bool view_assets_complete(void) {
    for (size_t i = 0; i < ASSETS; i++) {
        if (size_of(i) == 0) {
            return false;
        }
    }
    return true;
}
