#include "ht_mirror.h"

#include "ht_frame.h"
#include "port.h"

#define LEG_REGISTERS 21
#define EQEP_WORDS 0x21u
#define ABSENT 0xFFFFu
#define PIEACK 0x0CE1u
#define ADCTRL2 0x7101u /* F28335 */

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
    for (i = 0u; i < EQEP_WORDS; i++) {
        out[n++] = m->eqep + i;
    }
    out[n++] = m->gpio_data; /* of port A, where the trip pin is */
    out[n++] = m->gpio_data + 1u;
    out[n++] = m->adc_flag;
    if (m->adc_clear != m->adc_flag) {
        out[n++] = m->adc_clear;
    }
    if (m->device == HT_F28335) {
        out[n++] = ADCTRL2;
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

uint16_t ht_mirror_changes(ht_mirror *m, uint16_t *pairs)
{
    uint16_t *const *cell = m->cell;
    uint16_t *agreed = m->agreed;
    const uint16_t *end = agreed + m->count;
    uint16_t n = 0u;
    for (; agreed != end; agreed++) {
        uint16_t value = **cell++;
        if (value != *agreed) {
            *agreed = value;
            pairs[n] = (uint16_t)(agreed - m->agreed);
            pairs[n + 1u] = value;
            n = (uint16_t)(n + 2u);
        }
    }
    return n;
}

bool ht_mirror_apply(ht_mirror *m, const uint16_t *pairs, uint16_t words)
{
    uint16_t n;
    if ((words & 1u) != 0u) {
        return false;
    }
    for (n = 0u; n < words; n = (uint16_t)(n + 2u)) {
        uint16_t i = pairs[n];
        if (i >= m->count) {
            return false;
        }
        m->agreed[i] = pairs[n + 1u];
        *m->cell[i] = pairs[n + 1u];
    }
    return true;
}

uint32_t ht_mirror_digest(const ht_mirror *m, uint16_t turn)
{
    uint32_t sum = 0u;
    uint16_t i;
    for (i = turn % HT_MIRROR_TURNS; i < m->count; i = (uint16_t)(i + HT_MIRROR_TURNS)) {
        sum = ht_fletcher(sum, m->cell[i], 1u);
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
