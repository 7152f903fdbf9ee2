/* The head of the HTML report: verdict, where, which and how far. */
#ifndef TRIBEND_GAP_REPORT_VERDICT_H
#define TRIBEND_GAP_REPORT_VERDICT_H

#include <stdio.h>

#include "gap/diagnosis.h"

/* One line, plain text. */
void report_headline(FILE *out, const struct diagnosis *diagnosis);
void report_verdict(FILE *out, const struct diagnosis *diagnosis, const struct search *search);

#endif
