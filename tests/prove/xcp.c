/* The commands of XCP: addresses, values that are written, lists that are put together. The drive and
 * the link are called by what they promise. */
#include "ht_octets.c"
#include "ht_xcp_daq.h"

uint16_t promise_ht_xcp_daq_place(const ht_xcp_daq *a, uint16_t list, uint16_t odt, uint16_t entry);

#include "ht_xcp_commands.c"
#include "ht_xcp_daq.c"
#include "ht_xcp_fast.c"
#include "ht_xcp_frames.c"
#include "ht_xcp_measure.c"
#include "ht_xcp_memory.c"
#include "prove.h"

#define CHANNELS 40u

static ht_xcp xcp;
static ht_service service;
static ht_drive drive;
static uint16_t look; /* any: what holds for the value of this number holds for all */
static uint16_t writes;
static bool has_started;
static bool has_stopped;
static ht_result answered; /* by the drive */

uint16_t ht_param_count(void)
{
    return (uint16_t)HT_PARAMS;
}

uint16_t ht_channel_count(void)
{
    return CHANNELS;
}

float ht_drive_get(const ht_drive *d, uint16_t id)
{
    MUST(id < (uint16_t)HT_PARAMS);
    return nondet_float();
}

float ht_channel_read(const ht_drive *d, uint16_t id)
{
    MUST(id < CHANNELS);
    return nondet_float();
}

ht_result ht_drive_write(ht_drive *d, const uint16_t *ids, const float *values, uint16_t n,
                         uint16_t *at)
{
    answered = (ht_result)nondet_uint16();
    GIVEN((unsigned)answered <= (unsigned)HT_ERROR_RESTART);
    MUST((n >= 1u) && (n <= HT_SERVICE_WRITE));
    MUST(IMPLIES(look < n, ids[look] < (uint16_t)HT_PARAMS));
    MUST(IMPLIES((look >= 1u) && (look < n), ids[look] == ids[look - 1u] + 1u));
    *at = nondet_uint16();
    writes++;
    return answered;
}

bool ht_request_rate_is_used(const ht_service *l)
{
    return nondet_bool();
}

uint16_t ht_request_start(ht_service *l, const uint16_t *in, uint16_t n)
{
    has_started = true;
    return nondet_uint16();
}

uint16_t ht_request_stop(ht_service *l, const uint16_t *in, uint16_t n)
{
    has_stopped = true;
    return (uint16_t)HT_OK;
}

uint16_t ht_request_clear(ht_service *l, const uint16_t *in, uint16_t n)
{
    has_started = true; /* needs the session as a START does */
    return nondet_uint16();
}

static bool is_value(uint16_t id)
{
    return ((id & HT_XCP_PARAMETER) != 0u) ? ((id & ~HT_XCP_PARAMETER) < (uint16_t)HT_PARAMS)
                                           : (id < CHANNELS);
}

/* What holds for lists between two commands. */
static bool lists_fit(const ht_xcp_daq *a, uint16_t list, uint16_t odt, uint16_t entry)
{
    bool fit = (a->lists <= HT_XCP_LISTS) && (a->odts <= HT_XCP_ODTS)
               && (a->entries <= HT_XCP_ENTRIES) && (a->head < HT_XCP_RING)
               && (a->tail < HT_XCP_RING) && (a->stage <= (uint16_t)HT_XCP_HAS_ENTRIES);
    if (fit && (list < HT_XCP_LISTS)) {
        const ht_xcp_list *l = &a->list[list];
        fit = (l->n == 0u) || ((l->n <= a->odts) && (l->first <= a->odts - l->n));
        fit = fit && IMPLIES(l->n != 0u, list < a->lists);
    }
    if (fit && (odt < HT_XCP_ODTS)) {
        const ht_xcp_odt *o = &a->odt[odt];
        fit = IMPLIES(o->n != 0u, odt < a->odts);
        fit = fit
              && ((o->n == 0u)
                  || ((o->n <= HT_XCP_ODT_ENTRIES) && (o->n <= a->entries)
                      && (o->first <= a->entries - o->n)));
    }
    if (fit && (entry < HT_XCP_ENTRIES)) {
        fit = (a->entry[entry] == HT_XCP_NOTHING)
              || ((entry < a->entries) && is_value(a->entry[entry]));
    }
    return fit;
}

static void any_xcp(void)
{
    xcp.service = &service;
    service.drive = &drive;
    service.session = nondet_uint16();
    xcp.session = nondet_uint16();
    xcp.page = nondet_uint16();
    xcp.mta = nondet_uint32();
    xcp.reply_waits = nondet_bool();
    xcp.pointer_list = nondet_uint16();
    xcp.pointer_odt = nondet_uint16();
    xcp.pointer_entry = nondet_uint16();
    look = nondet_uint16();
    GIVEN((xcp.session != 0u) && (xcp.page < (uint16_t)HT_XCP_PAGES));
}

void prove_xcp_address(void)
{
    uint32_t address = nondet_uint32();
    uint16_t id = ht_xcp_value_at(address);
    MUST((id == HT_XCP_NOTHING) || is_value(id));
    MUST(IMPLIES(id != HT_XCP_NOTHING, address - ht_xcp_address_of(id) < HT_XCP_VALUE));
}

