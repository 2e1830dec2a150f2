#include "ht_dictionary.h"

#include "ht_drive.h"
#include "ht_octets.h"

#define TYPE_F32 0u
#define FLAG_LIVE 1u
#define FLAG_WHOLE 2u

uint16_t ht_dictionary_rows(uint16_t kind)
{
    switch (kind) {
    case HT_LIST_PARAMETER:
        return ht_param_count();
    case HT_LIST_CHANNEL:
        return ht_channel_count();
    case HT_LIST_FAULT:
        return ht_fault_count();
    case HT_LIST_STATE:
        return (uint16_t)HT_STATES;
    case HT_LIST_ADDITIONS:
        return 1u;
    default:
        return 0u;
    }
}

static void add_parameter(ht_packet *p, const ht_port *port, uint16_t id)
{
    const ht_param_info *info = ht_param_describe(id);
    ht_range range = ht_param_range(port, id);
    uint16_t flags = (info->when == (uint16_t)HT_WHEN_LIVE) ? FLAG_LIVE : 0u;
    flags |= info->whole ? FLAG_WHOLE : 0u;
    ht_packet_add8(p, TYPE_F32);
    ht_packet_add8(p, flags);
    ht_packet_add_float(p, range.min);
    ht_packet_add_float(p, range.max);
    ht_packet_add_float(p, info->initial);
    ht_packet_add_text(p, info->name);
    ht_packet_add_text(p, info->unit);
    ht_packet_add_text(p, info->choices);
    ht_packet_add_text(p, info->help);
}

static void add_channel(ht_packet *p, const ht_channel_info *info)
{
    ht_packet_add8(p, TYPE_F32);
    ht_packet_add_text(p, info->name);
    ht_packet_add_text(p, info->unit);
    ht_packet_add_text(p, info->help);
}

static void add_fault(ht_packet *p, const ht_fault_info *info)
{
    ht_packet_add16(p, HT_LOW_FAULTS(info->bit)); /* 0: the row says which one */
    ht_packet_add_text(p, info->name);
    ht_packet_add_text(p, info->help);
}

/* Later minor versions append. */
static void add_additions(ht_packet *p)
{
    uint16_t row;
    ht_packet_add16(p, HT_DICTIONARY_MINOR);
    for (row = 0u; row < (uint16_t)HT_STATES; row++) {
        ht_packet_add8(p, ht_state_flags(row));
    }
}

bool ht_dictionary_add(ht_packet *p, const ht_port *port, uint16_t kind, uint16_t row)
{
    if (row >= ht_dictionary_rows(kind)) {
        return false;
    }
    ht_packet_add8(p, kind);
    ht_packet_add16(p, row);
    switch (kind) {
    case HT_LIST_PARAMETER:
        add_parameter(p, port, row);
        break;
    case HT_LIST_CHANNEL:
        add_channel(p, ht_channel_describe(row));
        break;
    case HT_LIST_FAULT:
        add_fault(p, ht_fault_describe(row));
        break;
    case HT_LIST_ADDITIONS:
        add_additions(p);
        break;
    case HT_LIST_STATE:
    default:
        ht_packet_add_text(p, ht_state_name(row));
        break;
    }
    return true;
}

uint32_t ht_dictionary_crc(ht_packet *scratch, const ht_port *port)
{
    uint32_t crc = 0u;
    uint16_t kind;
    uint16_t row;
    for (kind = 0u; kind < (uint16_t)HT_LISTS; kind++) {
        for (row = 0u; row < ht_dictionary_rows(kind); row++) {
            ht_packet_begin(scratch);
            (void)ht_dictionary_add(scratch, port, kind, row);
            crc = ht_crc32(crc, scratch->octet, scratch->n);
        }
    }
    return crc;
}
