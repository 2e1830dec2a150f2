/* The drive in a browser: the firmware on its register model, with the simulation's plant, as a
 * module of WebAssembly. An instance of the module is one drive. ht_plant.h is written by
 * tools/web.py, which translates the plant; web/drive.js calls the functions.
 *
 * Functions that can be refused return a number of ht_results.def. */
#include <math.h>
#include <string.h>

#include "ht_board_of_device.h"
#include "ht_burst_rows.h"
#include "ht_drive.h"
#include "ht_log.h"
#include "ht_misfit.h"
#include "ht_plant.h"
#include "ht_port_c2000.h"
#include "ht_store.h"
#include "ht_virtual_period.h"

#define API(name) __attribute__((export_name(#name))) name

enum {
    MOST_PERIODS = 2000, /* of one call */
    CHANNELS = 64,       /* room for them */
    CAPTURE_VALUES = 20480,
    BLOCK_WORDS = HT_STORE_FILE_BLOCK / 2,
    AREA_WORDS = HT_STORE_FILE_BLOCKS * BLOCK_WORDS,
    MOST_OPENS = 8,
    SNAPSHOT_VALUES = 32,
    COUNTERS = 10 + HT_LOG_TRIPS
};

/* What tools/web.py writes of a set-up, member by member. */
typedef struct {
    struct plant_machine machine;
    struct plant_inverter inverter;
    struct plant_sensors sensors;
    struct plant_timing timing;
    struct plant_map map;
    struct plant_pwm pwm;
    struct plant_gates gates;
    double y[8];
    int64_t device;
    int64_t load_kind;
    double at_rpm;
    double viscous_Nms;
    double inertia_kgm2;
    double swing_per_s;
    double windings_step_s;
    double shortest_step_s;
    double vdc_V;
    int64_t opens; /* edges of a contact that opens: it may bounce */
    double opens_s[MOST_OPENS];
    int64_t opens_kind[MOST_OPENS];
    double params[HT_PARAMS];
} web_setup;

static struct {
    web_setup setup;
    web_setup now; /* the same, as time has changed it */
    struct plant_load load;
    ht_regfile chip;
    ht_port port;
    ht_drive drive;
    ht_store store;
    uint16_t areas[HT_STORE_FILE_AREAS][AREA_WORDS];
    ht_burst burst;
    uint32_t memory[CAPTURE_VALUES];
    int64_t periods;
    float channels[MOST_PERIODS * CHANNELS];
    float plant[MOST_PERIODS * WEB_PLANT_CHANNELS];
    uint16_t ids[HT_PARAMS];
    float values[HT_PARAMS];
    uint16_t at; /* ht_drive_write's */
    double snapshot[SNAPSHOT_VALUES];
    ht_drive_log log; /* without a memory: it lasts as long as the page */
    uint16_t event[HT_LOG_ROW];
    double counters[COUNTERS];
    double limits[HT_LIMITS];
    const char *failure; /* why the plant stopped */
} w;

/* --- the memory for parameters -------------------------------------------------------------- */

static bool read_block(void *at, uint16_t area, uint16_t block, uint16_t *words)
{
    (void)at;
    memcpy(words, &w.areas[area][block * BLOCK_WORDS], HT_STORE_FILE_BLOCK);
    return true;
}

static bool write_block(void *at, uint16_t area, uint16_t block, const uint16_t *words)
{
    (void)at;
    if (words == NULL) {
        memset(w.areas[area], 0xFF, sizeof w.areas[area]);
    } else {
        memcpy(&w.areas[area][block * BLOCK_WORDS], words, HT_STORE_FILE_BLOCK);
    }
    return true;
}

void *API(web_areas)(void)
{
    return w.areas;
}

uint32_t API(web_area_bytes)(void)
{
    return (uint32_t)sizeof w.areas;
}

int32_t API(web_keep)(void)
{
    return (int32_t)ht_store_save(&w.store, &w.drive);
}

int32_t API(web_forget)(void)
{
    return (int32_t)ht_store_forget(&w.store, &w.drive);
}

/* --- begin ---------------------------------------------------------------------------------- */

void *API(web_setup_at)(void)
{
    return &w.setup;
}

uint32_t API(web_setup_bytes)(void)
{
    return (uint32_t)sizeof w.setup;
}

