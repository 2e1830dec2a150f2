/** @file ht_fmi3.h
 *  The part of FMI 3.0 that a co-simulation FMU provides (fmi-standard.org, FMI 3.0.2, chapters 2 and
 *  4): the types that its functions need.
 */
#ifndef HT_FMI3_H
#define HT_FMI3_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define HT_FMI_EXPORT __declspec(dllexport)
#else
#define HT_FMI_EXPORT __attribute__((visibility("default")))
#endif

typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef double fmi3Float64;
typedef int32_t fmi3Int32;
typedef int64_t fmi3Int64;
typedef bool fmi3Boolean;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;

/** fmi3Status: 0 OK, 1 warning, 2 discard, 3 error, as ht_fmu_status. */
typedef int fmi3Status;

typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment environment, fmi3Status status,
                                       fmi3String category, fmi3String message);

#endif
