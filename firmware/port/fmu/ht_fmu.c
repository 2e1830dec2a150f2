#include "ht_fmu.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ht_texts.h"
#include "ht_virtual_period.h"

/* The settings that `hexatorque fmu` has written: token, board, voltage of the dc link. */
#ifdef HT_FMU_MADE
#include HT_FMU_MADE
#else
#define HT_FMU_TOKEN ""
#define HT_FMU_BOARD ht_board_f28377s
#define HT_FMU_VDC_V 0
#endif

/* A constant without a suffix might be a float. */
#define HALF ((double)0.5f)
/* A step may differ from whole periods by this share: times are sums of rounded numbers. */
#define STEP_SHARE ((double)1.0e-6L)
#define TZ_OST 0x0004u
#define ACTION_SET 2u

const char *ht_fmu_token(void)
{
    return HT_FMU_TOKEN;
}

ht_fmu_status ht_fmu_tell(const ht_fmu *f, ht_fmu_status status, const char *line)
{
    if (f->say != NULL) {
        f->say(f->at, status, line);
    }
    return status;
}

/* --- texts ---------------------------------------------------------------------------------- */

/* The text of a result, with the drive's state in it. */
static void result_text(const ht_fmu *f, ht_result result, char line[HT_FMU_LINE])
{
    static const char mark[] = "{state}";
    uint16_t row;
    const char *text = "refused";
    const char *place;
    for (row = 0u; row < ht_result_count(); row++) {
        const ht_result_info *info = ht_result_describe(row);
        if (info->number == (uint16_t)result) {
            text = info->text;
        }
    }
    place = strstr(text, mark);
    if (place == NULL) {
        (void)snprintf(line, HT_FMU_LINE, "%s", text);
    } else {
        (void)snprintf(line, HT_FMU_LINE, "%.*s%s%s", (int)(place - text), text,
                       ht_state_name(f->s.drive.state), place + sizeof mark - 1u);
    }
}

/* Why parameters do not fit together. */
static void misfit_text(uint16_t misfit, const ht_params *p, char line[HT_FMU_LINE])
{
    const ht_misfit_info *row = ht_misfit_describe(misfit);
    const ht_param_info *first;
    const ht_param_info *second;
    if (row == NULL) {
        (void)snprintf(line, HT_FMU_LINE, "parameters do not fit together");
        return;
    }
    first = ht_param_describe(row->first);
    second = ht_param_describe(row->second);
    if (row->share > 0.0f) {
        (void)snprintf(line, HT_FMU_LINE,
                       "parameters do not fit together: %s = %.6g %s: %s %.6g %s (%.6g times %s)",
                       first->name, (double)p->v[row->first], first->unit,
                       row->touch ? "allowed is up to" : "must be below",
                       (double)(row->share * p->v[row->second]), second->unit, (double)row->share,
                       second->name);
    } else {
        (void)snprintf(line, HT_FMU_LINE,
                       "parameters do not fit together: %s = %.6g, %s = %.6g: %s", first->name,
                       (double)p->v[row->first], second->name, (double)p->v[row->second],
                       ht_misfit_demand(misfit));
    }
}

static void range_text(const ht_fmu *f, uint16_t id, double value, char line[HT_FMU_LINE])
{
    const ht_param_info *info = ht_param_describe(id);
    ht_range range = ht_param_range(&f->s.port, id);
    (void)snprintf(line, HT_FMU_LINE, "%s = %.9g: allowed range is %.9g .. %.9g%s%s%s", info->name,
                   value, (double)range.min, (double)range.max, (info->unit[0] != '\0') ? " " : "",
                   info->unit, info->whole ? ", whole numbers only" : "");
}

/* --- making --------------------------------------------------------------------------------- */

