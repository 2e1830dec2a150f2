/* FMI 3.0 for co-simulation in front of ht_fmu.h. */
#include "ht_fmi3.h"

#include <stdlib.h>
#include <string.h>

#include "ht_fmu.h"

/* An exported function: its declaration, then its definition. */
#define FMI3(type, name, arguments)    \
    HT_FMI_EXPORT type name arguments; \
    HT_FMI_EXPORT type name arguments

/* A function that the FMU does not have. It looks at its first argument alone: the caller removes the
 * others on all systems for which there are binaries. */
#define FMI3_NONE(name)                                                                   \
    FMI3(fmi3Status, name, (fmi3Instance c))                                              \
    {                                                                                     \
        return (fmi3Status)ht_fmu_tell(&((instance *)c)->fmu, HT_FMU_ERROR,               \
                                       #name ": the FMU does not support this function"); \
    }
#define FMI3_NO_INSTANCE(name)       \
    FMI3(fmi3Instance, name, (void)) \
    {                                \
        return NULL;                 \
    }

typedef struct {
    ht_fmu fmu;
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} instance;

static void say(void *at, ht_fmu_status status, const char *line)
{
    const instance *i = at;
    if (i->log != NULL) {
        i->log(i->environment, (fmi3Status)status,
               (status == HT_FMU_WARNING) ? "logStatusWarning" : "logStatusError", line);
    }
}

FMI3(const char *, fmi3GetVersion, (void))
{
    return "3.0";
}

FMI3(fmi3Status, fmi3SetDebugLogging,
     (fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]))
{
    (void)c;
    (void)on;
    (void)n;
    (void)categories;
    return HT_FMU_OK; /* errors and warnings are always told, and there is nothing else */
}

FMI3(fmi3Instance, fmi3InstantiateCoSimulation,
     (fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
      fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
      const fmi3ValueReference intermediate[], size_t n, fmi3InstanceEnvironment environment,
      fmi3LogMessageCallback log, void (*update)(void)))
{
    instance *i = (token != NULL) ? calloc(1u, sizeof *i) : NULL;
    (void)name;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)events;
    (void)early;
    (void)intermediate;
    (void)n;
    (void)update;
    if (i != NULL) {
        const char *mistake = NULL;
        i->log = log;
        i->environment = environment;
        i->fmu.say = say;
        i->fmu.at = i;
        if (strcmp(token, ht_fmu_token()) != 0) {
            mistake = "the instantiation token of the model description is not that of the binary";
        } else if (!ht_fmu_reset(&i->fmu)) {
            mistake = "the board does not start";
        }
        if (mistake != NULL) {
            (void)ht_fmu_tell(&i->fmu, HT_FMU_ERROR, mistake);
            free(i);
            i = NULL;
        }
    }
    return i;
}

FMI3_NO_INSTANCE(fmi3InstantiateModelExchange)
FMI3_NO_INSTANCE(fmi3InstantiateScheduledExecution)

FMI3(void, fmi3FreeInstance, (fmi3Instance c))
{
    free(c);
}

FMI3(fmi3Status, fmi3EnterInitializationMode,
     (fmi3Instance c, fmi3Boolean tolerant, fmi3Float64 tolerance, fmi3Float64 start,
      fmi3Boolean stops, fmi3Float64 stop))
{
    (void)tolerant;
    (void)tolerance;
    (void)stops;
    (void)stop;
    ((instance *)c)->fmu.s.time_s = start;
    return HT_FMU_OK; /* the drive's time begins at the first step */
}

FMI3(fmi3Status, fmi3ExitInitializationMode, (fmi3Instance c))
{
    return (fmi3Status)ht_fmu_begin(&((instance *)c)->fmu);
}

FMI3(fmi3Status, fmi3Terminate, (fmi3Instance c))
{
    (void)c;
    return HT_FMU_OK;
}

FMI3(fmi3Status, fmi3Reset, (fmi3Instance c))
{
    return ht_fmu_reset(&((instance *)c)->fmu) ? HT_FMU_OK : HT_FMU_ERROR;
}

