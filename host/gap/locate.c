#include "gap/locate.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#define BINS 8
#define NO_BIN 255
#define BIN_WIDTH_LEAST 0.04 /* of a variable's range: finer differences are noise, which the residual may share */
#define BIN_SHARE_LEAST 0.02 /* of the rows, for a bin to count */
#define ROWS_LEAST 60
#define PERMUTATIONS 3999
#define EXCEEDED_ENOUGH 20 /* a test ends early once chance has done as well so many times */
#define MEMORIES 4.0       /* of a block's length in integrated correlation times */
#define BLOCKS_LEAST 16    /* of all rows: fewer cannot be told from chance */
#define BLOCK_ROWS_LEAST 4

/* --- chance: splitmix64 (Steele, Lea and Flood 2014) --- */

static uint64_t draw(uint64_t *state) {
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static size_t below(uint64_t *state, size_t count) {
    return (size_t)(draw(state) % count);
}

/* --- bins --- */

struct bins {
    size_t count;
    uint8_t *of; /* [rows]; NO_BIN: not known */
    double from[BINS + 1];
    double to[BINS + 1];
};

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Equal counts, but none narrower than is worth telling apart; every value of a category is a bin. */
static void cut(const double *sorted, size_t count, bool categories, struct bins *bins) {
    const double range = sorted[(size_t)(0.99 * (double)(count - 1))] - sorted[(size_t)(0.01 * (double)(count - 1))];
    const double width = categories ? 0.0 : BIN_WIDTH_LEAST * range;
    const size_t most = categories ? 1 : (count + BINS - 1) / BINS;
    size_t first = 0;
    bins->count = 0;
    for (size_t i = 0; i < count && (categories || range > 0.0); i++) {
        const bool ends = i + 1 == count || (sorted[i + 1] > sorted[i] && i + 1 - first >= most && sorted[i] - sorted[first] >= width);
        if (!ends) {
            continue;
        }
        const bool small = (double)(i + 1 - first) < BIN_SHARE_LEAST * (double)count || bins->count == BINS + 1;
        if (small && !categories && bins->count > 0) {
            bins->to[bins->count - 1] = sorted[i]; /* what is left over joins its neighbour */
        } else if (bins->count <= BINS) {
            bins->from[bins->count] = sorted[first];
            bins->to[bins->count++] = sorted[i];
        }
        first = i + 1;
    }
}

/* False: out of memory. No bins where there is nothing to tell apart. */
static bool bins_open(struct bins *bins, const struct locate_variable *variable, size_t rows) {
    double *sorted = malloc((rows + 1) * sizeof *sorted);
    size_t count = 0;
    bins->count = 0;
    bins->of = malloc(rows + 1);
    if (sorted == NULL || bins->of == NULL) {
        free(sorted);
        return false;
    }
    for (size_t i = 0; i < rows; i++) {
        if (!isnan(variable->value[i])) {
            sorted[count++] = variable->value[i];
        }
    }
    qsort(sorted, count, sizeof *sorted, ascending);
    if (count >= ROWS_LEAST) {
        cut(sorted, count, variable->categories, bins);
    }
    for (size_t i = 0; i < rows; i++) {
        size_t k = 0;
        while (k < bins->count && !(variable->value[i] <= bins->to[k])) {
            k++;
        }
        bins->of[i] = k < bins->count ? (uint8_t)k : NO_BIN;
    }
    free(sorted);
    return true;
}

/* --- the statistic --- */

struct ratio {
    double share; /* between bins, of all */
    size_t worst; /* the bin that is farthest from zero, among those with enough rows .. */
    double off;   /* .. and its mean */
};

static struct ratio correlation_ratio(const struct bins *bins, const double *residual, size_t rows) {
    double sum[BINS + 2] = {0.0}, count[BINS + 2] = {0.0}, square = 0.0, all = 0.0, total = 0.0, between = 0.0, most = -1.0;
    struct ratio out = {0.0, 0, 0.0};
    for (size_t i = 0; i < rows; i++) {
        const size_t k = bins->of[i];
        if (k != NO_BIN && !isnan(residual[i])) {
            sum[k] += residual[i];
            count[k] += 1.0;
            square += residual[i] * residual[i];
        }
    }
    for (size_t k = 0; k < bins->count; k++) {
        all += count[k];
        total += sum[k];
        between += count[k] > 0.0 ? sum[k] * sum[k] / count[k] : 0.0;
    }
    const double variance = all > 0.0 ? square - total * total / all : 0.0;
    if (all < ROWS_LEAST || !(variance > 1e-12 * square)) {
        return out;
    }
    out.share = (between - total * total / all) / variance;
    for (size_t k = 0; k < bins->count; k++) {
        const double off = count[k] >= BIN_SHARE_LEAST * all ? fabs(sum[k] / count[k]) : -1.0;
        if (off > most) {
            most = off;
            out.worst = k;
            out.off = sum[k] / count[k];
        }
    }
    return out;
}

/* --- blocks --- */

/* Rows over which a residual is correlated with itself: 1 + 2 (r1 + r2 + ..) up to where it first is not. */
static double memory_rows(const double *residual, size_t rows) {
    double mean = 0.0, count = 0.0, variance = 0.0, memory = 1.0;
    for (size_t i = 0; i < rows; i++) {
        mean += isnan(residual[i]) ? 0.0 : residual[i];
        count += isnan(residual[i]) ? 0.0 : 1.0;
    }
    mean /= fmax(count, 1.0);
    for (size_t i = 0; i < rows; i++) {
        variance += isnan(residual[i]) ? 0.0 : (residual[i] - mean) * (residual[i] - mean);
    }
    variance /= fmax(count, 1.0);
    for (size_t lag = 1; lag < rows / BLOCKS_LEAST && variance > 0.0; lag++) {
        double product = 0.0, pairs = 0.0;
        for (size_t i = lag; i < rows; i++) {
            const double both = (residual[i] - mean) * (residual[i - lag] - mean);
            product += isnan(both) ? 0.0 : both;
            pairs += isnan(both) ? 0.0 : 1.0;
        }
        const double correlation = pairs > 0.0 ? product / pairs / variance : 0.0;
        if (correlation <= 0.0) {
            break;
        }
        memory += 2.0 * correlation;
    }
    return memory;
}

static size_t block_rows(const double *residual, size_t rows) {
    const double wanted = ceil(MEMORIES * memory_rows(residual, rows));
    const size_t most = rows / BLOCKS_LEAST;
    const size_t block = wanted < (double)most ? (size_t)wanted : most;
    return block > BLOCK_ROWS_LEAST ? block : BLOCK_ROWS_LEAST;
}

/* The residual turned by a random number of rows, cut into blocks, in random order. */
static void shuffle_blocks(const double *residual, size_t rows, size_t block, uint64_t *chance, size_t *order, double *out) {
    const size_t blocks = (rows + block - 1) / block, turn = below(chance, rows);
    size_t at = 0;
    for (size_t b = 0; b < blocks; b++) {
        const size_t other = below(chance, b + 1);
        order[b] = order[other];
        order[other] = b;
    }
    for (size_t b = 0; b < blocks; b++) {
        const size_t first = order[b] * block, last = first + block < rows ? first + block : rows;
        for (size_t i = first; i < last; i++) {
            const size_t from = i + turn;
            out[at++] = residual[from < rows ? from : from - rows];
        }
    }
}

/* --- the tests of one residual --- */

struct test {
    size_t variable;
    struct ratio seen;
    double chance_sum; /* of shares that chance made */
    size_t drawn;
    size_t exceeded;
};

static void conclude(const struct test *test, const struct bins *bins, size_t residual, struct locate_dependence *out) {
    const bool ended_early = test->exceeded == EXCEEDED_ENOUGH;
    const double chance = test->chance_sum / (double)test->drawn;
    *out = (struct locate_dependence){
        .residual = residual,
        .variable = test->variable,
        .share = fmax((test->seen.share - chance) / fmax(1.0 - chance, 1e-9), 0.0),
        .p = ended_early ? (double)test->exceeded / (double)test->drawn : (double)(test->exceeded + 1) / (double)(test->drawn + 1),
        .from = bins->from[test->seen.worst],
        .to = bins->to[test->seen.worst],
        .off = test->seen.off};
}

/* How many tests there are; SIZE_MAX: out of memory. */
static size_t test_residual(const struct locate_table *table, const struct bins *bins, size_t index, uint64_t seed,
                            struct locate_dependence *out) {
    const double *residual = table->residual[index].value;
    const size_t rows = table->rows, block = block_rows(residual, rows);
    struct test test[LOCATE_VARIABLES_MAX];
    double *moved = malloc((rows + 1) * sizeof *moved);
    size_t *order = malloc((rows / block + 2) * sizeof *order), tests = 0, open = 0;
    uint64_t chance = seed ^ ((uint64_t)(index + 1) * 0x2545f4914f6cdd1du);
    if (moved == NULL || order == NULL) {
        free(moved);
        free(order);
        return SIZE_MAX;
    }
    for (size_t v = 0; v < table->variables; v++) {
        const struct ratio seen = correlation_ratio(&bins[v], residual, rows);
        if (bins[v].count > 1 && seen.share > 0.0) {
            test[tests++] = (struct test){.variable = v, .seen = seen};
        }
    }
    open = tests;
    for (size_t k = 0; k < PERMUTATIONS && open > 0; k++) {
        shuffle_blocks(residual, rows, block, &chance, order, moved);
        for (size_t t = 0; t < tests; t++) {
            if (test[t].exceeded == EXCEEDED_ENOUGH) {
                continue;
            }
            const double share = correlation_ratio(&bins[test[t].variable], moved, rows).share;
            test[t].chance_sum += share;
            test[t].drawn++;
            test[t].exceeded += share >= test[t].seen.share ? 1 : 0;
            open -= test[t].exceeded == EXCEEDED_ENOUGH ? 1 : 0;
        }
    }
    for (size_t t = 0; t < tests; t++) {
        conclude(&test[t], &bins[test[t].variable], index, &out[t]);
    }
    free(moved);
    free(order);
    return tests;
}

/* --- the chamber: whether one errs more than the others --- */

struct chambers {
    size_t blocks;
    double (*square)[3]; /* sums of squares of a block */
    double all[3];
    double count[3];
};

/* How uneven: the variance of the chambers' sums. */
static double unevenness(const double sum[3]) {
    const double mean = (sum[0] + sum[1] + sum[2]) / 3.0;
    double spread = 0.0;
    for (size_t c = 0; c < 3; c++) {
        spread += (sum[c] - mean) * (sum[c] - mean);
    }
    return spread;
}

static bool chambers_open(struct chambers *chambers, const struct locate_table *table, const size_t index[3]) {
    const size_t rows = table->rows;
    size_t block = 0;
    for (size_t c = 0; c < 3; c++) {
        const size_t own = block_rows(table->residual[index[c]].value, rows);
        block = own > block ? own : block;
    }
    chambers->blocks = (rows + block - 1) / block;
    chambers->square = calloc(chambers->blocks + 1, sizeof *chambers->square);
    for (size_t i = 0; i < rows && chambers->square != NULL; i++) {
        for (size_t c = 0; c < 3; c++) {
            const double value = table->residual[index[c]].value[i], square = isnan(value) ? 0.0 : value * value;
            chambers->square[i / block][c] += square;
            chambers->all[c] += square;
            chambers->count[c] += isnan(value) ? 0.0 : 1.0;
        }
    }
    return chambers->square != NULL;
}

/* In every block the chambers change places at random. */
static double uneven_by_chance(const struct chambers *chambers, uint64_t *chance) {
    static const size_t orders[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
    double sum[3] = {0.0, 0.0, 0.0};
    for (size_t b = 0; b < chambers->blocks; b++) {
        const size_t *order = orders[below(chance, 6)];
        for (size_t c = 0; c < 3; c++) {
            sum[c] += chambers->square[b][order[c]];
        }
    }
    return unevenness(sum);
}

/* 1: there is such a test, 0: there is none; SIZE_MAX: out of memory. */
static size_t test_chambers(const struct locate_table *table, uint64_t seed, struct locate_dependence *out) {
    struct chambers chambers = {0};
    size_t index[3] = {0, 0, 0}, found = 0, most = 0, drawn = 0, exceeded = 0;
    uint64_t chance = seed ^ 0x6a09e667f3bcc909u;
    for (size_t r = 0; r < table->residuals; r++) {
        if (table->residual[r].chamber > 0) {
            index[table->residual[r].chamber - 1] = r;
            found++;
        }
    }
    if (found != 3) {
        return 0;
    }
    if (!chambers_open(&chambers, table, index)) {
        return SIZE_MAX;
    }
    const double seen = unevenness(chambers.all), sum = chambers.all[0] + chambers.all[1] + chambers.all[2];
    while (drawn < PERMUTATIONS && exceeded < EXCEEDED_ENOUGH) {
        exceeded += uneven_by_chance(&chambers, &chance) >= seen ? 1 : 0;
        drawn++;
    }
    for (size_t c = 1; c < 3; c++) {
        most = chambers.all[c] > chambers.all[most] ? c : most;
    }
    free(chambers.square);
    *out = (struct locate_dependence){
        .residual = index[most],
        .variable = LOCATE_VARIABLES_MAX,
        .share = sum > 0.0 ? 1.5 * (chambers.all[most] / sum - 1.0 / 3.0) : 0.0,
        .p = exceeded == EXCEEDED_ENOUGH ? (double)exceeded / (double)drawn : (double)(exceeded + 1) / (double)(drawn + 1),
        .from = (double)(most + 1),
        .to = (double)(most + 1),
        .off = sqrt(chambers.all[most] / fmax(chambers.count[most], 1.0))};
    return sum > 0.0 ? 1 : 0;
}

/* --- which to believe --- */

static int less_likely(const void *a, const void *b) {
    const struct locate_dependence *x = a, *y = b;
    return (x->p > y->p) - (x->p < y->p);
}

static int stronger(const void *a, const void *b) {
    const struct locate_dependence *x = a, *y = b;
    if (x->share > y->share || x->share < y->share) {
        return x->share < y->share ? 1 : -1;
    }
    return x->residual != y->residual ? (x->residual > y->residual) - (x->residual < y->residual)
                                      : (x->variable > y->variable) - (x->variable < y->variable);
}

/* Benjamini and Hochberg's step-up; those that pass come first, strongest first. */
static size_t keep_discoveries(struct locate_dependence *found, size_t tests) {
    double least = 1.0;
    size_t kept = 0;
    qsort(found, tests, sizeof *found, less_likely);
    for (size_t k = tests; k > 0; k--) {
        least = fmin(least, found[k - 1].p * (double)tests / (double)k);
        found[k - 1].q = least;
        kept += least <= LOCATE_FALSE_SHARE ? 1 : 0;
    }
    qsort(found, kept, sizeof *found, stronger);
    return kept;
}

size_t locate_find(const struct locate_table *table, uint64_t seed, struct locate_dependence found[LOCATE_FOUND_MAX], size_t *tested) {
    struct bins bins[LOCATE_VARIABLES_MAX] = {{0}};
    struct locate_dependence *own = calloc(LOCATE_FOUND_MAX, sizeof *own);
    size_t count[LOCATE_RESIDUALS_MAX + 1] = {0};
    bool sound = own != NULL;
    *tested = 0;
    for (size_t v = 0; v < table->variables && sound; v++) {
        sound = bins_open(&bins[v], &table->variable[v], table->rows);
    }
    if (sound && table->rows >= ROWS_LEAST) {
#pragma omp parallel for schedule(dynamic, 1) num_threads(table->threads > 0 ? table->threads : omp_get_max_threads())
        for (size_t r = 0; r <= table->residuals; r++) {
            struct locate_dependence *out = own + r * LOCATE_VARIABLES_MAX;
            count[r] = r < table->residuals ? test_residual(table, bins, r, seed, out) : test_chambers(table, seed, out);
        }
    }
    for (size_t r = 0; r <= table->residuals && sound; r++) {
        sound = count[r] != SIZE_MAX;
        if (sound && count[r] > 0) {
            memcpy(found + *tested, own + r * LOCATE_VARIABLES_MAX, count[r] * sizeof *found);
            *tested += count[r];
        }
    }
    for (size_t v = 0; v < table->variables; v++) {
        free(bins[v].of);
    }
    free(own);
    return sound ? keep_discoveries(found, *tested) : SIZE_MAX;
}