/* The chip as after a reset, its board started, the drive set up. */
static ht_result make(ht_fmu_state *s)
{
    memset(&s->drive, 0, sizeof s->drive);
    ht_regfile_reset(&s->chip, HT_FMU_BOARD.map);
    s->chip.gates_active_low = (uint16_t)(HT_FMU_BOARD.gates_active_low ? 1u : 0u);
    ht_port_bind(&s->port, &s->chip, &HT_FMU_BOARD);
    if (!ht_board_start(&s->port)) {
        return HT_ERROR_PORT;
    }
    ht_fmu_outside_reset(s);
    return ht_drive_init(&s->drive, &s->port, &s->wanted);
}

bool ht_fmu_reset(ht_fmu *f)
{
    ht_fmu_state *s = &f->s;
    memset(s, 0, sizeof *s);
    ht_params_default(&s->wanted);
    s->input[HT_FMU_VDC] = HT_FMU_VDC_V;
    s->input[HT_FMU_SPEED_REF] = (double)s->wanted.v[HT_P_speed_ref_rpm];
    s->input[HT_FMU_TORQUE_REF] = (double)s->wanted.v[HT_P_torque_ref_Nm];
    return make(s) == HT_OK;
}

ht_fmu_status ht_fmu_begin(ht_fmu *f)
{
    ht_fmu_state *s = &f->s;
    char line[HT_FMU_LINE];
    ht_result result;
    s->wanted.v[HT_P_speed_ref_rpm] = (float)s->input[HT_FMU_SPEED_REF];
    s->wanted.v[HT_P_torque_ref_Nm] = (float)s->input[HT_FMU_TORQUE_REF];
    result = make(s);
    if (result == HT_OK) {
        s->ready = true;
        return HT_FMU_OK;
    }
    if (result == HT_ERROR_CONFIG) {
        misfit_text((uint16_t)ht_misfit_of(&s->wanted, ht_port_pwm_clock_Hz(&s->port)), &s->wanted,
                    line);
    } else {
        result_text(f, result, line);
    }
    return ht_fmu_tell(f, HT_FMU_ERROR, line);
}

/* --- reading -------------------------------------------------------------------------------- */

static uint16_t word_of(const ht_fmu_state *s, uint32_t address)
{
    return s->chip.word[address];
}

static double counts_of_period(const ht_fmu_state *s)
{
    return (double)word_of(s, s->port.leg[0] + s->port.map->tbprd) + (double)1.0f;
}

double ht_fmu_period_s(const ht_fmu_state *s)
{
    return counts_of_period(s) / (double)s->port.map->pwm_clock_Hz;
}

static bool starts_high(const ht_fmu_state *s, uint16_t leg)
{
    const ht_c2000_map *m = s->port.map;
    uint32_t action = s->port.shadow ? m->aqctla : m->aqsfrc;
    return (word_of(s, s->port.leg[leg] + action) & 3u) == ACTION_SET;
}

/* A compare register as a share of the period; 1: it is never reached. */
static double share_of(const ht_fmu_state *s, uint32_t address)
{
    double counts = counts_of_period(s);
    return fmin((double)word_of(s, address), counts) / counts;
}

static double duty_of(const ht_fmu_state *s, uint16_t leg)
{
    double period = counts_of_period(s);
    double a = fmin((double)word_of(s, s->port.leg[leg] + s->port.map->cmpa), period);
    double b = fmin((double)word_of(s, s->port.leg[leg] + s->port.map->cmpb), period);
    double other = fmax(a, b) - fmin(a, b); /* counts at the other level */
    return (starts_high(s, leg) ? (period - other) : other) / period;
}

/* The short circuit of all legs as a pattern: gates enabled, low all the time. */
static double shorted(uint32_t row)
{
    return (row <= HT_FMU_START_LAST) ? (double)0.0f : (double)1.0f;
}

