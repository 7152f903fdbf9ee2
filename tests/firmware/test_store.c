#include "support/test.h"

#include <stdlib.h>

#include "comms/store.h"
#include "control/crc32.h"
#include "program/table_file.h"
#include "support/sim_storage.h"
#include "support/synthetic_table.h"

#define SENSOR_MOST_PA 49900.0f
#define SLOT_BYTES (16u * SIM_STORAGE_PAGE)
#define STEPS_MOST 400000
#define CHUNK 7u
#define NODE_ID 1u
#define READING_GAIN_1 100u

static struct sim_storage storage;
static struct store store;
static struct synthetic_table old_table, new_table, other_table;

static double new_module(enum bend_table_channel channel, const double pressure_pa[3]) {
    return 1.01 * synthetic_module(channel, pressure_pa);
}

static int create_tables(void **state) {
    (void)state;
    synthetic_table_create(&old_table, 4, 10000.0, 1.0, synthetic_module);
    synthetic_table_create(&new_table, 4, 10000.0, 1.0, new_module);
    synthetic_table_create(&other_table, 4, 10000.0, 1.0, synthetic_module);
    memcpy(other_table.image + 16, "another", 8);
    synthetic_table_seal(&other_table);
    return 0;
}

static int free_tables(void **state) {
    (void)state;
    synthetic_table_free(&old_table);
    synthetic_table_free(&new_table);
    synthetic_table_free(&other_table);
    return 0;
}

static void start(void) {
    store_init(&store, &storage.hal);
    store_set_running(&store, &old_table.table);
}

static void restart(void) {
    sim_storage_power_up(&storage);
    start();
}

/* Until it is idle, or the power has failed. */
static void run_to_idle(void) {
    for (int step = 0; !store_is_idle(&store) && !storage.off; step++) {
        store_step(&store);
        assert_true(step < STEPS_MOST);
    }
}

/* Sends as a host does: no more than there is room for, from where the store is. */
static void send_image(enum transfer_kind kind, const uint8_t *image, uint32_t bytes) {
    assert_int_equal(store_begin(&store, kind, bytes, false, SENSOR_MOST_PA), TRANSFER_ERROR_NONE);
    for (int step = 0; store.transfer.received < bytes && store.phase == STORE_RECEIVE && !storage.off;
         step++) {
        for (int frames = 0; frames < 3 && store_room(&store) >= CHUNK; frames++) {
            const uint32_t at = store.transfer.received;
            uint64_t data = 0;
            memcpy(&data, image + at, bytes - at < CHUNK ? bytes - at : CHUNK);
            store_data(&store, (uint8_t)(at / CHUNK), data);
        }
        store_step(&store);
        assert_true(step < STEPS_MOST);
    }
}

static void transfer(enum transfer_kind kind, const void *image, size_t bytes) {
    send_image(kind, image, (uint32_t)bytes);
    store_end(&store, crc32_update(0u, image, bytes));
    run_to_idle();
}

static void transfer_table(const struct synthetic_table *table) {
    transfer(TRANSFER_KIND_TABLE, table->image, table->size);
}

static bool holds(const struct synthetic_table *table) {
    const uint8_t *image = NULL;
    uint32_t bytes = 0;
    return store_table(&store, &image, &bytes) && bytes == table->size &&
           memcmp(image, table->image, bytes) == 0;
}

static void save(uint32_t node_id, float gain) {
    static struct parameters parameters; /* the store reads it while it saves */
    uint32_t bits = 0;
    parameters_default(&parameters, &old_table.table);
    memcpy(&bits, &gain, sizeof bits);
    assert_int_equal(parameter_set(&parameters, NODE_ID, node_id, true, NULL), PARAMETER_OK);
    assert_int_equal(parameter_set(&parameters, READING_GAIN_1, bits, true, NULL), PARAMETER_OK);
    assert_true(store_save(&store, &parameters));
    run_to_idle();
}

/* The two parameters that save() sets, which must come together: 10 * node + gain. */
static double saved(void) {
    struct parameters parameters;
    struct parameters_image_report report;
    assert_int_equal(store_parameters(&store, &old_table.table, &parameters, &report), PARAMETERS_IMAGE_OK);
    assert_int_equal(report.unknown + report.refused, 0);
    return 10.0 * parameters.node.node_id + (double)parameters.controller.calibration.reading_gain[0];
}

