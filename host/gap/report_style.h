/* The HTML report's style sheet: light and dark, screen and print; colours that the colour-blind tell apart
 * (Okabe and Ito 2008). */
#ifndef TRIBEND_GAP_REPORT_STYLE_H
#define TRIBEND_GAP_REPORT_STYLE_H

#include <stdio.h>

/* As an HTML style element. */
void report_style(FILE *out);

#endif
