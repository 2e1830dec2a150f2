/** @file ht_param_groups.h
 *  The groups in which tables and pages show the parameters. Boards do not have them.
 */
#ifndef HT_PARAM_GROUPS_H
#define HT_PARAM_GROUPS_H

#include <stdint.h>

/** Number of groups. */
uint16_t ht_group_count(void);

/** Title of a group, in the order of ht_params.def; NULL for an unknown number. */
const char *ht_group_title(uint16_t group);

/** Number of the group that a parameter belongs to; the number of groups for an unknown id. */
uint16_t ht_param_group(uint16_t id);

#endif