static const ht_reset power_on = {HT_RESET_POWER, 0u};

/* The drive of the set-up, as after a reset, with the parameters that the areas hold if there are
 * any. */
int32_t API(web_begin)(void)
{
    const ht_board *board = ht_board_of_device((uint16_t)w.setup.device);
    ht_params params;
    int failed = 0;
    uint16_t id;
    if (board == NULL) {
        return (int32_t)HT_ERROR_ID;
    }
    w.now = w.setup;
    w.periods = 0;
    w.failure = NULL;
    plant_set_load(&w.load, w.now.load_kind, 0.0, w.now.at_rpm, &failed);
    memset(&w.drive, 0, sizeof w.drive);
    ht_regfile_reset(&w.chip, board->map);
    w.chip.gates_active_low = (uint16_t)(board->gates_active_low ? 1u : 0u);
    ht_port_bind(&w.port, &w.chip, board);
    if (!ht_board_start(&w.port)) {
        return (int32_t)HT_ERROR_PORT;
    }
    ht_burst_init(&w.burst, w.memory, CAPTURE_VALUES);
    ht_log_none(&w.log);
    ht_log_start(&w.log, &power_on);
    for (id = 0u; id < ht_param_count(); id++) {
        params.v[id] = (float)w.setup.params[id];
    }
    w.store.port.read = read_block;
    w.store.port.write = write_block;
    w.store.port.at = NULL;
    w.store.port.blocks = HT_STORE_FILE_BLOCKS;
    return (int32_t)ht_store_start(&w.store, &w.drive, &w.port, &params);
}

/* Which set of parameters the beginning took. */
uint32_t API(web_set_in_force)(void)
{
    return w.store.set;
}

/* --- time ----------------------------------------------------------------------------------- */

static void fast(uint64_t handle)
{
    ht_virtual_period((ht_drive *)(uintptr_t)handle);
}

static void slow(uint64_t handle)
{
    ht_drive_slow_isr((ht_drive *)(uintptr_t)handle);
    ht_log_turn(&w.log, &w.drive, false); /* the background, which is all that the page has of it */
}

static void read_channels(uint64_t handle, uint64_t target)
{
    ht_channels_read((const ht_drive *)(uintptr_t)handle, (float *)(uintptr_t)target);
}

static double longest_step_s(const struct plant_load *load)
{
    struct plant_load copy = *load;
    int failed = 0;
    return plant_shaft_step_s(&copy, w.now.at_rpm, w.now.viscous_Nms, w.now.inertia_kgm2,
                              w.now.swing_per_s, &failed);
}

float *API(web_channels)(void)
{
    return w.channels;
}

/* The plant's true values at the beginning of each period of the latest web_run, WEB_PLANT_CHANNELS in
 * a row. tools/web.py tells how many there are, and their names. */
float *API(web_plant)(void)
{
    return w.plant;
}

/* Let up to MOST_PERIODS pass. Their channels are at web_channels, a row for each. Returns 0, or 1:
 * the plant stopped, web_failure tells why. */
int32_t API(web_run)(int32_t n, int32_t faults_channel)
{
    struct plant plant = {&w.now.machine, &w.load, &w.now.inverter, &w.now.sensors, w.now.y};
    struct plant_chip chip = {&w.now.map, &w.now.pwm, &w.now.gates, w.chip.word,
                              (uint64_t)(uintptr_t)&w.drive};
    struct plant_samples samples;
    int64_t instants[] = {0, INT64_MAX}; /* sample_instants(1, ...) of the simulation */
    int64_t longest;
    int failed = 0;
    uint16_t k;
    n = (n < MOST_PERIODS) ? n : MOST_PERIODS;
    memset(&samples, 0, sizeof samples);
    samples.instants = instants;
    samples.plant.at = w.plant;
    samples.plant.rows = n;
    samples.plant.columns = WEB_PLANT_CHANNELS;
    samples.address = (uint64_t)(uintptr_t)w.channels;
    samples.channels.at = w.channels;
    samples.channels.rows = n;
    samples.channels.columns = ht_channel_count();
    longest =
        (int64_t)(fmin(w.now.windings_step_s, longest_step_s(&w.load)) * w.now.timing.clock_Hz);
    w.now.timing.max_step = (longest > 1) ? longest : 1;
    (void)plant_run_periods(n, w.periods, &w.now.timing, &plant, w.now.vdc_V, &chip, fast, slow,
                            read_channels, &samples, 0, &failed);
    for (k = 0u; k < 8u; k++) {
        if (!isfinite(w.now.y[k])) {
            w.failure = "the simulation diverged";
            return 1;
        }
    }
    if (failed != 0) {
        w.failure = plant_errors[failed - 1];
        return 1;
    }
    ht_burst_rows(&w.burst, w.channels, (uint32_t)n, ht_channel_count(), (uint32_t)(w.periods + 1),
                  (uint16_t)faults_channel);
    w.periods += n;
    return 0;
}

