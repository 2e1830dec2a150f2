/** @file ht_fmi2.h
 *  The part of FMI 2.0 that a co-simulation FMU provides (fmi-standard.org, FMI 2.0.4, chapters 2 and
 *  4): the types that its functions need.
 */
#ifndef HT_FMI2_H
#define HT_FMI2_H

#include <stddef.h>

#ifdef _WIN32
#define HT_FMI_EXPORT __declspec(dllexport)
#else
#define HT_FMI_EXPORT __attribute__((visibility("default")))
#endif

typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;

/** fmi2Status: 0 OK, 1 warning, 2 discard, 3 error, as ht_fmu_status. */
typedef int fmi2Status;
/** fmi2Type: 0 model exchange, 1 co-simulation. */
typedef int fmi2Type;
typedef int fmi2StatusKind;

typedef struct {
    void (*logger)(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                   fmi2String category, fmi2String message, ...);
    void *(*allocateMemory)(size_t n, size_t size);
    void (*freeMemory)(void *memory);
    void (*stepFinished)(fmi2ComponentEnvironment environment, fmi2Status status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

#endif