/* Values of one type: `kind` is one of the FMU's. No variable is an array. */
static fmi3Status one_each(const ht_fmu *f, size_t references, size_t values)
{
    return (references == values)
               ? HT_FMU_OK
               : (fmi3Status)ht_fmu_tell(f, HT_FMU_ERROR, "a value for each reference is needed");
}

#define GET_EACH(kind, type)                                       \
    const instance *i = c;                                         \
    size_t k;                                                      \
    if (one_each(&i->fmu, n, values) != HT_FMU_OK) {               \
        return HT_FMU_ERROR;                                       \
    }                                                              \
    for (k = 0u; k < n; k++) {                                     \
        double number;                                             \
        if (!ht_fmu_get(&i->fmu, (kind), reference[k], &number)) { \
            return HT_FMU_ERROR;                                   \
        }                                                          \
        value[k] = (type)number;                                   \
    }                                                              \
    return HT_FMU_OK;

#define SET_EACH(kind)                                                                      \
    instance *i = c;                                                                        \
    size_t k;                                                                               \
    if (one_each(&i->fmu, n, values) != HT_FMU_OK) {                                        \
        return HT_FMU_ERROR;                                                                \
    }                                                                                       \
    ht_fmu_set_begin(&i->fmu);                                                              \
    for (k = 0u; k < n; k++) {                                                              \
        ht_fmu_status status = ht_fmu_put(&i->fmu, (kind), reference[k], (double)value[k]); \
        if (status != HT_FMU_OK) {                                                          \
            return (fmi3Status)status;                                                      \
        }                                                                                   \
    }                                                                                       \
    return (fmi3Status)ht_fmu_set_end(&i->fmu);

FMI3(fmi3Status, fmi3GetFloat64,
     (fmi3Instance c, const fmi3ValueReference reference[], size_t n, fmi3Float64 value[],
      size_t values)){GET_EACH(HT_FMU_REAL, fmi3Float64)}

FMI3(fmi3Status, fmi3SetFloat64,
     (fmi3Instance c, const fmi3ValueReference reference[], size_t n, const fmi3Float64 value[],
      size_t values)){SET_EACH(HT_FMU_REAL)}

FMI3(fmi3Status, fmi3GetInt32,
     (fmi3Instance c, const fmi3ValueReference reference[], size_t n, fmi3Int32 value[],
      size_t values)){GET_EACH(HT_FMU_WHOLE, fmi3Int32)}

FMI3(fmi3Status, fmi3SetInt32,
     (fmi3Instance c, const fmi3ValueReference reference[], size_t n, const fmi3Int32 value[],
      size_t values)){SET_EACH(HT_FMU_WHOLE)}

FMI3(fmi3Status, fmi3GetInt64,
     (fmi3Instance c, const fmi3ValueReference reference[], size_t n, fmi3Int64 value[],
      size_t values)){GET_EACH(HT_FMU_CHOICE, fmi3Int64)}

FMI3(fmi3Status, fmi3SetInt64,
     (fmi3Instance c, const fmi3ValueReference reference[], size_t n, const fmi3Int64 value[],
      size_t values)){SET_EACH(HT_FMU_CHOICE)}

FMI3(fmi3Status, fmi3GetBoolean,
     (fmi3Instance c, const fmi3ValueReference reference[], size_t n, fmi3Boolean value[],
      size_t values)){GET_EACH(HT_FMU_FLAG, fmi3Boolean)}

FMI3(fmi3Status, fmi3SetBoolean,
     (fmi3Instance c, const fmi3ValueReference reference[], size_t n, const fmi3Boolean value[],
      size_t values)){SET_EACH(HT_FMU_FLAG)}

