/* The HTML report of a diagnosis: a page that is whole, loads nothing, and says what the diagnosis says. */
#include "support/test.h"

#include <ctype.h>
#include <stdlib.h>
#include <unistd.h>

#include "gap/report_axes.h"
#include "gap/report_html.h"
#include "gap/report_markup.h"
#include "log/run_log.h"
#include "program/table_file.h"
#include "support/scratch.h"

#define TABLE "tables/paper-semicircle.tbt"
#define STEP_US 1000
#define ROW_STEPS 10
#define STEPS 8000 /* of a millisecond: three blocks, one of them held out */
#define ROWS (STEPS / ROW_STEPS)
#define RUNS 2
#define READING_NOISE_PA 60.0
#define POSITION_NOISE_M 3e-5
#define TURN_NOISE 1e-4
#define TAGS_DEEP 64
#define TAG_BYTES 32

static const char *const columns[] = {"time_s", "valve1", "valve2",  "valve3",  "p1_pa",
                                      "p2_pa",  "p3_pa",  "tip_x_m", "tip_y_m", "tip_z_m",
                                      "tip_qw", "tip_qx", "tip_qy",  "tip_qz"};
enum { TIME, DUTY, READING = 4, POSITION = 7, TURN = 10, COLUMNS = 14 };

static struct table_file table;
static char directory[SCRATCH_BYTES];
static char log_path[RUNS][SCRATCH_WITHIN_BYTES], page_path[SCRATCH_WITHIN_BYTES];

/* --- recordings: the plant with creep, driven openly --- */

static double noise(void) {
    static uint64_t state = 1;
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        state = state * 6364136223846793005u + 1442695040888963407u;
        sum += (double)(state >> 11) / 9007199254740992.0;
    }
    return sum;
}

static void drive(size_t run, double time_s, double duty[3]) {
    for (size_t c = 0; c < 3; c++) {
        const double phase = time_s * (0.35 + 0.2 * (double)c) + 0.3 * (double)(run + c);
        duty[c] = phase - floor(phase) < 0.55 ? 0.36 + 0.03 * (double)c : 0.0;
    }
}

static void record(const struct plant *plant, int64_t time_us, const double duty[3], double *row) {
    row[TIME] = 1e-6 * (double)time_us;
    for (size_t k = 0; k < 3; k++) {
        row[DUTY + k] = duty[k];
        row[READING + k] = fmax(plant->reading_pa[k] + READING_NOISE_PA * noise(), 0.0);
        row[POSITION + k] = plant->pose.position_m[k] + POSITION_NOISE_M * noise();
    }
    for (size_t k = 0; k < 4; k++) {
        row[TURN + k] = plant->pose.quaternion[k] + TURN_NOISE * noise();
    }
}

static void simulate(size_t run, double *value) {
    struct plant plant;
    struct plant_parameters nominal;
    struct effect creep;
    double duty[3] = {0.0, 0.0, 0.0};
    effect_init(&creep, effect_kind_find("creep"));
    plant_default_parameters(&nominal);
    plant_init(&plant, &table.table, &nominal);
    assert_true(plant_add_effect(&plant, &creep));
    for (int64_t step = 0; step < STEPS; step++) {
        const int64_t now_us = step * STEP_US;
        if (now_us % nominal.valve.period_us == 0) {
            drive(run, 1e-6 * (double)now_us, duty);
            plant_start_period(&plant, now_us, duty);
        }
        if (step % ROW_STEPS == 0) {
            record(&plant, now_us, duty,
                   value + COLUMNS * (step / ROW_STEPS)); /* the pose of the row before: 10 ms old */
            plant_sample_tip(&plant, NULL, 1e-6 * (double)now_us, 1e-6 * ROW_STEPS * STEP_US, 1.0);
        }
        plant_step(&plant, true, now_us, now_us + STEP_US);
    }
}

static void drop(double *value, size_t first, size_t count) {
    for (size_t row = 0; row < ROWS; row++) {
        for (size_t k = 0; k < count; k++) {
            value[COLUMNS * row + first + k] = NAN;
        }
    }
}

static void write_logs(bool duties, bool turns) {
    static double value[ROWS * COLUMNS];
    const struct run_log_pair metadata[] = {{"module", table.table.module.name}};
    char error[256];
    for (size_t run = 0; run < RUNS; run++) {
        simulate(run, value);
        if (!duties) {
            drop(value, DUTY, 3);
        }
        if (!turns) {
            drop(value, TURN, 4);
        }
        assert_true(run_log_write_columns(log_path[run], columns, value, ROWS, COLUMNS, metadata, 1, error,
                                          sizeof error));
    }
}