/* --- parameters */

static void erased_storage_gives_the_defaults(void **state) {
    (void)state;
    sim_storage_init(&storage, SLOT_BYTES);
    start();
    const uint8_t *image = NULL;
    uint32_t bytes = 0;
    assert_false(store_table(&store, &image, &bytes));
    assert_false(store.parameters_found);
    assert_close(saved(), 11.0, 1e-6);
}

static void saved_parameters_are_there_after_a_restart(void **state) {
    (void)state;
    sim_storage_init(&storage, SLOT_BYTES);
    storage.polls = 3;
    start();
    for (uint32_t n = 2; n < 9; n++) {
        save(n, 1.0f + 0.01f * (float)n);
        assert_false(store.save_failed);
        assert_int_equal(store.saves, 1);
        restart();
        assert_true(store.parameters_found);
        assert_close(saved(), 10.0 * n + 1.0 + 0.01 * n, 1e-5);
    }
    assert_int_equal(storage.misuses, 0);
}

static uint32_t operations_of_a_save(void) {
    sim_storage_init(&storage, SLOT_BYTES);
    start();
    save(2u, 1.02f);
    restart();
    save(3u, 1.03f);
    return storage.operations;
}

/* Power fails in each operation of a save in turn, with each kind of tear; both areas hold an older image
 * before. */
static void a_cut_save_leaves_the_old_or_the_new_parameters_whole(void **state) {
    (void)state;
    const uint32_t operations = operations_of_a_save();
    uint32_t old_ones = 0, new_ones = 0;
    assert_int_equal(operations, 1 + 2 + 2); /* a page, two records, the header's two words */
    for (uint32_t cut = 1; cut <= operations; cut++) {
        for (int tear = 0; tear < (int)SIM_TEAR_COUNT; tear++) {
            sim_storage_init(&storage, SLOT_BYTES);
            start();
            save(2u, 1.02f);
            save(3u, 1.03f);
            restart();
            storage.cut_after = cut;
            storage.tear = (enum sim_storage_tear)tear;
            save(4u, 1.04f);
            assert_true(storage.off);
            restart();
            const double found = saved();
            const bool is_new = found > 35.0;
            assert_close(found, is_new ? 41.04 : 31.03, 1e-4);
            assert_true(!is_new || (cut == operations && tear == SIM_TEAR_WHOLE));
            old_ones += is_new ? 0u : 1u;
            new_ones += is_new ? 1u : 0u;
            save(5u, 1.05f); /* and it goes on from there */
            restart();
            assert_close(saved(), 51.05, 1e-4);
            assert_int_equal(storage.misuses, 0);
        }
    }
    assert_int_equal(new_ones, 1);
    assert_int_equal(old_ones, operations * SIM_TEAR_COUNT - 1);
}

static void a_save_that_the_storage_fails_is_said_to_have_failed(void **state) {
    (void)state;
    sim_storage_init(&storage, SLOT_BYTES);
    start();
    save(2u, 1.02f);
    storage.fails = true;
    save(3u, 1.03f);
    assert_true(store.save_failed);
    assert_int_equal(store.errors, 1);
    storage.fails = false;
    storage.refuses = true;
    save(3u, 1.03f); /* ends, though nothing can be started */
    assert_true(store.save_failed);
    assert_int_equal(store.errors, 2);
    storage.refuses = false;
    restart();
    assert_close(saved(), 21.02, 1e-4);
    save(4u, 1.04f);
    assert_false(store.save_failed);
}

/* Erased places, a first save that was cut, an old image beside a torn one: nothing was lost. Two torn ones: it was. */
static void parameters_are_lost_only_where_both_places_are_damaged(void **state) {
    (void)state;
    sim_storage_init(&storage, SLOT_BYTES);
    start();
    assert_false(store_parameters_lost(&store));
    storage.cut_after = 4u;
    storage.tear = SIM_TEAR_GARBAGE;
    save(2u, 1.02f);
    restart();
    assert_false(store.parameters_found);
    assert_false(store_parameters_lost(&store));
    save(2u, 1.02f);
    save(3u, 1.03f);
    restart();
    assert_false(store_parameters_lost(&store));
    storage.parameters[0][20] ^= 1u;
    restart();
    assert_true(store.parameters_found);
    assert_false(store_parameters_lost(&store));
    storage.parameters[1][20] ^= 1u;
    restart();
    assert_true(store_parameters_lost(&store));
    assert_close(saved(), 11.0, 1e-6);
}

