/* What the parts of the search (search.c) ask of each other, in the order in which they are asked: which
 * candidates there are (search_catalogue.c), the few that are worth a closer fit (search_screen.c), what is
 * left to explain and what earns a place (search_judge.c), since when it acts (search_onset.c), all of that
 * for one effect more (search_step.c), once again where something sets in late (search_late.c), and what gives
 * way to what could be in its place (search_revise.c). The fits of the whole and the threads stand in
 * search_fits.c. For these files only. */
#ifndef TRIBEND_GAP_SEARCH_PARTS_H
#define TRIBEND_GAP_SEARCH_PARTS_H

#include "gap/search.h"

#define PAIRED_MAX 6        /* the best alone, of which all pairs are tried */
/* Starts of an effect of which several parameters say where or which way: too many to fit from each. */
#define SEARCH_STARTS_PLACED 128
#define REFINE_ROUNDS 6     /* of a fit in earnest */
#define STRUCTURE_LEAST 0.2 /* mean square in units of a block's noise that is worth explaining */
#define SEARCH_REVISIONS 3  /* by rivals, at most */
#define FAINT 1.5 /* mean square below which a first effect, too, must explain most of what there is */

struct search_candidate {
    const struct effect_kind *kind;
    size_t chamber;
    size_t form;
};

/* Room for the fits of a step; what did best alone is kept for the next one. */
struct search_workspace {
    struct search_candidate list[SEARCH_CANDIDATES_MAX];
    size_t candidates;
    struct fit fits[SEARCH_CANDIDATES_MAX];
    struct fit *order[SEARCH_CANDIDATES_MAX];
    struct fit single[PAIRED_MAX];
    size_t singles;
    struct fit pairs[PAIRED_MAX * PAIRED_MAX];
    struct fit *pair_order[PAIRED_MAX * PAIRED_MAX];
};

/* A fitter for each thread, all on one base. */
struct search_crew {
    struct fitter *fitter;
    int count;
};

/* --- search_catalogue.c --- */

/* Do all runs have duties, and tip poses beside them? */
bool search_all_have_duties(const struct gap_data *data);
/* What the data could show, in the catalogue's order; returns how many. */
size_t search_list_candidates(const struct search *search, struct search_candidate *list);
/* Must the gas be replayed for it? */
bool search_needs_gas(const struct effect_kind *kind);
/* The k-th start: typical; the other way round; then secondary parameters spread over their bounds. Returns
 * how many starts there are. */
size_t search_place_start(const struct effect_kind *kind, size_t k, struct effect *effect);

/* --- search_fits.c --- */

/* To be closed in either case. False: out of memory. */
bool search_crew_open(struct search_crew *crew, const struct search *search, const struct fit_base *base);
void search_crew_close(struct search_crew *crew);
/* Did whoever asked for the search ask for its end? */
bool search_stopped(const struct search *search);
/* Tells of progress, from any thread. */
void search_say(const struct search *search, const char *what, size_t done, size_t total);
/* What the recalibrated model leaves under the present smoothing and weights, by which the rest is judged.
 * False: out of memory. */
bool search_compare_again(struct search *search);
/* Fit both scales; smoothing and weights follow the model that comes out. False: out of memory. */
bool search_recalibrate(struct search *search, struct fit *fit, bool fit_nominal);
/* What the reports say of parameters comes from all the data. False: out of memory. */
bool search_fit_everything(struct search *search);

/* --- search_screen.c --- */

/* All candidates on top of `onto`, coarsely; `order` gets those that are not hopeless, best first. Returns
 * how many. */
size_t search_screen(struct search *search, struct search_crew *crew, const struct gap_model *onto,
                     const struct search_candidate *list, size_t count, struct fit *fits, struct fit **order);
/* Keeps those worth a closer fit, best first: of each kind a few, and of those that are dear to replay a few.
 * Returns how many. */
size_t search_choose(struct fit **order, size_t count);
/* Fits them closely, puts the best first and notes them as trials of that step. */
void search_refine(struct search *search, struct search_crew *crew, struct fit **order, size_t count,
                   size_t step);

/* --- search_judge.c --- */

/* Sum of the held-out squares; infinite where the fit is not sound. */
double search_held_out(const struct fit *fit);
/* Mean square of the held-out residuals less what noise alone makes: what is left to explain. */
double search_structure(const struct fit *fit);
/* Is what the model leaves more than noise? */
bool search_is_structured(const struct fit *fit);
/* Does the model leave so much, in pressures or at the tip, that a further effect is worth looking for? */
bool search_has_rest(const struct search *search, const struct fit *fit);
/* What noise could take off the held-out squares, with that fit after it. */
double search_gain_by_noise(const struct fit *after);
/* Does the second explain so much more that its effect may have a place? */
bool search_is_better(const struct fit *before, const struct fit *after);
/* .. and does it have one: is it what there is to explain, or the rest of that? */
bool search_earns_place(const struct search *search, const struct fit *before, const struct fit *after);
/* Does another single effect that explains more altogether also explain clearly more of just what gives the second its place? */
bool search_is_forestalled(const struct search *search, const struct fit *before, const struct fit *after,
                           const struct fit *other);

/* --- search_onset.c --- */

/* When did each effect of the fit set in? */
void search_find_onsets(struct search *search, struct search_crew *crew, struct fit *fit);
/* The onsets of what was found alone without them; better than `least`, and the best becomes it. */
void search_place_onsets(struct search *search, const struct search_workspace *room, struct fit *least);

/* --- search_step.c --- */

/* One more effect on top of the best model. True: one was found. */
bool search_add_one(struct search *search, struct search_workspace *room, size_t step);

/* --- search_late.c --- */

/* An effect that sets in late is taken for another while candidates act from the start. Where much is left,
 * all are tried again from the onset that was found, or where none was, on the last part of the recording.
 * False: out of memory. */
bool search_after_onset(struct search *search, struct search_workspace *room);

/* --- search_revise.c --- */

/* Those that gave way to a rival already. */
struct search_past {
    const struct effect_kind *kind[SEARCH_REVISIONS];
    size_t count;
};

/* What the comparison with rivals asks for: the rival that is believed in an effect's place, or the model
 * without an effect that could as well be others and is not needed. NULL: nothing. `past` notes who gives way; to be
 * called SEARCH_REVISIONS times at most. */
const struct fit *search_ask_rivals(const struct search *search, struct search_past *past);
/* Rivals are compared under the final weights: what they show may overturn what the search took on its way.
 * `overturned`: it did. False: out of memory. */
bool search_compare_rivals(struct search *search, bool *overturned);

#endif