const char *API(web_failure)(void)
{
    return w.failure;
}

double API(web_time_s)(void)
{
    return (double)w.periods * (double)w.now.timing.period / w.now.timing.clock_Hz;
}

double API(web_periods)(void)
{
    return (double)w.periods;
}

/* --- the plant ------------------------------------------------------------------------------ */

/* The load from now on. False: the shaft's inertia is too small for it. */
int32_t API(web_load)(double torque_Nm)
{
    struct plant_load load = w.load;
    int failed = 0;
    plant_set_load(&load, w.now.load_kind, torque_Nm, w.now.at_rpm, &failed);
    if (!(longest_step_s(&load) >= w.now.shortest_step_s)) {
        return 0;
    }
    w.load = load;
    return 1;
}

/* A leg opens now, or is whole again. False: too many changes are still to come. */
int32_t API(web_open)(int32_t leg, int32_t open)
{
    struct plant_inverter_coming *coming = &w.now.inverter.coming;
    int64_t most = (int64_t)(sizeof coming->leg / sizeof coming->leg[0]);
    int64_t rows = (open != 0) ? w.now.opens : 1;
    int64_t k;
    if (coming->n + rows > most) {
        return 0;
    }
    for (k = 0; k < rows; k++) {
        int64_t counts = (open != 0) ? (int64_t)nearbyint(w.now.opens_s[k] * w.now.timing.clock_Hz)
                                     : 0;
        coming->period[coming->n] = w.periods + counts / w.now.timing.period;
        coming->count[coming->n] = counts % w.now.timing.period;
        coming->leg[coming->n] = leg;
        coming->kind[coming->n] = (open != 0) ? w.now.opens_kind[k] : 0;
        coming->n++;
    }
    return 1;
}

/* --- commands and parameters ---------------------------------------------------------------- */

static int32_t commanded(ht_result result)
{
    if (result == HT_OK) {
        w.burst.command = 1u;
    }
    return (int32_t)result;
}

int32_t API(web_start)(void)
{
    return commanded(ht_drive_start(&w.drive));
}

int32_t API(web_stop)(void)
{
    ht_drive_stop(&w.drive);
    return commanded(HT_OK);
}

int32_t API(web_clear)(void)
{
    return commanded(ht_drive_clear(&w.drive));
}

float API(web_get)(int32_t id)
{
    return ht_drive_get(&w.drive, (uint16_t)id);
}

/* Entry k of what web_write writes. */
void API(web_put)(int32_t k, int32_t id, float value)
{
    w.ids[k] = (uint16_t)id;
    w.values[k] = value;
}

int32_t API(web_write)(int32_t n)
{
    return commanded(ht_drive_write(&w.drive, w.ids, w.values, (uint16_t)n, &w.at));
}

/* What the latest refusal was about: a parameter, or a misfit. */
uint32_t API(web_refused)(void)
{
    return w.at;
}

uint32_t API(web_state)(void)
{
    return w.drive.state;
}

uint32_t API(web_faults)(void)
{
    return w.drive.faults;
}

uint32_t API(web_violations)(void)
{
    return w.chip.violations;
}

/* --- captures ------------------------------------------------------------------------------- */

/* Channel k of the capture that web_arm arms. */
void API(web_capture)(int32_t k, int32_t channel)
{
    w.ids[k] = (uint16_t)channel;
}

