/* Commands that read and write parameters and channels by their virtual addresses. */
#include "ht_xcp_commands.h"

#include "ht_octets.h"
#include "ht_requests.h"

#include <stddef.h>

#define CHECKSUM_CRC32 0x09u /* ASAM's number for zlib's CRC-32 */
#define STORE_CAL 0x01u
#define PAGE_OF_DRIVE 0x01u
#define PAGE_OF_MASTER 0x02u
#define PAGE_OF_ALL 0x80u /* segments: there is one */

static uint16_t number_in(uint32_t address, uint32_t begin, uint16_t rows)
{
    uint32_t row = (address - begin) / HT_XCP_VALUE; /* an address below has a large one */
    return (row < rows) ? (uint16_t)row : HT_XCP_NOTHING;
}

uint16_t ht_xcp_value_at(uint32_t address)
{
    uint16_t channel = number_in(address, HT_XCP_CHANNELS_AT, ht_channel_count());
    uint16_t parameter = number_in(address, HT_XCP_PARAMETERS_AT, ht_param_count());
    if (parameter != HT_XCP_NOTHING) {
        return (uint16_t)(HT_XCP_PARAMETER | parameter);
    }
    return channel;
}

uint32_t ht_xcp_address_of(uint16_t id)
{
    uint32_t begin = ((id & HT_XCP_PARAMETER) != 0u) ? HT_XCP_PARAMETERS_AT : HT_XCP_CHANNELS_AT;
    uint32_t row = id;
    row &= ~(uint32_t)HT_XCP_PARAMETER;
    return begin + (HT_XCP_VALUE * row);
}

/* The octet at an address, as the master's page shows it; HT_XCP_NOTHING if there is none. */
static uint16_t octet_at(const ht_xcp *x, uint32_t address)
{
    uint16_t id = ht_xcp_value_at(address);
    float value;
    if (id == HT_XCP_NOTHING) {
        return HT_XCP_NOTHING;
    }
    if (((id & HT_XCP_PARAMETER) != 0u) && (x->page == (uint16_t)HT_XCP_KEPT)) {
        value = x->kept.v[id & ~HT_XCP_PARAMETER];
    } else {
        value = ht_xcp_value(x->service->drive, id);
    }
    return (uint16_t)((ht_float_bits(value) >> (8u * (address % HT_XCP_VALUE))) & HT_OCTET);
}

static uint16_t octets_from(ht_xcp *x, uint32_t address, uint16_t n)
{
    ht_xcp_packet *p = &x->reply;
    uint16_t k;
    for (k = 0u; k < n; k++) {
        uint16_t octet = octet_at(x, address + k);
        if (octet == HT_XCP_NOTHING) {
            return HT_XCP_ACCESS_DENIED;
        }
        ht_xcp_add8(p, octet);
    }
    return HT_XCP_OK;
}

uint16_t ht_xcp_set_mta(ht_xcp *x, const uint16_t *in)
{
    if (in[3] != 0u) {
        return HT_XCP_OUT_OF_RANGE;
    }
    x->mta = ht_get32(&in[4]);
    x->text = NULL;
    return HT_XCP_OK;
}

static uint16_t text_from(ht_xcp *x, uint16_t n)
{
    uint16_t k;
    for (k = 0u; k < n; k++) {
        if (x->text[k] == '\0') {
            return HT_XCP_ACCESS_DENIED;
        }
        ht_xcp_add8(&x->reply, (uint16_t)x->text[k]);
    }
    x->text = &x->text[n];
    return HT_XCP_OK;
}

uint16_t ht_xcp_upload(ht_xcp *x, const uint16_t *in)
{
    uint16_t result;
    if ((in[1] == 0u) || (in[1] >= HT_XCP_CTO)) {
        return HT_XCP_OUT_OF_RANGE;
    }
    if (x->text != NULL) {
        return text_from(x, in[1]);
    }
    result = octets_from(x, x->mta, in[1]);
    if (result == (uint16_t)HT_XCP_OK) {
        x->mta += in[1];
    }
    return result;
}

uint16_t ht_xcp_short_upload(ht_xcp *x, const uint16_t *in)
{
    if ((in[1] == 0u) || (in[1] >= HT_XCP_CTO) || (in[3] != 0u)) {
        return HT_XCP_OUT_OF_RANGE;
    }
    x->mta = ht_get32(&in[4]);
    x->text = NULL;
    return ht_xcp_upload(x, in);
}

