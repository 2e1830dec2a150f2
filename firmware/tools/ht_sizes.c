/* One drive, for a look at what it takes in memory on a target (nm --print-size). */
#include "ht_drive.h"

extern ht_drive ht_one_drive;
ht_drive ht_one_drive;
