/* What a material law may be used for, in words. */
#ifndef TRIBEND_MATERIAL_REPORT_H
#define TRIBEND_MATERIAL_REPORT_H

#include "material/material_stability.h"

/* One line for each way of pulling: where the nominal stress turns, where ellipticity is lost. */
void material_report_stability(const struct material *material);

#endif