static void without_storage_nothing_is_kept_and_nothing_breaks(void **state) {
    (void)state;
    struct parameters parameters;
    store_init(&store, NULL);
    parameters_default(&parameters, NULL);
    assert_false(store_save(&store, &parameters));
    assert_int_equal(store_begin(&store, TRANSFER_KIND_TABLE, 100u, false, SENSOR_MOST_PA),
                     TRANSFER_ERROR_NO_STORAGE);
    assert_int_equal(store.transfer.state, TRANSFER_FAILED);
    store_data(&store, 0u, 0u);
    store_end(&store, 0u);
    store_step(&store);
    assert_true(store_is_idle(&store));
    assert_close(saved(), 11.0, 1e-6);
}

/* --- tables */

static void a_transferred_table_is_there_after_a_restart(void **state) {
    (void)state;
    const struct synthetic_table *tables[] = {&old_table, &new_table};
    sim_storage_init(&storage, SLOT_BYTES);
    storage.polls = 2;
    start();
    for (int n = 0; n < 6; n++) {
        transfer_table(tables[n % 2]);
        assert_int_equal(store.transfer.state, TRANSFER_DONE);
        assert_int_equal(store.transfer.error, TRANSFER_ERROR_NONE);
        assert_true(n == 0 || holds(tables[(n + 1) % 2])); /* until then the other one is in use */
        restart();
        assert_true(holds(tables[n % 2]));
    }
    assert_int_equal(storage.misuses, 0);
}

/* What the firmware's build leaves: the table in slot A, nothing more. It must outlive the first update. */
static void a_table_that_was_flashed_counts_until_one_is_committed(void **state) {
    (void)state;
    sim_storage_init(&storage, SLOT_BYTES);
    memcpy(storage.table[0], old_table.image, old_table.size);
    start();
    assert_true(holds(&old_table));
    transfer_table(&other_table); /* refused, though it is whole and only its commit is missing */
    assert_int_equal(store.transfer.error, TRANSFER_ERROR_OTHER_MODULE);
    restart();
    assert_true(holds(&old_table));
    transfer_table(&new_table);
    assert_int_equal(store.transfer.state, TRANSFER_DONE);
    assert_memory_equal(storage.table[0], old_table.image, old_table.size);
    restart();
    assert_true(holds(&new_table));
    transfer_table(&other_table); /* over the flashed one */
    restart();
    assert_true(holds(&new_table));
    storage.table[1][1000] ^= 1u; /* what was never committed does not come up in place of a damaged one */
    restart();
    assert_false(store.table_found);
}

static uint32_t operations_of_an_update(void) {
    sim_storage_init(&storage, SLOT_BYTES);
    start();
    transfer_table(&old_table);
    restart();
    transfer_table(&new_table);
    return storage.operations;
}

/* Power fails in each operation of an update in turn, with each kind of tear, towards either slot. */
static void a_cut_update_leaves_the_old_or_the_new_table_whole(void **state) {
    (void)state;
    const uint32_t operations = operations_of_an_update();
    const uint32_t words = ((uint32_t)new_table.size + 7u) / 8u,
                   pages = (uint32_t)new_table.size / SIM_STORAGE_PAGE + 1u;
    static struct sim_storage before[2]; /* the old table in slot A, and in slot B */
    uint32_t new_ones = 0;
    assert_int_equal(operations, 1 + pages + words + 3);
    for (int slot = 0; slot < 2; slot++) {
        sim_storage_init(&before[slot], SLOT_BYTES);
        storage = before[slot];
        storage.hal.context = &storage;
        start();
        transfer_table(&old_table);
        if (slot == 1) {
            restart();
            transfer_table(&old_table);
        }
        before[slot] = storage;
    }
    for (uint32_t cut = 1; cut <= operations; cut++) {
        for (int variant = 0; variant < 2 * (int)SIM_TEAR_COUNT; variant++) {
            const enum sim_storage_tear tear = (enum sim_storage_tear)(variant / 2);
            storage = before[variant % 2];
            storage.hal.context = &storage;
            restart();
            assert_true(holds(&old_table));
            storage.cut_after = cut;
            storage.tear = tear;
            transfer_table(&new_table);
            assert_true(storage.off);
            restart();
            const bool is_new = holds(&new_table);
            assert_true(is_new || holds(&old_table));
            assert_int_equal(is_new, cut == operations && tear == SIM_TEAR_WHOLE);
            new_ones += is_new ? 1u : 0u;
            if (cut % 16u == 1u || cut + 4u > operations) { /* and it goes on from there */
                transfer_table(&new_table);
                assert_int_equal(store.transfer.state, TRANSFER_DONE);
                restart();
                assert_true(holds(&new_table));
            }
            assert_int_equal(storage.misuses, 0);
        }
    }
    assert_int_equal(new_ones, 2);
}

