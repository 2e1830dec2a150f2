/** @file pil_server.h
 *  The target's end of processor in the loop, over two pipes of the emulator's working
 *  directory: requests come through `to_target`, replies leave through `from_target`.
 */
#ifndef PIL_SERVER_H
#define PIL_SERVER_H

#include "ht_pil_line.h"

enum { EXIT_OK = 0, EXIT_FILE = 2, EXIT_SETUP = 3 };

/** Answer requests until the host closes its side. Returns the exit status. */
int pil_server_run(ht_pil_line *line);

#endif