FMI3_NONE(fmi3GetFloat32) FMI3_NONE(fmi3SetFloat32) FMI3_NONE(fmi3GetInt8) FMI3_NONE(fmi3SetInt8)
    FMI3_NONE(fmi3GetUInt8) FMI3_NONE(fmi3SetUInt8) FMI3_NONE(fmi3GetInt16) FMI3_NONE(fmi3SetInt16)
        FMI3_NONE(fmi3GetUInt16) FMI3_NONE(fmi3SetUInt16) FMI3_NONE(fmi3GetUInt32)
            FMI3_NONE(fmi3SetUInt32) FMI3_NONE(fmi3GetUInt64) FMI3_NONE(fmi3SetUInt64)
                FMI3_NONE(fmi3GetString) FMI3_NONE(fmi3SetString) FMI3_NONE(fmi3GetBinary)
                    FMI3_NONE(fmi3SetBinary) FMI3_NONE(fmi3GetClock) FMI3_NONE(fmi3SetClock)

                        FMI3(fmi3Status, fmi3GetFMUState, (fmi3Instance c, fmi3FMUState *state))
{
    return (fmi3Status)ht_fmu_keep(&((instance *)c)->fmu, state);
}

FMI3(fmi3Status, fmi3SetFMUState, (fmi3Instance c, fmi3FMUState state))
{
    return (fmi3Status)ht_fmu_go_back(&((instance *)c)->fmu, state);
}

FMI3(fmi3Status, fmi3FreeFMUState, (fmi3Instance c, fmi3FMUState *state))
{
    (void)c;
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return HT_FMU_OK;
}

FMI3(fmi3Status, fmi3SerializedFMUStateSize, (fmi3Instance c, fmi3FMUState state, size_t *size))
{
    (void)c;
    (void)state;
    *size = sizeof(ht_fmu_kept);
    return HT_FMU_OK;
}

FMI3(fmi3Status, fmi3SerializeFMUState,
     (fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size))
{
    return (fmi3Status)ht_fmu_serialize(&((instance *)c)->fmu, state, bytes, size);
}

FMI3(fmi3Status, fmi3DeserializeFMUState,
     (fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state))
{
    return (fmi3Status)ht_fmu_deserialize(&((instance *)c)->fmu, bytes, size, state);
}

FMI3(fmi3Status, fmi3DoStep,
     (fmi3Instance c, fmi3Float64 now, fmi3Float64 step, fmi3Boolean no_way_back,
      fmi3Boolean *event, fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *reached))
{
    ht_fmu_status status = ht_fmu_step(&((instance *)c)->fmu, now, step);
    (void)no_way_back;
    *event = false;
    *end = false;
    *early = false;
    *reached = (status <= HT_FMU_WARNING) ? (now + step) : now;
    return (fmi3Status)status;
}

FMI3_NONE(fmi3EnterEventMode)
FMI3_NONE(fmi3GetNumberOfVariableDependencies)
FMI3_NONE(fmi3GetVariableDependencies)
FMI3_NONE(fmi3GetDirectionalDerivative)
FMI3_NONE(fmi3GetAdjointDerivative)
FMI3_NONE(fmi3EnterConfigurationMode)
FMI3_NONE(fmi3ExitConfigurationMode)
FMI3_NONE(fmi3GetIntervalDecimal)
FMI3_NONE(fmi3GetIntervalFraction)
FMI3_NONE(fmi3GetShiftDecimal)
FMI3_NONE(fmi3GetShiftFraction)
FMI3_NONE(fmi3SetIntervalDecimal)
FMI3_NONE(fmi3SetIntervalFraction)
FMI3_NONE(fmi3SetShiftDecimal)
FMI3_NONE(fmi3SetShiftFraction)
FMI3_NONE(fmi3EvaluateDiscreteStates)
FMI3_NONE(fmi3UpdateDiscreteStates)
FMI3_NONE(fmi3EnterContinuousTimeMode)
FMI3_NONE(fmi3CompletedIntegratorStep)
FMI3_NONE(fmi3SetTime)
FMI3_NONE(fmi3SetContinuousStates)
FMI3_NONE(fmi3GetContinuousStateDerivatives)
FMI3_NONE(fmi3GetEventIndicators)
FMI3_NONE(fmi3GetContinuousStates)
FMI3_NONE(fmi3GetNominalsOfContinuousStates)
FMI3_NONE(fmi3GetNumberOfEventIndicators)
FMI3_NONE(fmi3GetNumberOfContinuousStates)
FMI3_NONE(fmi3EnterStepMode)
FMI3_NONE(fmi3GetOutputDerivatives)
FMI3_NONE(fmi3ActivateModelPartition)
