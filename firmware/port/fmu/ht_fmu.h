/** @file ht_fmu.h
 *  An FMU without the interface of a version of FMI: one drive on the register model of its chip. Around
 *  it are ideal sensors and the simulation's encoder in the controller FMU (ht_fmu_sensors.c), and the
 *  simulation's plant in the drive FMU (ht_fmu_plant.c). `hexatorque fmu` writes both encoder and plant.
 *
 *  Host only: numbers are double here, as FMI has them.
 *
 *  A step is one period of the fast interrupt, or several. In each the inputs are sampled, the
 *  interrupts run, and the outputs say what the registers hold then.
 */
#ifndef HT_FMU_H
#define HT_FMU_H

#include "ht_fmu_variables.h"
#include "ht_misfit.h"
#include "ht_port_c2000.h"
#include "ht_drive.h"

#include <stddef.h>

#include "ht_plant.h"

#ifdef HT_FMU_PLANT
#include "ht_fmu_plant.h"
#define HT_FMU_THIS HT_FMU_DRIVE
#else
#define HT_FMU_THIS HT_FMU_CONTROLLER
#endif

/** The result of a call. The numbers are those of both versions of FMI. */
typedef enum {
    HT_FMU_OK = 0,
    HT_FMU_WARNING = 1,
    HT_FMU_DISCARD = 2,
    HT_FMU_ERROR = 3
} ht_fmu_status;

enum { HT_FMU_LINE = 400 };

/** Takes one line for the user. */
typedef void (*ht_fmu_say)(void *at, ht_fmu_status status, const char *line);

/** The shaft's encoder. */
typedef struct {
    bool begun;      /**< `zero_rad` is known */
    double zero_rad; /**< the angle where the counter is 0 */
    struct plant_sensors sensors;
} ht_fmu_encoder;

/** All that a step changes. */
typedef struct {
    ht_regfile chip;
    ht_port port;
    ht_drive drive;
    ht_params wanted; /**< parameters until the initialisation ends */
    bool ready;       /**< it has ended */
    bool ran;         /**< the input `run` at the last step */
    bool cleared;     /**< `clear` then */
    uint64_t periods;
    double time_s; /**< as the master counts it */
#ifdef HT_FMU_PLANT
    ht_fmu_plant plant;
    int64_t broken[HT_LEGS]; /**< what the inputs said is broken, at the last step */
#else
    ht_fmu_encoder encoder;
#endif
    double input[HT_FMU_ROWS]; /**< by value reference; flags are 0 or 1 */
} ht_fmu_state;

typedef struct {
    ht_fmu_state s;
    ht_fmu_say say;
    void *at;
    /* Parameters of a call that sets several. */
    uint16_t ids[HT_PARAMS];
    float values[HT_PARAMS];
    uint16_t n;
} ht_fmu;

/** A state that is kept. */
typedef struct {
    uint32_t sum; /**< of the rest, in the octets of a kept state only */
    uint32_t size;
    char token[64];
    int16_t config; /**< of `drive.configs` in force, and the next one; -1: none */
    int16_t staged;
    ht_fmu_state s; /**< without pointers */
} ht_fmu_kept;

/** Token of this FMU: that of the model description. */
const char *ht_fmu_token(void);

/** Made anew, with the start values of the description. False if the board does not start. */
bool ht_fmu_reset(ht_fmu *f);

/** The initialisation ends: the drive is set up with the parameters. */
ht_fmu_status ht_fmu_begin(ht_fmu *f);

/** Say a line about the instance. Returns `status`. */
ht_fmu_status ht_fmu_tell(const ht_fmu *f, ht_fmu_status status, const char *line);

/** Value of a variable; a line and false if there is none of this kind. */
bool ht_fmu_get(const ht_fmu *f, uint16_t kind, uint32_t reference, double *value);

/** Set variables: begin, one `put` for each, end. The parameters change together or not at all. */
void ht_fmu_set_begin(ht_fmu *f);
ht_fmu_status ht_fmu_put(ht_fmu *f, uint16_t kind, uint32_t reference, double value);
ht_fmu_status ht_fmu_set_end(ht_fmu *f);

/** The master's time is `now_s` and will be `now_s + step_s`. */
ht_fmu_status ht_fmu_step(ht_fmu *f, double now_s, double step_s);

/* --- what is around the controller --- */

/** As at the beginning. The chip and the port are, too. */
void ht_fmu_outside_reset(ht_fmu_state *s);
/** Take a finite value of an input. */
ht_fmu_status ht_fmu_outside_put(ht_fmu *f, uint16_t row, double value);
/** Value of an output that the controller does not have. */
double ht_fmu_outside_output(const ht_fmu_state *s, uint32_t row);
/** A step begins with these inputs. */
ht_fmu_status ht_fmu_outside_begin(ht_fmu *f);
/** A period passes, with the drive's interrupts. */
ht_fmu_status ht_fmu_outside_period(ht_fmu *f);
/** Length of a period. */
double ht_fmu_period_s(const ht_fmu_state *s);

/** Keep the state in `*kept`, a ht_fmu_kept, which is allocated if it is NULL. */
ht_fmu_status ht_fmu_keep(const ht_fmu *f, void **kept);
/** Go on from there. `kept` may be of another instance or process, but of the same binary. */
ht_fmu_status ht_fmu_go_back(ht_fmu *f, const ht_fmu_kept *kept);
/** A kept state as `size` octets, and back. `*kept` is allocated if it is NULL. */
ht_fmu_status ht_fmu_serialize(const ht_fmu *f, const ht_fmu_kept *kept, void *octets, size_t size);
ht_fmu_status ht_fmu_deserialize(const ht_fmu *f, const void *octets, size_t size, void **kept);

#endif