/* The reference table: a stride of cuts, and every one round the commit. */
static void a_cut_update_of_the_reference_table_leaves_one_whole(void **state) {
    (void)state;
    struct table_file file;
    static struct sim_storage before;
    assert_int_equal(table_file_open(&file, "tables/paper-semicircle.tbt", NULL), 0);
    const struct bend_table *reference = &file.table;
    const uint32_t slot = (reference->image_bytes + STORE_COMMIT_BYTES + SIM_STORAGE_PAGE - 1u) /
                          SIM_STORAGE_PAGE * SIM_STORAGE_PAGE;
    assert_true(slot <= SIM_STORAGE_TABLE_BYTES);
    sim_storage_init(&before, slot);
    storage = before;
    storage.hal.context = &storage;
    store_init(&store, &storage.hal);
    transfer_table(&old_table);
    before = storage;
    storage.operations = 0u;
    store_init(&store, &storage.hal); /* no table runs: any module is welcome */
    transfer(TRANSFER_KIND_TABLE, reference->image, reference->image_bytes);
    assert_int_equal(store.transfer.state, TRANSFER_DONE);
    const uint32_t operations = storage.operations;
    for (uint32_t cut = 1; cut <= operations; cut += cut + 8u > operations ? 1u : 3001u) {
        storage = before;
        storage.hal.context = &storage;
        sim_storage_power_up(&storage);
        store_init(&store, &storage.hal);
        storage.cut_after = cut;
        storage.tear = SIM_TEAR_GARBAGE;
        transfer(TRANSFER_KIND_TABLE, reference->image, reference->image_bytes);
        assert_true(storage.off);
        restart();
        assert_true(holds(&old_table));
    }
    table_file_close(&file);
}

static void check_refused(const uint8_t *image, uint32_t bytes, uint32_t crc, enum transfer_error error) {
    send_image(TRANSFER_KIND_TABLE, image, bytes);
    store_end(&store, crc);
    run_to_idle();
    assert_int_equal(store.transfer.state, TRANSFER_FAILED);
    assert_int_equal(store.transfer.error, error);
    restart();
    assert_true(holds(&old_table));
}

static void start_with_old_table(void) {
    sim_storage_init(&storage, SLOT_BYTES);
    start();
    transfer_table(&old_table);
    restart();
}

static void a_table_that_is_not_sound_is_refused_with_its_reason(void **state) {
    (void)state;
    const uint32_t bytes = (uint32_t)new_table.size, crc = crc32_update(0u, new_table.image, bytes);
    uint8_t *image = malloc(bytes);
    assert_non_null(image);
    start_with_old_table();
    check_refused(new_table.image, bytes, crc ^ 1u, TRANSFER_ERROR_DIFFERS);
    check_refused(other_table.image, bytes, crc32_update(0u, other_table.image, bytes),
                  TRANSFER_ERROR_OTHER_MODULE);
    memcpy(image, new_table.image, bytes);
    image[bytes - 500u] ^= 1u; /* changed before it was sent: the transfer is sound, the table not */
    check_refused(image, bytes, crc32_update(0u, image, bytes), TRANSFER_ERROR_BAD_TABLE);
    check_refused(new_table.image, bytes - 4u, crc32_update(0u, new_table.image, bytes - 4u),
                  TRANSFER_ERROR_BAD_TABLE);
    check_refused((const uint8_t *)"no table", 8u, crc32_update(0u, "no table", 8u),
                  TRANSFER_ERROR_BAD_TABLE);
    free(image);
}

