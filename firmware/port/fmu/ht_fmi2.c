/* FMI 2.0 for co-simulation in front of ht_fmu.h. */
#include "ht_fmi2.h"

#include <stdlib.h>
#include <string.h>

#include "ht_fmu.h"

/* An exported function: its declaration, then its definition. */
#define FMI2(type, name, arguments)    \
    HT_FMI_EXPORT type name arguments; \
    HT_FMI_EXPORT type name arguments

/* A function that the FMU does not have. It looks at its first argument alone: the caller removes the
 * others on all systems for which there are binaries. */
#define FMI2_NONE(name)                                                                   \
    FMI2(fmi2Status, name, (fmi2Component c))                                             \
    {                                                                                     \
        return (fmi2Status)ht_fmu_tell(&((instance *)c)->fmu, HT_FMU_ERROR,               \
                                       #name ": the FMU does not support this function"); \
    }

typedef struct {
    ht_fmu fmu;
    const fmi2CallbackFunctions *call;
    char name[256];
} instance;

/* The message is a format for some masters, and for others it is not: no line has a percent sign. */
static void say(void *at, ht_fmu_status status, const char *line)
{
    const instance *i = at;
    if (i->call->logger != NULL) {
        i->call->logger(i->call->componentEnvironment, i->name, (fmi2Status)status,
                        (status == HT_FMU_WARNING) ? "logStatusWarning" : "logStatusError", line);
    }
}

FMI2(const char *, fmi2GetTypesPlatform, (void))
{
    return "default";
}

FMI2(const char *, fmi2GetVersion, (void))
{
    return "2.0";
}

FMI2(fmi2Status, fmi2SetDebugLogging,
     (fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]))
{
    (void)c;
    (void)on;
    (void)n;
    (void)categories;
    return HT_FMU_OK; /* errors and warnings are always told, and there is nothing else */
}