uint16_t ht_xcp_build_checksum(ht_xcp *x, const uint16_t *in)
{
    uint32_t n = ht_get32(&in[4]);
    uint32_t crc = 0u;
    uint32_t k;
    if (n == 0u) {
        return HT_XCP_OUT_OF_RANGE;
    }
    for (k = 0u; k < n; k++) { /* no table is long */
        uint16_t octet = octet_at(x, x->mta + k);
        if (octet == HT_XCP_NOTHING) {
            return HT_XCP_ACCESS_DENIED;
        }
        crc = ht_crc32(crc, &octet, 1u);
    }
    x->mta += n;
    ht_xcp_add8(&x->reply, CHECKSUM_CRC32);
    ht_xcp_add16(&x->reply, 0u);
    ht_xcp_add32(&x->reply, crc);
    return HT_XCP_OK;
}

static bool rate_is_used(const ht_xcp *x)
{
    return ht_request_rate_is_used(x->service) || ht_xcp_daq_any(&x->daq);
}

static uint16_t refused(ht_xcp *x, uint16_t result)
{
    x->detail = result;
    switch (result) {
    case HT_OK:
        return HT_XCP_OK;
    case HT_ERROR_STATE:
        return HT_XCP_ACCESS_DENIED;
    case HT_ERROR_STORE:
        return HT_XCP_GENERIC;
    default:
        return HT_XCP_OUT_OF_RANGE;
    }
}

#define MOST_VALUES ((HT_XCP_CTO - 2u) / HT_XCP_VALUE)

/* The values of a DOWNLOAD, from parameter `first` on: all of them or none. */
static uint16_t write_values(ht_xcp *x, uint16_t first, const uint16_t *in, uint16_t count)
{
    uint16_t ids[MOST_VALUES];
    float values[MOST_VALUES];
    ht_drive *d = x->service->drive;
    uint16_t at = 0u;
    uint16_t k;
    for (k = 0u; k < MOST_VALUES; k++) {
        ids[k] = 0u;
        values[k] = 0.0f;
    }
    for (k = 0u; k < count; k++) {
        ids[k] = (uint16_t)(first + k);
        values[k] = ht_float_of(ht_get32(&in[HT_XCP_VALUE * k]));
        if ((ids[k] == (uint16_t)HT_P_f_isr_Hz) && rate_is_used(x)
            && (values[k] != ht_drive_get(d, ids[k]))) {
            return refused(x, (uint16_t)HT_ERROR_STATE);
        }
    }
    return refused(x, (uint16_t)ht_drive_write(d, ids, values, count, &at));
}

uint16_t ht_xcp_download(ht_xcp *x, const uint16_t *in)
{
    uint16_t n = in[1];
    uint16_t result;
    uint16_t id;
    if ((n == 0u) || ((n % HT_XCP_VALUE) != 0u) || ((n / HT_XCP_VALUE) > MOST_VALUES)) {
        return HT_XCP_OUT_OF_RANGE;
    }
    if (x->text != NULL) {
        return HT_XCP_WRITE_PROTECTED;
    }
    id = ht_xcp_value_at(x->mta);
    if (id == HT_XCP_NOTHING) {
        return HT_XCP_ACCESS_DENIED;
    }
    if (((id & HT_XCP_PARAMETER) == 0u) || (x->page != (uint16_t)HT_XCP_WORKING)) {
        return HT_XCP_WRITE_PROTECTED;
    }
    if (((x->mta % HT_XCP_VALUE) != 0u)) {
        return HT_XCP_OUT_OF_RANGE;
    }
    if (ht_xcp_value_at(x->mta + n - HT_XCP_VALUE) == HT_XCP_NOTHING) {
        return HT_XCP_ACCESS_DENIED;
    }
    if (!ht_xcp_owns(x)) {
        return HT_XCP_ACCESS_DENIED;
    }
    result =
        write_values(x, (uint16_t)(id & ~HT_XCP_PARAMETER), &in[2], (uint16_t)(n / HT_XCP_VALUE));
    if (result == (uint16_t)HT_XCP_OK) {
        x->mta += n;
        x->service->burst.command = 1u;
        x->reply_waits = true;
    }
    return result;
}

/* Reads what is kept into the page of that name, or else the built-in values. */
static void look_into_store(ht_xcp *x)
{
    const ht_store *store = x->service->setup.store;
    if ((store == NULL) || (ht_store_load(store, &x->kept) != (uint16_t)HT_SET_SAVED)) {
        ht_params_default(&x->kept);
    }
}

