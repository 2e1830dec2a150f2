#include "ht_mirror.h"

#include "port.h"

#define LEG_REGISTERS 21
/* Of the eQEP what the drivers use: QPOSCNT to QPOSILAT, QDECCTL to QCPRD. */
#define EQEP_POSITIONS 0x0Au
#define EQEP_CONTROLS 0x14u
#define EQEP_WORDS 0x1Fu
#define ABSENT 0xFFFFu /* ht_c2000_map.h */
#define PIEACK 0x0CE1u

uint16_t ht_mirror_addresses(const ht_c2000_map *m, uint32_t *out)
{
    const uint16_t offset[LEG_REGISTERS] = {
        m->tbctl, m->tbctr,  m->tbprd,  m->tbphs,   m->cmpctl, m->cmpa,  m->cmpb,
        m->aqctl, m->aqctla, m->aqsfrc, m->aqcsfrc, m->dbctl,  m->dbred, m->dbfed,
        m->tzsel, m->tzctl,  m->tzflg,  m->tzclr,   m->tzfrc,  m->etsel, m->etps,
    };
    uint16_t n = 0u;
    uint16_t i;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        for (i = 0u; i < (uint16_t)LEG_REGISTERS; i++) {
            if (offset[i] != ABSENT) {
                out[n++] = m->epwm + (uint32_t)leg * m->stride + offset[i];
            }
        }
    }
    for (i = 0u; i < (uint16_t)HT_ADC_CHANNELS; i++) {
        out[n++] = m->adc_result[i];
    }
    out[n++] = m->adc_slow_result[0];
    if (m->adc_slow_select != ABSENT) {
        out[n++] = m->adc_slow_select;
    } else {
        out[n++] = m->adc_slow_result[1];
    }
    for (i = 0u; i < EQEP_WORDS; i++) {
        if ((i < EQEP_POSITIONS) || (i >= EQEP_CONTROLS)) {
            out[n++] = m->eqep + i;
        }
    }
    out[n++] = m->gpio_data; /* of port A, where the trip pin is */
    out[n++] = m->gpio_data + 1u;
    out[n++] = (uint32_t)HT_REGFILE_ABSOLUTE;
    out[n++] = (uint32_t)HT_REGFILE_ABSOLUTE + 1u;
    out[n++] = m->adc_flag;
    if (m->adc_clear != m->adc_flag) {
        out[n++] = m->adc_clear;
    }
    if (m->adc_commands != ABSENT) {
        out[n++] = m->adc_commands;
    }
    out[n++] = PIEACK;
    return n;
}

void ht_mirror_init(ht_mirror *m, ht_regfile *registers, const ht_c2000_map *map)
{
    uint32_t address[HT_MIRROR_MAX];
    uint16_t i;
    m->count = ht_mirror_addresses(map, address);
    for (i = 0u; i < m->count; i++) {
        m->cell[i] = ht_regfile_word(registers, address[i]);
        m->agreed[i] = *m->cell[i];
    }
}

/* The end of the run of changes that begins at `first`. */
static uint16_t run_end(const ht_mirror *m, uint16_t first)
{
    uint16_t end = (uint16_t)(first + 1u);
    uint16_t i;
    for (i = end; (i < m->count) && (i <= (uint16_t)(end + 1u)); i++) {
        if (*m->cell[i] != m->agreed[i]) {
            end = (uint16_t)(i + 1u);
        }
    }
    return end;
}

/* The first change from `i` on; `count` if there is none. */
static uint16_t next_change(const ht_mirror *m, uint16_t i)
{
    uint16_t *const *cell = &m->cell[i];
    const uint16_t *agreed = &m->agreed[i];
    const uint16_t *end = &m->agreed[m->count];
    while ((agreed != end) && (**cell == *agreed)) {
        cell++;
        agreed++;
    }
    return (uint16_t)(agreed - m->agreed);
}

void ht_mirror_tell(ht_mirror *m, ht_packet *p)
{
    uint16_t i = next_change(m, 0u);
    while (i < m->count) {
        uint16_t end = run_end(m, i);
        ht_packet_add8(p, i);
        ht_packet_add8(p, (uint16_t)(end - i));
        for (; i < end; i++) {
            m->agreed[i] = *m->cell[i];
            ht_packet_add16(p, m->agreed[i]);
        }
        i = next_change(m, end);
    }
}

bool ht_mirror_take(ht_mirror *m, ht_reader *r)
{
    while (r->left != 0u) {
        uint16_t i = ht_read8(r);
        uint16_t end = (uint16_t)(i + ht_read8(r));
        if (end > m->count) {
            return false;
        }
        for (; i < end; i++) {
            m->agreed[i] = ht_read16(r);
            *m->cell[i] = m->agreed[i];
        }
    }
    return !r->exceeded;
}

uint32_t ht_mirror_digest(const ht_mirror *m, uint16_t turn)
{
    uint32_t sum = 0u;
    uint16_t i;
    for (i = turn % HT_MIRROR_TURNS; i < m->count; i = (uint16_t)(i + HT_MIRROR_TURNS)) {
        sum = ((sum << 5) | (sum >> 27)) ^ *m->cell[i];
    }
    return sum;
}

void ht_mirror_read(const ht_mirror *m, uint16_t *out)
{
    uint16_t i;
    for (i = 0u; i < m->count; i++) {
        out[i] = *m->cell[i];
    }
}