void prove_xcp_octet(void)
{
    uint16_t octet;
    any_xcp();
    octet = octet_at(&xcp, xcp.mta);
    MUST((octet <= HT_OCTET) || (octet == HT_XCP_NOTHING));
    MUST((octet == HT_XCP_NOTHING) == (ht_xcp_value_at(xcp.mta) == HT_XCP_NOTHING));
}

/* The packet ends where the memory ends, so that a value that is not there is found. */
void prove_xcp_download(void)
{
    uint16_t n = nondet_uint16();
    uint16_t octets[n + 2u];
    uint16_t owner;
    bool waited;
    uint16_t result;
    GIVEN(n <= HT_XCP_CTO - 2u);
    octets[1] = n;
    any_xcp();
    owner = service.session;
    waited = xcp.reply_waits;
    result = ht_xcp_download(&xcp, octets);
    MUST(writes <= 1u);
    MUST(IMPLIES(writes == 1u, (xcp.page == (uint16_t)HT_XCP_WORKING)
                                   && ((owner == 0u) || (owner == xcp.session))));
    MUST(IMPLIES(owner != 0u, service.session == owner));
    MUST((result == (uint16_t)HT_XCP_OK) == ((writes == 1u) && (answered == HT_OK)));
    MUST(xcp.reply_waits == (waited || (result == (uint16_t)HT_XCP_OK)));
}

void prove_xcp_user_command(void)
{
    uint16_t octets[2];
    uint16_t owner;
    octets[1] = nondet_uint16() & HT_OCTET;
    any_xcp();
    owner = service.session;
    (void)user_command(&xcp, octets);
    MUST(IMPLIES(has_started, (owner == 0u) || (owner == xcp.session)));
    MUST(IMPLIES(has_started, service.session == xcp.session));
    MUST(has_stopped == (octets[1] == (uint16_t)HT_OP_STOP));
}

/* One request. What is said of the lists holds before it where it looks, and after it at any place. */
void prove_xcp_free(void)
{
    ht_xcp_daq a;
    uint16_t at = nondet_uint16();
    GIVEN(a.head < HT_XCP_RING);
    ht_xcp_daq_free(&a);
    MUST(lists_fit(&a, at, at, at));
}

void prove_xcp_alloc_lists(void)
{
    ht_xcp_daq a;
    uint16_t at = nondet_uint16();
    GIVEN(lists_fit(&a, at, at, at));
    (void)ht_xcp_daq_alloc_lists(&a, nondet_uint16());
    MUST(lists_fit(&a, at, at, at));
}

void prove_xcp_alloc_odts(void)
{
    ht_xcp_daq a;
    uint16_t list = nondet_uint16();
    uint16_t at = nondet_uint16();
    GIVEN(lists_fit(&a, list, at, at) && lists_fit(&a, at, at, at));
    (void)ht_xcp_daq_alloc_odts(&a, list, nondet_uint16());
    MUST(lists_fit(&a, at, at, at));
}

void prove_xcp_alloc_entries(void)
{
    ht_xcp_daq a;
    uint16_t list = nondet_uint16();
    uint16_t at = nondet_uint16();
    GIVEN(lists_fit(&a, list, at, at) && lists_fit(&a, at, at, at));
    (void)ht_xcp_daq_alloc_entries(&a, list, nondet_uint16(), nondet_uint16());
    MUST(lists_fit(&a, at, at, at));
}

void prove_xcp_place(void)
{
    ht_xcp_daq a;
    uint16_t list = nondet_uint16();
    uint16_t odt = nondet_uint16();
    uint16_t place;
    GIVEN(lists_fit(&a, list, 0u, 0u));
    if (list < a.lists) {
        GIVEN(lists_fit(&a, list, a.list[list].first + odt, 0u));
    }
    place = ht_xcp_daq_place(&a, list, odt, nondet_uint16());
    MUST((place == HT_XCP_NOTHING) || (place < a.entries));
}

/* As prove_xcp_place shows it. */
uint16_t promise_ht_xcp_daq_place(const ht_xcp_daq *a, uint16_t list, uint16_t odt, uint16_t entry)
{
    uint16_t place = nondet_uint16();
    GIVEN((place == HT_XCP_NOTHING) || (place < HT_XCP_ENTRIES));
    return place;
}

void prove_xcp_write_daq(void)
{
    uint16_t octets[8];
    uint16_t k;
    uint16_t result;
    for (k = 0u; k < 8u; k++) {
        octets[k] = nondet_uint16() & HT_OCTET;
    }
    any_xcp();
    xcp.daq.lists = nondet_uint16();
    GIVEN((xcp.daq.lists <= HT_XCP_LISTS) && (look < HT_XCP_ENTRIES));
    xcp.daq.entry[look] = HT_XCP_NOTHING;
    result = ht_xcp_write_daq(&xcp, octets);
    MUST((xcp.daq.entry[look] == HT_XCP_NOTHING) || is_value(xcp.daq.entry[look]));
    MUST(IMPLIES(result != (uint16_t)HT_XCP_OK, xcp.daq.entry[look] == HT_XCP_NOTHING));
    MUST(IMPLIES(result == (uint16_t)HT_XCP_OK, is_value(ht_xcp_value_at(ht_get32(&octets[4])))));
}
