/* What the parts of a diagnosis ask of each other, in the order in which they are asked: how far
 * (diagnosis_measure.c), which (diagnosis_belief.c), where and the verdict (diagnosis.c), in words
 * (diagnosis_words.c). For these files only. */
#ifndef TRIBEND_GAP_DIAGNOSIS_PARTS_H
#define TRIBEND_GAP_DIAGNOSIS_PARTS_H

#include "gap/diagnosis.h"

#define SURE 0.65             /* belief above which one name is the verdict */
#define MOVES_LEAST_PA 1500.0 /* a recording in which no pressure moves by more says nothing */

/* The residuals' figures with their intervals, the share closed, the structure left and what it looks like.
 * False: out of memory. */
bool diagnosis_measure(struct diagnosis *diagnosis, struct search *search);
/* The effects of the best model, with intervals of their parameters. */
void diagnosis_take_effects(struct diagnosis *diagnosis, const struct search *search);
/* How sure each of them is among its rivals, and the group of those that fit as well. */
void diagnosis_believe(struct diagnosis *diagnosis, const struct search *search);
/* Once the verdict is reached: beliefs among rivals become probabilities that leave room for what was not tried. */
void diagnosis_temper(struct diagnosis *diagnosis, const struct search *search);
/* By how much the pressure of a chamber moves, at most in one run. */
double diagnosis_moves_pa(const struct gap_data *data, size_t chamber);
/* Does another simulator move in a way that our table model cannot follow? It is then likely to err smoothly,
 * as bent fields and the like do, too. */
bool diagnosis_is_strange(const struct search *search);
/* What the data lack, as warnings. */
void diagnosis_describe_data(struct diagnosis *diagnosis, const struct search *search);
/* Of an unknown gap: the models that come nearest, each set of kinds by its best, in the order of what they
 * leave. */
void diagnosis_find_closest(struct diagnosis *diagnosis, const struct search *search);
/* What to record next. */
void diagnosis_suggest(struct diagnosis *diagnosis);
/* A warning, and no verdict of no gap, where what is called noise may hide one. */
void diagnosis_doubt_floor(struct diagnosis *diagnosis, const struct search *search);

#endif