/* Returns a number of ht_burst_answer. */
int32_t API(web_arm)(int32_t n, int32_t samples, int32_t before, int32_t prescaler, int32_t trigger,
                     int32_t channel, float level)
{
    ht_burst_setup setup;
    int32_t k;
    memset(&setup, 0, sizeof setup);
    setup.n = (uint16_t)n;
    setup.samples = (uint32_t)samples;
    setup.before = (uint32_t)before;
    setup.prescaler = (uint16_t)prescaler;
    setup.trigger = (uint16_t)trigger;
    setup.channel = (uint16_t)channel;
    setup.level = level;
    for (k = 0; (k < n) && (k < HT_BURST_CHANNELS); k++) {
        setup.id[k] = w.ids[k];
    }
    return (int32_t)ht_burst_arm(&w.burst, &setup);
}

void API(web_trigger)(void)
{
    w.burst.manual = 1u;
}

void API(web_cancel)(void)
{
    ht_burst_cancel(&w.burst);
}

/* HT_BURST_... */
uint32_t API(web_capture_state)(void)
{
    return w.burst.state;
}

uint32_t API(web_capture_tick)(void)
{
    return w.burst.tick;
}

/* The values of a complete capture, a row for each sample, at web_channels. */
void API(web_captured)(void)
{
    uint32_t n = ht_burst_values(&w.burst);
    uint32_t k;
    for (k = 0u; k < n; k++) {
        uint32_t value = ht_burst_value(&w.burst, k);
        memcpy(&w.channels[k], &value, sizeof value);
    }
}

/* --- the latest fault ----------------------------------------------------------------------- */

/* Its values in the order that web/drive.js names; the first is 0 if there was no fault. */
double *API(web_snapshot)(void)
{
    const ht_snapshot *s = &w.drive.snapshot;
    double *out = w.snapshot;
    uint16_t k;
    *out++ = s->tick;
    *out++ = s->state;
    *out++ = s->faults;
    *out++ = s->warnings;
    for (k = 0u; k <= HT_LEGS; k++) {
        *out++ = s->samples.adc[k];
    }
    *out++ = s->samples.position;
    for (k = 0u; k < HT_LEGS; k++) {
        *out++ = (double)s->in.i_A.p[k];
    }
    *out++ = (double)s->in.vdc_V;
    *out++ = (double)s->in.torque_ref_Nm;
    *out++ = (double)s->in.flux_ref_Wb;
    *out++ = (double)s->estimate.psi_Wb.alpha;
    *out++ = (double)s->estimate.psi_Wb.beta;
    *out++ = (double)s->estimate.torque_Nm;
    *out++ = (double)s->speed_rpm;
    return w.snapshot;
}

/* --- the log, and the limits that act --------------------------------------------------------- */

/* Event `row` of the log in the words of ht_log.h, 0 is the latest, or NULL. */
uint16_t *API(web_event)(int32_t row)
{
    return (ht_log_row(&w.log, &w.drive, (uint16_t)row, w.event) == HT_OK) ? w.event : NULL;
}

/* In the order that web/drive.js names, the trips of each fault last. */
double *API(web_counters)(void)
{
    const ht_log_counters *c = &w.log.counters;
    double *out = w.counters;
    uint16_t k;
    *out++ = ht_log_keeps(&w.log) ? 1.0 : 0.0;
    *out++ = c->missed;
    *out++ = w.log.ring.damaged;
    *out++ = c->powered_s;
    *out++ = c->gates_s;
    *out++ = c->starts;
    *out++ = (double)c->vdc_V;
    *out++ = (double)c->current_A;
    *out++ = (double)c->speed_rpm;
    *out++ = (double)c->winding_degC;
    for (k = 0u; k < HT_LOG_TRIPS; k++) {
        *out++ = w.log.trips[k];
    }
    return w.counters;
}

/* Of each row of ht_limits.def: for how many seconds it has acted, or -1. */
double *API(web_limits)(void)
{
    const ht_drive *d = &w.drive;
    bool controls = (ht_state_flags(d->state) & (uint16_t)HT_CONTROLS) != 0u;
    uint16_t k;
    for (k = 0u; k < HT_LIMITS; k++) {
        bool acts = controls && ((d->limits & (1u << k)) != 0u);
        w.limits[k] = acts ? ((double)(uint32_t)(d->tick - d->limit_from[k])
                              / (double)d->params.v[HT_P_f_isr_Hz])
                           : -1.0;
    }
    return w.limits;
}