/* Sealed like a good one: only a look at each number finds it. */
static void a_table_with_a_number_that_is_not_finite_is_refused(void **state) {
    (void)state;
    struct synthetic_table bad;
    const float infinite = INFINITY;
    const uint32_t last_value = 288u + 4u * (3u * 4u + 9u * 64u) - 4u;
    const uint32_t places[] = {288u + 4u * 12u, 288u + 4u * 300u, last_value};
    start_with_old_table();
    for (int p = 0; p < 3; p++) {
        synthetic_table_create(&bad, 4, 10000.0, 1.0, synthetic_module);
        memcpy(bad.image + places[p], &infinite, sizeof infinite);
        synthetic_table_seal(&bad);
        check_refused(bad.image, (uint32_t)bad.size, crc32_update(0u, bad.image, bad.size),
                      TRANSFER_ERROR_BAD_TABLE);
        synthetic_table_free(&bad);
    }
}

static void a_table_beyond_the_sensors_is_refused(void **state) {
    (void)state;
    struct synthetic_table strong;
    start_with_old_table();
    synthetic_table_create(&strong, 4, 60000.0, 1.0, synthetic_module);
    check_refused(strong.image, (uint32_t)strong.size, crc32_update(0u, strong.image, strong.size),
                  TRANSFER_ERROR_LIMITS);
    synthetic_table_free(&strong);
}

static void another_module_is_welcome_where_the_sender_says_so(void **state) {
    (void)state;
    start_with_old_table();
    const uint32_t bytes = (uint32_t)other_table.size;
    assert_int_equal(store_begin(&store, TRANSFER_KIND_TABLE, bytes, true, SENSOR_MOST_PA),
                     TRANSFER_ERROR_NONE);
    while (store.transfer.received < bytes) {
        uint64_t data = 0;
        const uint32_t at = store.transfer.received;
        memcpy(&data, other_table.image + at, bytes - at < CHUNK ? bytes - at : CHUNK);
        store_data(&store, (uint8_t)(at / CHUNK), data);
        store_step(&store);
    }
    store_end(&store, crc32_update(0u, other_table.image, bytes));
    run_to_idle();
    assert_int_equal(store.transfer.state, TRANSFER_DONE);
    restart();
    assert_true(holds(&other_table));
}

static void an_image_without_room_is_refused_before_anything_is_erased(void **state) {
    (void)state;
    start_with_old_table();
    storage.operations = 0u;
    assert_int_equal(
        store_begin(&store, TRANSFER_KIND_TABLE, SLOT_BYTES - STORE_COMMIT_BYTES + 1u, false, SENSOR_MOST_PA),
        TRANSFER_ERROR_TOO_LONG);
    assert_int_equal(store_begin(&store, TRANSFER_KIND_TABLE, 0u, false, SENSOR_MOST_PA),
                     TRANSFER_ERROR_TOO_LONG);
    assert_int_equal(store_begin(&store, TRANSFER_KIND_TABLE, UINT32_MAX, false, SENSOR_MOST_PA),
                     TRANSFER_ERROR_TOO_LONG);
    assert_int_equal(
        store_begin(&store, TRANSFER_KIND_PARAMETERS, PARAMETERS_IMAGE_BYTES + 1u, false, SENSOR_MOST_PA),
        TRANSFER_ERROR_TOO_LONG);
    assert_true(store_is_idle(&store));
    assert_int_equal(storage.operations, 0);
    assert_int_equal(
        store_begin(&store, TRANSFER_KIND_TABLE, SLOT_BYTES - STORE_COMMIT_BYTES, false, SENSOR_MOST_PA),
        TRANSFER_ERROR_NONE);
}

/* --- the transfer itself */