uint16_t ht_xcp_set_request(ht_xcp *x, const uint16_t *in)
{
    uint16_t result;
    if (in[1] != STORE_CAL) {
        return HT_XCP_OUT_OF_RANGE;
    }
    if (!ht_xcp_owns(x)) {
        return HT_XCP_ACCESS_DENIED;
    }
    if (rate_is_used(x)) {
        return refused(x, (uint16_t)HT_ERROR_STATE);
    }
    result = refused(x, (uint16_t)ht_service_keep(x->service));
    if (result == (uint16_t)HT_XCP_OK) {
        x->event = (uint16_t)HT_XCP_EV_STORE_CAL;
    }
    return result;
}

uint16_t ht_xcp_set_cal_page(ht_xcp *x, const uint16_t *in)
{
    uint16_t who = (uint16_t)(in[1] & ~PAGE_OF_ALL);
    if ((in[2] != 0u) && ((in[1] & PAGE_OF_ALL) == 0u)) {
        return HT_XCP_SEGMENT_NOT_VALID;
    }
    if (in[3] >= (uint16_t)HT_XCP_PAGES) {
        return HT_XCP_PAGE_NOT_VALID;
    }
    if ((who == 0u) || (who > (PAGE_OF_DRIVE | PAGE_OF_MASTER))
        || ((in[3] != (uint16_t)HT_XCP_WORKING) && ((who & PAGE_OF_DRIVE) != 0u))) {
        return HT_XCP_MODE_NOT_VALID; /* the drive works with its page alone */
    }
    if ((who & PAGE_OF_MASTER) != 0u) {
        look_into_store(x);
        x->page = in[3];
    }
    return HT_XCP_OK;
}

uint16_t ht_xcp_get_cal_page(ht_xcp *x, const uint16_t *in)
{
    if (in[2] != 0u) {
        return HT_XCP_SEGMENT_NOT_VALID;
    }
    if ((in[1] != PAGE_OF_DRIVE) && (in[1] != PAGE_OF_MASTER)) {
        return HT_XCP_MODE_NOT_VALID;
    }
    ht_xcp_add16(&x->reply, 0u);
    ht_xcp_add8(&x->reply, (in[1] == PAGE_OF_MASTER) ? x->page : (uint16_t)HT_XCP_WORKING);
    return HT_XCP_OK;
}

uint16_t ht_xcp_page_processor(ht_xcp *x, const uint16_t *in)
{
    (void)in;
    ht_xcp_add8(&x->reply, 1u); /* segments */
    ht_xcp_add8(&x->reply, 0u); /* no freeze mode */
    return HT_XCP_OK;
}

uint16_t ht_xcp_segment(ht_xcp *x, const uint16_t *in)
{
    ht_xcp_packet *p = &x->reply;
    if (in[2] != 0u) {
        return HT_XCP_SEGMENT_NOT_VALID;
    }
    if ((in[1] == 0u) && (in[3] <= 1u)) { /* where it is, how long it is */
        uint32_t octets = (uint32_t)HT_XCP_VALUE * ht_param_count();
        ht_xcp_add8(p, 0u);
        ht_xcp_add16(p, 0u);
        ht_xcp_add32(p, (in[3] == 0u) ? HT_XCP_PARAMETERS_AT : octets);
        return HT_XCP_OK;
    }
    if (in[1] != 1u) {
        return HT_XCP_OUT_OF_RANGE;
    }
    ht_xcp_add8(p, HT_XCP_PAGES);
    ht_xcp_add32(p, 0u); /* no address extension, mapping, compression, encryption */
    return HT_XCP_OK;
}

uint16_t ht_xcp_page(ht_xcp *x, const uint16_t *in)
{
    /* The working page: drive and master have it in any case. The kept one: only the master, and it
     * reads. */
    static const uint16_t properties[HT_XCP_PAGES] = {0x3Fu, 0x0Cu};
    if (in[2] != 0u) {
        return HT_XCP_SEGMENT_NOT_VALID;
    }
    if (in[3] >= (uint16_t)HT_XCP_PAGES) {
        return HT_XCP_PAGE_NOT_VALID;
    }
    ht_xcp_add8(&x->reply, properties[in[3]]);
    ht_xcp_add8(&x->reply, 0u); /* segment that initialises it */
    return HT_XCP_OK;
}