static double output(const ht_fmu_state *s, uint32_t row)
{
    const ht_c2000_map *m = s->port.map;
    if ((row <= HT_FMU_GATE_LAST) && (s->drive.short_circuit.on != 0u)) {
        return shorted(row);
    }
    if (row <= HT_FMU_DUTY_LAST) {
        return duty_of(s, (uint16_t)(row - HT_FMU_DUTY));
    }
    if (row <= HT_FMU_START_LAST) {
        return starts_high(s, (uint16_t)(row - HT_FMU_START)) ? (double)1.0f : (double)0.0f;
    }
    if (row <= HT_FMU_FIRST_LAST) {
        return share_of(s, s->port.leg[row - HT_FMU_FIRST] + m->cmpa);
    }
    if (row <= HT_FMU_SECOND_LAST) {
        return share_of(s, s->port.leg[row - HT_FMU_SECOND] + m->cmpb);
    }
    if (row <= HT_FMU_GATE_LAST) {
        uint16_t flags = word_of(s, s->port.leg[row - HT_FMU_GATE] + m->tzflg);
        return ((flags & TZ_OST) == 0u) ? (double)1.0f : (double)0.0f;
    }
    if (row == HT_FMU_STATE) {
        return (double)s->drive.state;
    }
    if ((row == HT_FMU_FAULTS) || (row == HT_FMU_WARNINGS)) {
        return (double)((row == HT_FMU_FAULTS) ? s->drive.faults : ht_drive_warnings(&s->drive));
    }
    return ht_fmu_outside_output(s, row);
}

static double parameter(const ht_fmu_state *s, uint16_t id)
{
    return (double)(s->ready ? ht_drive_get(&s->drive, id) : s->wanted.v[id]);
}

static ht_fmu_status unknown(const ht_fmu *f, uint32_t reference)
{
    char line[HT_FMU_LINE];
    (void)snprintf(line, HT_FMU_LINE, "no variable of this type has the value reference %lu",
                   (unsigned long)reference);
    return ht_fmu_tell(f, HT_FMU_ERROR, line);
}

bool ht_fmu_get(const ht_fmu *f, uint16_t kind, uint32_t reference, double *value)
{
    if (ht_fmu_kind(HT_FMU_THIS, reference) != kind) {
        (void)unknown(f, reference);
        return false;
    }
    if (reference == HT_FMU_TIME) {
        *value = f->s.time_s;
    } else if (reference >= HT_FMU_PARAMETER) {
        *value = parameter(&f->s, (uint16_t)(reference - HT_FMU_PARAMETER));
    } else if (reference >= HT_FMU_CHANNEL) {
        *value = (double)ht_channel_read(&f->s.drive, (uint16_t)(reference - HT_FMU_CHANNEL));
    } else if (ht_fmu_describe((uint16_t)reference)->direction == HT_FMU_INPUT) {
        *value = f->s.input[reference];
    } else {
        *value = output(&f->s, reference);
    }
    return true;
}

/* --- setting -------------------------------------------------------------------------------- */

void ht_fmu_set_begin(ht_fmu *f)
{
    f->n = 0u;
}

static ht_fmu_status put_input(ht_fmu *f, uint16_t row, double value)
{
    const ht_fmu_info *info = ht_fmu_describe(row);
    char line[HT_FMU_LINE];
    uint16_t id = (row == HT_FMU_SPEED_REF) ? (uint16_t)HT_P_speed_ref_rpm
                                            : (uint16_t)HT_P_torque_ref_Nm;
    if (info->direction != HT_FMU_INPUT) {
        (void)snprintf(line, HT_FMU_LINE, "%s: an output cannot be set", info->name);
        return ht_fmu_tell(f, HT_FMU_ERROR, line);
    }
    if (!isfinite(value)) {
        (void)snprintf(line, HT_FMU_LINE, "%s = %g: a finite number is needed", info->name, value);
        return ht_fmu_tell(f, HT_FMU_DISCARD, line);
    }
    if (((row == HT_FMU_SPEED_REF) || (row == HT_FMU_TORQUE_REF))
        && !ht_configure_valid(&f->s.port, id, (float)value)) {
        range_text(f, id, value, line);
        return ht_fmu_tell(f, HT_FMU_DISCARD, line);
    }
    return ht_fmu_outside_put(f, row, value);
}