/* Frames lost, doubled and out of order: the store asks again, and what arrives is what was sent. */
static void lost_and_doubled_frames_are_put_right(void **state) {
    (void)state;
    const uint32_t bytes = (uint32_t)new_table.size;
    uint32_t random = 7u, sent_at = 0u, asked = 0u;
    start_with_old_table();
    assert_int_equal(store_begin(&store, TRANSFER_KIND_TABLE, bytes, false, SENSOR_MOST_PA),
                     TRANSFER_ERROR_NONE);
    for (int step = 0; store.transfer.received < bytes; step++) {
        store_step(&store);
        assert_true(step < STEPS_MOST);
        if (store.transfer.report_due) { /* a host goes on from where the board says */
            store.transfer.report_due = false;
            asked += store.transfer.received < sent_at ? 1u : 0u;
            sent_at = store.transfer.received;
        }
        if (sent_at < bytes && sent_at + CHUNK <= store.transfer.received + store_room(&store) + CHUNK) {
            uint64_t data = 0;
            memcpy(&data, new_table.image + sent_at, bytes - sent_at < CHUNK ? bytes - sent_at : CHUNK);
            random = random * 1664525u + 1013904223u;
            const uint32_t luck = random >> 24;
            if (luck > 25u) { /* one in ten is lost */
                store_data(&store, (uint8_t)(sent_at / CHUNK), data);
            }
            if (luck > 230u) { /* one in ten comes twice */
                store_data(&store, (uint8_t)(sent_at / CHUNK), ~data);
            }
            sent_at += CHUNK;
        } else if (sent_at >= bytes) {
            sent_at = store.transfer.received; /* the host's own patience */
        }
    }
    assert_true(asked > 10);
    store_end(&store, crc32_update(0u, new_table.image, bytes));
    run_to_idle();
    assert_int_equal(store.transfer.state, TRANSFER_DONE);
    restart();
    assert_true(holds(&new_table));
}

static void a_sender_that_falls_silent_ends_the_transfer(void **state) {
    (void)state;
    start_with_old_table();
    assert_int_equal(store_begin(&store, TRANSFER_KIND_TABLE, 2000u, false, SENSOR_MOST_PA),
                     TRANSFER_ERROR_NONE);
    store_data(&store, 0u, 1u);
    for (uint32_t step = 0; step < STORE_PATIENCE_STEPS; step++) {
        store_step(&store);
        assert_false(store_is_idle(&store));
    }
    store_step(&store);
    assert_true(store_is_idle(&store));
    assert_int_equal(store.transfer.error, TRANSFER_ERROR_TIMEOUT);
}

static void an_end_before_all_the_data_fails(void **state) {
    (void)state;
    start_with_old_table();
    assert_int_equal(store_begin(&store, TRANSFER_KIND_TABLE, 2000u, false, SENSOR_MOST_PA),
                     TRANSFER_ERROR_NONE);
    store_data(&store, 0u, 1u);
    store_end(&store, 0u);
    assert_int_equal(store.transfer.error, TRANSFER_ERROR_INCOMPLETE);
    assert_true(store_is_idle(&store));
    store_end(&store, 0u); /* and one without a beginning is only reported */
    assert_true(store_is_idle(&store));
}

static void nothing_begins_while_something_is_under_way(void **state) {
    (void)state;
    struct parameters parameters;
    parameters_default(&parameters, NULL);
    start_with_old_table();
    assert_int_equal(store_begin(&store, TRANSFER_KIND_TABLE, 2000u, false, SENSOR_MOST_PA),
                     TRANSFER_ERROR_NONE);
    assert_int_equal(store_begin(&store, TRANSFER_KIND_PARAMETERS, 100u, false, SENSOR_MOST_PA),
                     TRANSFER_ERROR_BUSY);
    assert_false(store_save(&store, &parameters));
    assert_int_equal(store.transfer.kind, TRANSFER_KIND_TABLE);
    assert_int_equal(store.transfer.state, TRANSFER_RECEIVING);
}

/* --- parameters by transfer */

static uint32_t parameter_image(uint8_t image[PARAMETERS_IMAGE_BYTES]) {
    struct parameters parameters;
    parameters_default(&parameters, &old_table.table);
    assert_int_equal(parameter_set(&parameters, NODE_ID, 6u, true, NULL), PARAMETER_OK);
    return parameters_write(&parameters, &old_table.table, 1u, image);
}

static void transferred_parameters_are_saved_and_handed_over(void **state) {
    (void)state;
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    const uint32_t bytes = parameter_image(image);
    struct parameters arrived;
    sim_storage_init(&storage, SLOT_BYTES);
    start();
    save(2u, 1.02f);
    assert_false(store_take_parameters(&store, &arrived));
    transfer(TRANSFER_KIND_PARAMETERS, image, bytes);
    assert_int_equal(store.transfer.state, TRANSFER_DONE);
    assert_true(store_take_parameters(&store, &arrived));
    assert_false(store_take_parameters(&store, &arrived));
    assert_int_equal(arrived.node.node_id, 6);
    restart();
    assert_close(saved(), 61.0, 1e-6);
}

