/* A diagnosis as one web page: verdict, where, which, how far, and the pictures behind them. */
#ifndef TRIBEND_GAP_REPORT_HTML_H
#define TRIBEND_GAP_REPORT_HTML_H

#include "gap/diagnosis.h"

/* One file that loads nothing else, aside and renamed; `search` is the one that `diagnosis` was drawn from,
 * and still open. False: `error` says why there is none. */
bool gap_report_html(const struct diagnosis *diagnosis, const struct search *search, const char *path,
                     char *error, size_t error_bytes);

#endif