ht_fmu_status ht_fmu_put(ht_fmu *f, uint16_t kind, uint32_t reference, double value)
{
    char line[HT_FMU_LINE];
    uint16_t id;
    if (ht_fmu_kind(HT_FMU_THIS, reference) != kind) {
        return unknown(f, reference);
    }
    if (reference == HT_FMU_TIME) {
        return ht_fmu_tell(f, HT_FMU_ERROR, "time: only a step changes it");
    }
    if (reference < HT_FMU_CHANNEL) {
        return put_input(f, (uint16_t)reference, value);
    }
    if (reference < HT_FMU_PARAMETER) {
        (void)snprintf(line, HT_FMU_LINE, "channel.%s: an output cannot be set",
                       ht_channel_describe((uint16_t)(reference - HT_FMU_CHANNEL))->name);
        return ht_fmu_tell(f, HT_FMU_ERROR, line);
    }
    id = (uint16_t)(reference - HT_FMU_PARAMETER);
    if (!ht_configure_valid(&f->s.port, id, (float)value)) {
        range_text(f, id, value, line);
        return ht_fmu_tell(f, HT_FMU_DISCARD, line);
    }
    if (f->n == HT_PARAMS) {
        return ht_fmu_tell(f, HT_FMU_ERROR, "a call sets more parameters than there are");
    }
    f->ids[f->n] = id;
    f->values[f->n] = (float)value;
    f->n++;
    return HT_FMU_OK;
}

/* A write that the drive has refused, in one line. */
static ht_fmu_status refused(const ht_fmu *f, ht_result result, uint16_t at)
{
    char text[HT_FMU_LINE];
    char line[HT_FMU_LINE];
    if (result == HT_ERROR_CONFIG) {
        ht_params asked = f->s.drive.params;
        uint16_t k;
        for (k = 0u; k < f->n; k++) {
            asked.v[f->ids[k]] = f->values[k];
        }
        misfit_text(at, &asked, text);
        return ht_fmu_tell(f, HT_FMU_DISCARD, text);
    }
    result_text(f, result, text);
    (void)snprintf(line, HT_FMU_LINE, "%s: %.300s", ht_param_describe(at)->name, text);
    return ht_fmu_tell(f, HT_FMU_DISCARD, line);
}

static ht_fmu_status write_parameters(ht_fmu *f)
{
    uint16_t at = f->ids[0];
    ht_result result = ht_drive_write(&f->s.drive, f->ids, f->values, f->n, &at);
    return (result == HT_OK) ? HT_FMU_OK : refused(f, result, at);
}

ht_fmu_status ht_fmu_set_end(ht_fmu *f)
{
    uint16_t k;
    if (f->n == 0u) {
        return HT_FMU_OK;
    }
    if (f->s.ready) {
        return write_parameters(f);
    }
    for (k = 0u; k < f->n; k++) {
        f->s.wanted.v[f->ids[k]] = f->values[k];
    }
    return HT_FMU_OK;
}

/* --- stepping ------------------------------------------------------------------------------- */

static ht_fmu_status command(const ht_fmu *f, const char *name, ht_result result)
{
    char text[HT_FMU_LINE];
    char line[HT_FMU_LINE];
    if (result == HT_OK) {
        return HT_FMU_OK;
    }
    result_text(f, result, text);
    (void)snprintf(line, HT_FMU_LINE, "%s: %.300s", name, text);
    if (result == HT_ERROR_RESTART) {
        size_t end = strlen(line);
        (void)snprintf(line + end, HT_FMU_LINE - end, "; a start is refused for another %u s",
                       (unsigned)ht_drive_restart_wait(&f->s.drive));
    }
    return ht_fmu_tell(f, HT_FMU_WARNING, line);
}

static ht_fmu_status worse(ht_fmu_status a, ht_fmu_status b)
{
    return (a > b) ? a : b;
}

