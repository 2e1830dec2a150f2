/* Around the drive FMU's controller: the simulation's plant. */
#include "ht_fmu.h"

#ifdef HT_FMU_PLANT

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "ht_plant_data.h"
#include "ht_virtual_period.h"

#define NEVER INT64_MAX
/* Most breaks that may be to come, and kinds of them (plant/legs.py). */
#define MOST_BREAKS ((int64_t)(sizeof((struct plant_inverter *)0)->coming.leg / sizeof(int64_t)))
#define LAST_KIND 4

static void no_channels(uint64_t handle, uint64_t target)
{
    (void)handle;
    (void)target;
}

static void fast(uint64_t handle)
{
    ht_virtual_period((ht_drive *)(uintptr_t)handle);
}

static void slow(uint64_t handle)
{
    ht_drive_slow_isr((ht_drive *)(uintptr_t)handle);
}

static struct plant plant_of(ht_fmu_plant *p)
{
    struct plant made;
    made.machine = &p->machine;
    made.load = &p->load;
    made.inverter = &p->inverter;
    made.sensors = &p->sensors;
    made.y = p->y;
    return made;
}

/* The outputs. */
static void look(ht_fmu_plant *p)
{
    int failed = 0;
    int64_t leg;
    plant_look(p->row, &p->machine, &p->inverter, p->y, p->inverter.i, &failed);
    for (leg = 0; leg < HT_LEGS; leg++) {
        p->phase_A[leg] = plant_current_A(&p->machine, p->y, leg, &failed);
    }
}

void ht_fmu_outside_reset(ht_fmu_state *s)
{
    ht_fmu_plant *p = &s->plant;
    p->machine = machine_data;
    p->load = load_data;
    p->inverter = inverter_data;
    p->sensors = sensors_data;
    p->timing = timing_data;
    p->map = map_data;
    p->pwm = pwm_data;
    p->gates = gates_data;
    memcpy(p->y, y_data, sizeof p->y);
    look(p);
}

ht_fmu_status ht_fmu_outside_put(ht_fmu *f, uint16_t row, double value)
{
    char line[HT_FMU_LINE];
    if ((row >= HT_FMU_BREAK) && (row <= HT_FMU_BREAK_LAST)
        && !((value >= (double)0.0f) && (value <= (double)LAST_KIND))) {
        (void)snprintf(line, HT_FMU_LINE, "%s = %g: allowed range is 0 .. %d",
                       ht_fmu_describe(row)->name, value, LAST_KIND);
        return ht_fmu_tell(f, HT_FMU_DISCARD, line);
    }
    f->s.input[row] = value;
    return HT_FMU_OK;
}

double ht_fmu_outside_output(const ht_fmu_state *s, uint32_t row)
{
    if (row <= HT_FMU_PHASE_LAST) {
        return s->plant.phase_A[row - HT_FMU_PHASE];
    }
    return (double)s->plant.row[row - HT_FMU_ALPHA];
}

/* Forget how a leg's contact was still to bounce. */
static void forget(struct plant_inverter_coming *to_come, int64_t leg)
{
    int64_t left = 0;
    int64_t k;
    for (k = 0; k < to_come->n; k++) {
        if (to_come->leg[k] != leg) {
            to_come->period[left] = to_come->period[k];
            to_come->count[left] = to_come->count[k];
            to_come->leg[left] = to_come->leg[k];
            to_come->kind[left] = to_come->kind[k];
            left++;
        }
    }
    to_come->n = left;
}

/* Legs whose input has changed break at the step's beginning, or are whole again. A contact that opens
 * may bounce. */
static ht_fmu_status take_breaks(ht_fmu *f)
{
    ht_fmu_state *s = &f->s;
    struct plant_inverter_coming *to_come = &s->plant.inverter.coming;
    int64_t leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        int64_t kind = (int64_t)s->input[HT_FMU_BREAK + leg];
        int64_t rows = (kind == OPEN_KIND) ? OPENS : 1;
        int64_t k;
        if (kind == s->broken[leg]) {
            continue;
        }
        forget(to_come, leg);
        if (to_come->n + rows > MOST_BREAKS) {
            return ht_fmu_tell(f, HT_FMU_DISCARD, "too many breaks of legs are to come");
        }
        for (k = 0; k < rows; k++) {
            int64_t counts = (int64_t)nearbyint(opens_s[k] * s->plant.timing.clock_Hz);
            to_come->period[to_come->n] = (int64_t)s->periods + counts / s->plant.timing.period;
            to_come->count[to_come->n] = counts % s->plant.timing.period;
            to_come->leg[to_come->n] = leg;
            to_come->kind[to_come->n] = (rows == 1) ? kind : opens_kind[k];
            to_come->n++;
        }
        s->broken[leg] = kind;
    }
    return HT_FMU_OK;
}

ht_fmu_status ht_fmu_outside_begin(ht_fmu *f)
{
    ht_fmu_plant *p = &f->s.plant;
    char line[HT_FMU_LINE];
    int failed = 0;
    double step_s;
    struct plant_load load = p->load;
    plant_set_load(&load, LOAD_KIND, f->s.input[HT_FMU_LOAD], LOAD_AT_RPM, &failed);
    step_s =
        plant_shaft_step_s(&load, LOAD_AT_RPM, VISCOUS_NMS, INERTIA_KGM2, SWING_PER_S, &failed);
    if (!(step_s >= SHORTEST_STEP_S)) {
        (void)snprintf(line, HT_FMU_LINE, "load_Nm = %g: too much for the shaft's inertia",
                       f->s.input[HT_FMU_LOAD]);
        return ht_fmu_tell(f, HT_FMU_DISCARD, line);
    }
    p->load = load;
    p->timing.max_step = (int64_t)(fmin(step_s, WINDINGS_STEP_S) * p->timing.clock_Hz);
    if (p->timing.max_step < 1) {
        p->timing.max_step = 1;
    }
    return take_breaks(f);
}

ht_fmu_status ht_fmu_outside_period(ht_fmu *f)
{
    ht_fmu_state *s = &f->s;
    ht_fmu_plant *p = &s->plant;
    struct plant plant = plant_of(p);
    struct plant_chip chip;
    struct plant_samples samples;
    int64_t never = NEVER;
    int failed = 0;
    uint16_t k;
    memset(&samples, 0, sizeof samples);
    samples.instants = &never;
    chip.map = &p->map;
    chip.pwm = &p->pwm;
    chip.gates = &p->gates;
    chip.registers = s->chip.word;
    chip.handle = (uint64_t)(uintptr_t)&s->drive;
    (void)plant_run_periods(1, (int64_t)s->periods, &p->timing, &plant, s->input[HT_FMU_VDC], &chip,
                            fast, slow, no_channels, &samples, 0, &failed);
    for (k = 0u; k < 8u; k++) {
        if (!isfinite(p->y[k])) {
            return ht_fmu_tell(f, HT_FMU_ERROR, "the simulation diverged");
        }
    }
    if (failed != 0) {
        return ht_fmu_tell(f, HT_FMU_ERROR, plant_errors[failed - 1]);
    }
    look(p);
    return HT_FMU_OK;
}

#endif
