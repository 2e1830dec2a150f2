/** @file ht_fmu_plant.h
 *  The state of the plant in a drive FMU. ht_plant.h is written by `hexatorque fmu`, which translates
 *  the simulation's plant.
 */
#ifndef HT_FMU_PLANT_H
#define HT_FMU_PLANT_H

#include "ht_plant.h"

enum { HT_FMU_COLUMNS = 10 }; /**< of a row of the simulation's recording */

typedef struct {
    struct plant_machine machine;
    struct plant_load load;
    struct plant_inverter inverter;
    struct plant_sensors sensors;
    struct plant_timing timing;
    struct plant_map map;
    struct plant_pwm pwm;
    struct plant_gates gates;
    double y[8];
    double phase_A[6];
    float row[HT_FMU_COLUMNS];
} ht_fmu_plant;

#endif