/* References that have changed. */
static ht_fmu_status take_references(ht_fmu *f)
{
    static const uint16_t id[2] = {HT_P_speed_ref_rpm, HT_P_torque_ref_Nm};
    static const uint16_t row[2] = {HT_FMU_SPEED_REF, HT_FMU_TORQUE_REF};
    uint16_t k;
    ht_fmu_set_begin(f);
    for (k = 0u; k < 2u; k++) {
        float value = (float)f->s.input[row[k]];
        if (value != f->s.drive.params.v[id[k]]) {
            f->ids[f->n] = id[k];
            f->values[f->n] = value;
            f->n++;
        }
    }
    return ht_fmu_set_end(f);
}

static ht_fmu_status take_commands(ht_fmu *f)
{
    ht_fmu_state *s = &f->s;
    bool run = s->input[HT_FMU_RUN] > (double)0.0f;
    bool clear = s->input[HT_FMU_CLEAR] > (double)0.0f;
    uint16_t level = (uint16_t)((s->input[HT_FMU_TRIP] > (double)0.0f) ? 0u : 1u);
    ht_fmu_status status = HT_FMU_OK;
    ht_regfile_pin(&s->chip, s->port.board->trip.gpio, level);
    if (clear && !s->cleared) {
        status = command(f, "clear", ht_drive_clear(&s->drive));
    }
    if (run && !s->ran) {
        status = worse(status, command(f, "run", ht_drive_start(&s->drive)));
    } else if (!run && s->ran) {
        ht_drive_stop(&s->drive);
    }
    s->ran = run;
    s->cleared = clear;
    return status;
}

ht_fmu_status ht_fmu_step(ht_fmu *f, double now_s, double step_s)
{
    ht_fmu_state *s = &f->s;
    double period = ht_fmu_period_s(s);
    double n = floor(step_s / period + HALF);
    char line[HT_FMU_LINE];
    ht_fmu_status status;
    if (!s->ready) {
        return ht_fmu_tell(f, HT_FMU_ERROR, "a step before the end of the initialisation");
    }
    if (!(n >= (double)1.0f) || !(fabs(step_s / period - n) <= STEP_SHARE * n)) {
        (void)snprintf(line, HT_FMU_LINE,
                       "communication step = %.9g s: allowed is %.17g s, a period of the fast "
                       "interrupt, or an integer multiple of it",
                       step_s, period);
        return ht_fmu_tell(f, HT_FMU_DISCARD, line);
    }
    status = ht_fmu_outside_begin(f);
    if (status != HT_FMU_OK) {
        return status;
    }
    status = worse(take_references(f), take_commands(f));
    for (; n >= (double)1.0f; n -= (double)1.0f) {
        ht_fmu_status passed = ht_fmu_outside_period(f);
        if (passed != HT_FMU_OK) {
            return passed;
        }
        s->periods++;
    }
    s->time_s = now_s + step_s;
    return status;
}

/* --- keeping -------------------------------------------------------------------------------- */

static int16_t number_of(const ht_drive *d, const ht_drive_config *config)
{
    if (config == NULL) {
        return -1;
    }
    return (config == &d->configs[0]) ? 0 : 1;
}

/* Everything that points somewhere. */
static void without_pointers(ht_fmu_state *s)
{
    uint16_t k;
    s->drive.port = NULL;
    s->drive.config = NULL;
    s->drive.staged = NULL;
    s->port.io = NULL;
    s->port.board = NULL;
    s->port.map = NULL;
    s->chip.map = NULL;
    s->chip.chip = NULL;
    for (k = 0u; k < HT_REGFILE_BOUND; k++) {
        s->chip.bound[k].reg = NULL;
        s->chip.bound[k].module = NULL;
    }
    for (k = 0u; k < HT_REGFILE_LOG; k++) {
        s->chip.log[k].why = "";
    }
}

/* Memory for a kept state, if there is none yet. */
static bool room(const ht_fmu *f, void **kept)
{
    if (*kept == NULL) {
        *kept = malloc(sizeof(ht_fmu_kept));
    }
    if (*kept == NULL) {
        (void)ht_fmu_tell(f, HT_FMU_ERROR, "no memory for the state");
    }
    return *kept != NULL;
}