static int set_up(void **state) {
    (void)state;
    if (table_file_open(&table, TABLE, NULL) != 0 || !scratch_folder(directory)) {
        return -1;
    }
    for (size_t run = 0; run < RUNS; run++) {
        (void)snprintf(log_path[run], sizeof log_path[run], "%s/run <&> \"%zu\".csv", directory, run + 1);
    }
    (void)snprintf(page_path, sizeof page_path, "%s/page.html", directory);
    return 0;
}

/* --- pages --- */

struct report {
    struct gap_data data;
    struct search search;
    struct diagnosis diagnosis;
    const char *without[SEARCH_CANDIDATES_MAX]; /* the search keeps the pointer */
    char *page;
};

static char *read_file(const char *path) {
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    assert_int_equal(fseek(file, 0, SEEK_END), 0);
    const size_t size = (size_t)ftell(file);
    char *text = calloc(size + 1, 1);
    assert_non_null(text);
    rewind(file);
    assert_int_equal(fread(text, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
    return text;
}

static void write_page(struct report *report) {
    char error[256] = "";
    free(report->page);
    if (!gap_report_html(&report->diagnosis, &report->search, page_path, error, sizeof error)) {
        fail_msg("%s", error);
    }
    report->page = read_file(page_path);
}

/* A diagnosis of the recordings that knows three effects, so that it is soon done. */
static struct report *diagnose(bool duties, bool turns) {
    static const char *const known[] = {"creep", "tip_offset", "valve_sluggish"};
    struct search_options options = {.threads = 1};
    struct plant_parameters nominal;
    const char *paths[RUNS] = {log_path[0], log_path[1]};
    char error[256] = "";
    struct report *report = calloc(1, sizeof *report);
    assert_non_null(report);
    options.without = report->without;
    for (size_t i = 0; i < effect_kind_count(); i++) {
        const char *name = effect_kind_at(i)->name;
        if (strcmp(name, known[0]) != 0 && strcmp(name, known[1]) != 0 && strcmp(name, known[2]) != 0) {
            report->without[options.without_count++] = name;
        }
    }
    write_logs(duties, turns);
    if (!gap_data_read(&report->data, paths, RUNS, error, sizeof error)) {
        fail_msg("%s", error);
    }
    plant_default_parameters(&nominal);
    assert_true(search_run(&report->search, &report->data, &table.table, &nominal, &options));
    assert_true(diagnosis_conclude(&report->diagnosis, &report->search));
    write_page(report);
    return report;
}

static void report_free(struct report *report) {
    search_close(&report->search);
    gap_data_free(&report->data);
    free(report->page);
    free(report);
}

/* Of everything that a log may hold; made once. */
static struct report *complete;

static struct report *complete_report(void) {
    if (complete == NULL) {
        complete = diagnose(true, true);
    }
    return complete;
}

static int tear_down(void **state) {
    (void)state;
    if (complete != NULL) {
        report_free(complete);
    }
    for (size_t run = 0; run < RUNS; run++) {
        (void)remove(log_path[run]);
    }
    (void)remove(page_path);
    table_file_close(&table);
    return rmdir(directory);
}

static void assert_has(const char *page, const char *text) {
    if (strstr(page, text) == NULL) {
        fail_msg("the page does not hold '%s'", text);
    }
}

static void assert_has_not(const char *page, const char *text) {
    const char *at = strstr(page, text);
    if (at != NULL) {
        fail_msg("the page holds '%s': %.60s", text, at);
    }
}

static size_t count_of(const char *page, const char *text) {
    const size_t length = strlen(text);
    size_t count = 0;
    while ((page = strstr(page, text)) != NULL) {
        page += length;
        count++;
    }
    return count;
}

/* --- is it well-formed? What XML asks for, of what these pages use --- */

struct tags {
    size_t depth;
    char open[TAGS_DEEP][TAG_BYTES];
};

static const char *take_name(const char *at, char name[TAG_BYTES]) {
    size_t length = 0;
    while (isalnum((unsigned char)*at) || *at == '-') {
        assert_true(length + 1 < TAG_BYTES);
        name[length++] = *at++;
    }
    name[length] = '\0';
    return at;
}

/* name="value", each once, up to > or />. */
static const char *take_attributes(const char *at) {
    char name[TAG_BYTES];
    while (*at == ' ') {
        at = take_name(at + 1, name);
        if (*name == '\0' || strncmp(at, "=\"", 2) != 0) {
            fail_msg("an attribute without a quoted value: %.60s", at);
        }
        const size_t length = strcspn(at + 2, "\"<");
        assert_int_equal(at[2 + length], '"');
        at += 3 + length;
    }
    return at;
}

static const char *take_tag(struct tags *tags, const char *at) {
    char name[TAG_BYTES];
    if (at[1] == '/') {
        const char *end = take_name(at + 2, name);
        if (tags->depth == 0 || strcmp(tags->open[tags->depth - 1], name) != 0 || *end != '>') {
            fail_msg("</%s> closes <%s>", name, tags->depth > 0 ? tags->open[tags->depth - 1] : "nothing");
        }
        tags->depth--;
        return end + 1;
    }
    const char *end = take_attributes(take_name(at + 1, name));
    if (strncmp(end, "/>", 2) == 0) {
        return end + 2;
    }
    if (*name == '\0' || *end != '>' || tags->depth == TAGS_DEEP) {
        fail_msg("no tag: %.60s", at);
    }
    memcpy(tags->open[tags->depth++], name, TAG_BYTES);
    return end + 1;
}

static const char *take_entity(const char *at) {
    static const char *const known[] = {"&lt;", "&gt;", "&amp;", "&quot;", "&#39;"};
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        if (strncmp(at, known[i], strlen(known[i])) == 0) {
            return at + strlen(known[i]);
        }
    }
    fail_msg("a bare ampersand: %.60s", at);
    return at + 1;
}

static void assert_well_formed(const char *page) {
    static const char doctype[] = "<!DOCTYPE html>\n";
    struct tags tags = {.depth = 0};
    assert_memory_equal(page, doctype, sizeof doctype - 1);
    for (const char *at = page + sizeof doctype - 1; *at != '\0';) {
        at = *at == '<' ? take_tag(&tags, at) : *at == '&' ? take_entity(at) : at + 1;
    }
    assert_int_equal(tags.depth, 0);
}

/* printf's words for what is no number, standing alone. */
static void assert_no_number_is(const char *page, const char *word) {
    for (const char *at = strstr(page, word); at != NULL; at = strstr(at + 1, word)) {
        if (!islower((unsigned char)at[-1]) && !isalpha((unsigned char)at[strlen(word)])) {
            fail_msg("the page holds a number that is %s: %.60s", word, at - 20);
        }
    }
}

static void assert_whole(const char *page) {
    assert_well_formed(page);
    assert_has(page, "</html>");
    assert_no_number_is(page, "nan");
    assert_no_number_is(page, "inf");
}

/* --- tests --- */

static void the_page_is_whole_and_says_what_was_found(void **state) {
    (void)state;
    const struct report *report = complete_report();
    assert_whole(report->page);
    assert_has(report->page, gap_verdict_name(report->diagnosis.verdict));
    assert_has(report->page, "creep");
    for (size_t e = 0; e < report->diagnosis.effects; e++) {
        assert_has(report->page, report->diagnosis.effect[e].kind->name);
    }
    assert_has(report->page, table.table.module.name);
    assert_has(report->page, "left out on request");
    assert_has(report->page, "pairs of a residual and a variable"); /* on what the residuals depend */
}

static void the_page_loads_nothing(void **state) {
    (void)state;
    static const char *const loads[] = {"http", "//", "src=", "url(", "@import", "<script", "<link", "<img"};
    const struct report *report = complete_report();
    for (size_t i = 0; i < sizeof loads / sizeof loads[0]; i++) {
        /* the path of a log may hold what it likes; here it holds none of these */
        assert_has_not(report->page, loads[i]);
    }
}

static void paths_are_escaped(void **state) {
    (void)state;
    const struct report *report = complete_report();
    assert_has(report->page, "run &lt;&amp;&gt; &quot;2&quot;.csv");
    assert_has_not(report->page, "<&>");
}

static void every_link_leads_somewhere(void **state) {
    (void)state;
    const struct report *report = complete_report();
    size_t links = 0;
    for (const char *at = strstr(report->page, "href=\"#"); at != NULL;
         at = strstr(at + 1, "href=\"#"), links++) {
        char anchor[64];
        (void)snprintf(anchor, sizeof anchor, "id=\"%.*s\"", (int)strcspn(at + 7, "\""), at + 7);
        assert_int_equal(count_of(report->page, anchor), 1);
    }
    assert_true(links > 0);
}

/* Chambers 3, tip 5 and the distance between both, in each run: measured, before, after. */
static void measured_and_simulated_are_drawn(void **state) {
    (void)state;
    const struct report *report = complete_report();
    const char *runs = strstr(report->page, "id=\"runs\""), *end = strstr(report->page, "id=\"residuals\"");
    assert_true(runs != NULL && end > runs);
    char *section = strndup(runs, (size_t)(end - runs));
    assert_int_equal(count_of(section, "line measured"), RUNS * 8);
    assert_int_equal(count_of(section, "line before"), RUNS * 9);
    assert_int_equal(count_of(section, "line after"), RUNS * 9);
    assert_true(count_of(section, "<rect class=\"held\"") > 0);
    assert_has(section, "tip direction");
    assert_has_not(section, "d=\"\""); /* a line of no points */
    free(section);
}

static void without_orientation_the_position_remains(void **state) {
    (void)state;
    struct report *report = diagnose(true, false);
    assert_whole(report->page);
    assert_has_not(report->page, "tip bend");
    assert_has(report->page, "tip x");
    assert_has(report->page, "tip off axis");
    report_free(report);
}

static void without_duties_it_says_what_was_not_tried(void **state) {
    (void)state;
    struct report *report = diagnose(false, true);
    assert_whole(report->page);
    assert_has(report->page, "no duties in the logs: valve_sluggish");
    report_free(report);
}

static void every_verdict_has_its_page(void **state) {
    (void)state;
    struct report *report = complete_report();
    const struct diagnosis kept = report->diagnosis;
    assert_true(kept.effects > 0);
    diagnosis_warn(&report->diagnosis, "a note with <b> & \xff");
    report->diagnosis.group = 2;
    report->diagnosis.group_name[0] = "tip_offset";
    report->diagnosis.group_name[1] = "creep";
    (void)snprintf(report->diagnosis.next_experiment, DIAGNOSIS_TEXT_BYTES, "hold & wait");
    for (int verdict = 0; verdict < GAP_VERDICT_COUNT; verdict++) {
        report->diagnosis.verdict = (enum gap_verdict)verdict;
        write_page(report);
        assert_whole(report->page);
        assert_has(report->page, gap_verdict_name(report->diagnosis.verdict));
        assert_has(report->page, "a note with &lt;b&gt; &amp; \xef\xbf\xbd");
        assert_has(report->page, "hold &amp; wait");
    }
    report->diagnosis = kept;
    write_page(report);
}

static void a_page_that_cannot_be_written_is_an_error(void **state) {
    (void)state;
    const struct report *report = complete_report();
    char error[256] = "";
    assert_false(
        gap_report_html(&report->diagnosis, &report->search, "/nowhere/page.html", error, sizeof error));
    assert_non_null(strstr(error, "/nowhere/page.html"));
}

static char *written(void (*write)(FILE *out)) {
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    assert_non_null(out);
    write(out);
    assert_int_equal(fclose(out), 0);
    return text;
}

static void write_quantities(FILE *out) {
    const struct diagnosis_interval offset = {0.00123, 0.00119, 0.00127}, delay = {0.0123, 0.0118, 0.0128};
    markup_interval(out, &offset, "m");
    fputs("; ", out);
    markup_interval(out, &delay, "s");
    fputs("; ", out);
    markup_quantity(out, -M_PI / 6.0, "rad");
    fputs("; ", out);
    markup_quantity(out, NAN, "Pa");
    fputs("; ", out);
    markup_percent(out, 0.987);
}

static void quantities_stand_in_units_that_people_use(void **state) {
    (void)state;
    char *text = written(write_quantities);
    assert_string_equal(text, "1.23 (1.19 to 1.27)\xc2\xa0mm; 12.3 (11.8 to 12.8)\xc2\xa0ms; \xe2\x88\x92"
                              "30.0\xc2\xa0"
                              "deg; \xe2\x80\x93; 99\xc2\xa0%");
    free(text);
}

/* A thousand points with one spike, drawn with forty. */
static void write_spike(FILE *out) {
    static double x[1000], y[1000];
    const struct axes axes = {.width = 100.0, .height = 100.0, .x_high = 1000.0, .y_high = 1.0};
    const struct axes_points points = {x, y, 1, 1000};
    for (size_t i = 0; i < 1000; i++) {
        x[i] = (double)i;
        y[i] = i == 567 ? 1.0 : 0.5;
    }
    axes_line(out, &axes, "line", &points, 40, 100.0);
}

static void a_thinned_line_keeps_its_extremes(void **state) {
    (void)state;
    char *text = written(write_spike);
    assert_has(text, "L56.7 0.0");
    assert_int_equal(count_of(text, "M"), 1);
    assert_true(count_of(text, "L") < 40);
    free(text);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_page_is_whole_and_says_what_was_found),
        cmocka_unit_test(the_page_loads_nothing),
        cmocka_unit_test(paths_are_escaped),
        cmocka_unit_test(every_link_leads_somewhere),
        cmocka_unit_test(measured_and_simulated_are_drawn),
        cmocka_unit_test(without_orientation_the_position_remains),
        cmocka_unit_test(without_duties_it_says_what_was_not_tried),
        cmocka_unit_test(every_verdict_has_its_page),
        cmocka_unit_test(a_page_that_cannot_be_written_is_an_error),
        cmocka_unit_test(quantities_stand_in_units_that_people_use),
        cmocka_unit_test(a_thinned_line_keeps_its_extremes),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