FMI2(fmi2Component, fmi2Instantiate,
     (fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
      const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging))
{
    instance *i = NULL;
    (void)resources;
    (void)visible;
    (void)logging;
    if ((functions != NULL) && (name != NULL) && (guid != NULL)) {
        i = calloc(1u, sizeof *i);
    }
    if (i != NULL) {
        const char *mistake = NULL;
        i->call = functions;
        strncpy(i->name, name, sizeof i->name - 1u);
        i->fmu.say = say;
        i->fmu.at = i;
        if (type != 1) {
            mistake = "the FMU is for co-simulation only";
        } else if (strcmp(guid, ht_fmu_token()) != 0) {
            mistake = "the GUID of the model description is not that of the binary";
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

FMI2(void, fmi2FreeInstance, (fmi2Component c))
{
    free(c);
}

FMI2(fmi2Status, fmi2SetupExperiment,
     (fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real start, fmi2Boolean stops,
      fmi2Real stop))
{
    (void)tolerant;
    (void)tolerance;
    (void)stops;
    (void)stop;
    ((instance *)c)->fmu.s.time_s = start;
    return HT_FMU_OK; /* the drive's time begins at the first step */
}

FMI2(fmi2Status, fmi2EnterInitializationMode, (fmi2Component c))
{
    (void)c;
    return HT_FMU_OK;
}

FMI2(fmi2Status, fmi2ExitInitializationMode, (fmi2Component c))
{
    return (fmi2Status)ht_fmu_begin(&((instance *)c)->fmu);
}

FMI2(fmi2Status, fmi2Terminate, (fmi2Component c))
{
    (void)c;
    return HT_FMU_OK;
}

FMI2(fmi2Status, fmi2Reset, (fmi2Component c))
{
    return ht_fmu_reset(&((instance *)c)->fmu) ? HT_FMU_OK : HT_FMU_ERROR;
}

/* Values of one type: `kind` is one of the FMU's. */
#define GET_EACH(kind, type)                                       \
    const instance *i = c;                                         \
    size_t k;                                                      \
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
    ht_fmu_set_begin(&i->fmu);                                                              \
    for (k = 0u; k < n; k++) {                                                              \
        ht_fmu_status status = ht_fmu_put(&i->fmu, (kind), reference[k], (double)value[k]); \
        if (status != HT_FMU_OK) {                                                          \
            return (fmi2Status)status;                                                      \
        }                                                                                   \
    }                                                                                       \
    return (fmi2Status)ht_fmu_set_end(&i->fmu);

/* FMI 2 reads and writes a choice as an integer. */
static uint16_t whole_or_choice(fmi2ValueReference reference)
{
    uint16_t kind = ht_fmu_kind(HT_FMU_THIS, reference);
    return (kind == HT_FMU_CHOICE) ? kind : (uint16_t)HT_FMU_WHOLE;
}

FMI2(fmi2Status, fmi2GetReal,
     (fmi2Component c, const fmi2ValueReference reference[], size_t n, fmi2Real value[])){
    GET_EACH(HT_FMU_REAL, fmi2Real)}

FMI2(fmi2Status, fmi2GetInteger,
     (fmi2Component c, const fmi2ValueReference reference[], size_t n, fmi2Integer value[])){
    GET_EACH(whole_or_choice(reference[k]), fmi2Integer)}

FMI2(fmi2Status, fmi2GetBoolean,
     (fmi2Component c, const fmi2ValueReference reference[], size_t n, fmi2Boolean value[])){
    GET_EACH(HT_FMU_FLAG, fmi2Boolean)}

FMI2_NONE(fmi2GetString)

    FMI2(fmi2Status, fmi2SetReal,
         (fmi2Component c, const fmi2ValueReference reference[], size_t n, const fmi2Real value[])){
        SET_EACH(HT_FMU_REAL)}

FMI2(fmi2Status, fmi2SetInteger,
     (fmi2Component c, const fmi2ValueReference reference[], size_t n, const fmi2Integer value[])){
    SET_EACH(whole_or_choice(reference[k]))}

FMI2(fmi2Status, fmi2SetBoolean,
     (fmi2Component c, const fmi2ValueReference reference[], size_t n, const fmi2Boolean value[])){
    SET_EACH(HT_FMU_FLAG)}

FMI2_NONE(fmi2SetString)

    FMI2(fmi2Status, fmi2GetFMUstate, (fmi2Component c, fmi2FMUstate *state))
{
    return (fmi2Status)ht_fmu_keep(&((instance *)c)->fmu, state);
}

FMI2(fmi2Status, fmi2SetFMUstate, (fmi2Component c, fmi2FMUstate state))
{
    return (fmi2Status)ht_fmu_go_back(&((instance *)c)->fmu, state);
}

FMI2(fmi2Status, fmi2FreeFMUstate, (fmi2Component c, fmi2FMUstate *state))
{
    (void)c;
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return HT_FMU_OK;
}

FMI2(fmi2Status, fmi2SerializedFMUstateSize, (fmi2Component c, fmi2FMUstate state, size_t *size))
{
    (void)c;
    (void)state;
    *size = sizeof(ht_fmu_kept);
    return HT_FMU_OK;
}

FMI2(fmi2Status, fmi2SerializeFMUstate,
     (fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size))
{
    return (fmi2Status)ht_fmu_serialize(&((instance *)c)->fmu, state, bytes, size);
}

FMI2(fmi2Status, fmi2DeSerializeFMUstate,
     (fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state))
{
    return (fmi2Status)ht_fmu_deserialize(&((instance *)c)->fmu, bytes, size, state);
}

FMI2_NONE(fmi2GetDirectionalDerivative)
FMI2_NONE(fmi2SetRealInputDerivatives)
FMI2_NONE(fmi2GetRealOutputDerivatives)

FMI2(fmi2Status, fmi2DoStep,
     (fmi2Component c, fmi2Real now, fmi2Real step, fmi2Boolean no_way_back))
{
    (void)no_way_back;
    return (fmi2Status)ht_fmu_step(&((instance *)c)->fmu, now, step);
}

FMI2_NONE(fmi2CancelStep)
FMI2_NONE(fmi2GetStatus)
FMI2_NONE(fmi2GetRealStatus)
FMI2_NONE(fmi2GetIntegerStatus)
FMI2_NONE(fmi2GetBooleanStatus)
FMI2_NONE(fmi2GetStringStatus)