ht_fmu_status ht_fmu_keep(const ht_fmu *f, void **to)
{
    ht_fmu_kept *kept;
    if (!room(f, to)) {
        return HT_FMU_ERROR;
    }
    kept = *to;
    memset(kept, 0, sizeof *kept);
    (void)snprintf(kept->token, sizeof kept->token, "%s", HT_FMU_TOKEN);
    kept->size = (uint32_t)sizeof *kept;
    kept->config = number_of(&f->s.drive, f->s.drive.config);
    kept->staged = number_of(&f->s.drive, f->s.drive.staged);
    memcpy(&kept->s, &f->s, sizeof f->s);
    without_pointers(&kept->s);
    return HT_FMU_OK;
}

/* FNV-1a of what follows the sum in a kept state's octets. */
static uint32_t sum_of(const void *octets)
{
    const unsigned char *at = octets;
    uint32_t sum = 2166136261u;
    size_t k;
    for (k = sizeof sum; k < sizeof(ht_fmu_kept); k++) {
        sum = (sum ^ at[k]) * 16777619u;
    }
    return sum;
}

ht_fmu_status ht_fmu_serialize(const ht_fmu *f, const ht_fmu_kept *kept, void *octets, size_t size)
{
    uint32_t sum;
    if (size < sizeof *kept) {
        return ht_fmu_tell(f, HT_FMU_ERROR, "the memory for the state is too small");
    }
    memcpy(octets, kept, sizeof *kept);
    sum = sum_of(octets);
    memcpy(octets, &sum, sizeof sum);
    return HT_FMU_OK;
}

ht_fmu_status ht_fmu_deserialize(const ht_fmu *f, const void *octets, size_t size, void **kept)
{
    uint32_t sum;
    if (size != sizeof(ht_fmu_kept)) {
        return ht_fmu_tell(f, HT_FMU_ERROR, "the kept state is of another FMU");
    }
    memcpy(&sum, octets, sizeof sum);
    if (sum != sum_of(octets)) {
        return ht_fmu_tell(f, HT_FMU_ERROR, "the kept state is damaged");
    }
    if (!room(f, kept)) {
        return HT_FMU_ERROR;
    }
    memcpy(*kept, octets, sizeof(ht_fmu_kept));
    return HT_FMU_OK;
}

/** Points what was copied to this instance's own parts: the other one may be gone. */
static void point_home(ht_fmu_state *s, const ht_fmu_kept *kept)
{
    uint16_t k;
    /* The chip's tables are where they are in this process. */
    ht_port_bind(&s->port, &s->chip, &HT_FMU_BOARD);
    s->port.shadow = kept->s.port.shadow;
    s->port.clock = kept->s.port.clock;
    s->port.sci_clock_Hz = kept->s.port.sci_clock_Hz;
    s->port.reset_cause = kept->s.port.reset_cause;
    s->drive.port = &s->port;
    s->drive.config = (kept->config < 0) ? NULL : &s->drive.configs[kept->config];
    s->drive.staged = (kept->staged < 0) ? NULL : &s->drive.configs[kept->staged];
    ht_regfile_rebind(&s->chip, HT_FMU_BOARD.map);
    for (k = 0u; k < HT_REGFILE_LOG; k++) {
        s->chip.log[k].why = "";
    }
}

ht_fmu_status ht_fmu_go_back(ht_fmu *f, const ht_fmu_kept *kept)
{
    if ((kept->size != sizeof *kept)
        || (strncmp(kept->token, HT_FMU_TOKEN, sizeof kept->token) != 0)) {
        return ht_fmu_tell(f, HT_FMU_ERROR, "the kept state is of another FMU");
    }
    memcpy(&f->s, &kept->s, sizeof f->s);
    point_home(&f->s, kept);
    return HT_FMU_OK;
}