static void parameters_that_this_firmware_cannot_take_are_refused_whole(void **state) {
    (void)state;
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    struct parameters arrived;
    const uint32_t bytes = parameter_image(image), unknown = 254u;
    sim_storage_init(&storage, SLOT_BYTES);
    start();
    save(2u, 1.02f);
    image[12] ^= 1u;
    transfer(TRANSFER_KIND_PARAMETERS, image, bytes);
    assert_int_equal(store.transfer.error, TRANSFER_ERROR_BAD_PARAMETERS);
    image[12] ^= 1u;
    memcpy(image + PARAMETERS_IMAGE_HEADER_BYTES, &unknown, sizeof unknown);
    parameters_seal(image, 1u, 1u,
                    crc32_update(0u, image + PARAMETERS_IMAGE_HEADER_BYTES, PARAMETERS_RECORD_BYTES));
    transfer(TRANSFER_KIND_PARAMETERS, image, bytes);
    assert_int_equal(store.transfer.error, TRANSFER_ERROR_REFUSED_PARAMETERS);
    assert_false(store_take_parameters(&store, &arrived));
    restart();
    assert_close(saved(), 21.02, 1e-4);
}

/* Any bytes at all, of any length that fits. */
static void any_bytes_as_parameters_are_refused(void **state) {
    (void)state;
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    sim_storage_init(&storage, SLOT_BYTES);
    start();
    for (uint32_t bytes = 1; bytes <= PARAMETERS_IMAGE_BYTES; bytes += bytes < 40u ? 1u : 97u) {
        memset(image, (int)bytes, sizeof image);
        transfer(TRANSFER_KIND_PARAMETERS, image, bytes);
        assert_int_equal(store.transfer.error, TRANSFER_ERROR_BAD_PARAMETERS);
    }
}

static void states_and_errors_have_words(void **state) {
    (void)state;
    for (int s = 0; s < (int)TRANSFER_STATE_COUNT; s++) {
        assert_true(strlen(transfer_state_text((enum transfer_state)s)) > 5);
    }
    for (int e = 0; e < (int)TRANSFER_ERROR_COUNT; e++) {
        assert_true(strlen(transfer_error_text((enum transfer_error)e)) >= 4);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(erased_storage_gives_the_defaults),
        cmocka_unit_test(saved_parameters_are_there_after_a_restart),
        cmocka_unit_test(a_cut_save_leaves_the_old_or_the_new_parameters_whole),
        cmocka_unit_test(a_save_that_the_storage_fails_is_said_to_have_failed),
        cmocka_unit_test(parameters_are_lost_only_where_both_places_are_damaged),
        cmocka_unit_test(without_storage_nothing_is_kept_and_nothing_breaks),
        cmocka_unit_test(a_transferred_table_is_there_after_a_restart),
        cmocka_unit_test(a_table_that_was_flashed_counts_until_one_is_committed),
        cmocka_unit_test(a_cut_update_leaves_the_old_or_the_new_table_whole),
        cmocka_unit_test(a_cut_update_of_the_reference_table_leaves_one_whole),
        cmocka_unit_test(a_table_that_is_not_sound_is_refused_with_its_reason),
        cmocka_unit_test(a_table_with_a_number_that_is_not_finite_is_refused),
        cmocka_unit_test(a_table_beyond_the_sensors_is_refused),
        cmocka_unit_test(another_module_is_welcome_where_the_sender_says_so),
        cmocka_unit_test(an_image_without_room_is_refused_before_anything_is_erased),
        cmocka_unit_test(lost_and_doubled_frames_are_put_right),
        cmocka_unit_test(a_sender_that_falls_silent_ends_the_transfer),
        cmocka_unit_test(an_end_before_all_the_data_fails),
        cmocka_unit_test(nothing_begins_while_something_is_under_way),
        cmocka_unit_test(transferred_parameters_are_saved_and_handed_over),
        cmocka_unit_test(parameters_that_this_firmware_cannot_take_are_refused_whole),
        cmocka_unit_test(any_bytes_as_parameters_are_refused),
        cmocka_unit_test(states_and_errors_have_words),
    };
    return cmocka_run_group_tests(tests, create_tables, free_tables);
}
