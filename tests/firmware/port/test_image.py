"""The complete images, from reset on: what the start leaves in the registers is what
it should be, the interrupts arrive and are acknowledged, the watchdog watches. And
each of these checks can fail: faults are planted in the drivers' sources.
"""

import difflib
import shutil
import sys

import c2000_image as image
import pytest
from campaigns import part

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux") or shutil.which(image.CC) is None,
    reason="Linux and a C compiler are needed",
)


@pytest.fixture(scope="module")
def builder(tmp_path_factory):
    return image.Builder(tmp_path_factory.mktemp("image"))


def difference(board, lines):
    """From the golden image to the one that a run printed."""
    want = image.golden(board).read_text().splitlines()
    found = image.describe(board, lines)
    return list(difflib.unified_diff(want, found, f"{board}: golden", "found", "", "", 0))


@pytest.mark.parametrize("board", image.BOARDS)
def test_image_of_a_board(builder, board):
    good, lines = image.run(builder.build(board))
    assert not image.complaints(lines)
    assert good
    assert not difference(board, lines), "\n".join(difference(board, lines))


INIT = "ht_port_c2000.c"
F28335, F28377S, LAUNCHPAD = image.BOARDS

CALIBRATED = "    HT_DEVICE_CAL(port->io);\n    HT_EALLOW(port->io);\n"
MEASURED = "    clock = start_crystal(port);\n"

#: What is broken -> (board, source, text, replacement, what a complaint, or a line of the
#: difference from the golden image, says).
FAULTS = {
    # protection
    "no EALLOW at the trip": (
        F28335, "ht_pwm.c", "    HT_EALLOW(io);\n", "", "TZCTL: no EALLOW"),
    "no EALLOW for gates on": (
        F28377S, "ht_pwm.c",
        "        ht_cmpss_forget(port);\n        HT_EALLOW(port->io);",
        "        ht_cmpss_forget(port);", "TZCLR: no EALLOW"),
    "no EALLOW for the PLL": (
        F28377S, "ht_clock_f28377s.c", "    HT_EALLOW(port->io);\n    clock = start_crystal(port);",
        "    clock = start_crystal(port);",
        "CLKSRCCTL1: no EALLOW"),
    "no EALLOW for the pins": (
        F28335, "ht_pins.c",
        "    HT_EALLOW(port->io);\n    for (n = 0u; n < (2u * (uint16_t)HT_LEGS); n++) {\n"
        "        set_up",
        "    for (n = 0u; n < (2u * (uint16_t)HT_LEGS); n++) {\n        set_up",
        "MUX1: no EALLOW"),
    "no EALLOW for the vectors": (
        F28377S, "ht_pie.c", "    HT_EALLOW(port->io);\n", "", "VECTOR13: no EALLOW"),
    "no EALLOW for the watchdog": (
        F28335, "ht_watchdog.c",
        "    HT_EALLOW(port->io);\n    HT_WR16(port->io, WDKEY, KEY_FIRST);\n    HT_EDIS",
        "    HT_WR16(port->io, WDKEY, KEY_FIRST);\n    HT_EDIS", "WDKEY: no EALLOW"),
    "EALLOW left on": (
        F28335, "ht_clock_f28335.c",
        "run ? PCLKCR0_TBCLKSYNC : 0u);\n    HT_EDIS(port->io);",
        "run ? PCLKCR0_TBCLKSYNC : 0u);", "EALLOW was on already"),
    # order
    "counters run during the set-up": (
        F28335, INIT, "run_counters(port, false);", "run_counters(port, true);",
        "the PWM counters run"),
    "outputs before the trip": (
        F28377S, INIT, "    ht_pwm_start(port, setup);\n",
        "    ht_pins_pwm(port);\n    ht_pwm_start(port, setup);\n", "module that is not tripped"),
    "no trip": (
        F28335, "ht_pwm.c", "    HT_WR16(io, base + m->tzfrc, TZ_OST);\n", "",
        "the module is not tripped"),
    "trip does not switch off": (
        F28377S, "ht_pwm.c",
        "    HT_WR16(io, base + m->tzctl, trip_action(port, false));\n", "",
        "trip does not switch off"),
    "trip switches on": (
        F28335, "ht_pwm.c", "low ? TZCTL_BOTH_HIGH : TZCTL_BOTH_LOW",
        "low ? TZCTL_BOTH_LOW : TZCTL_BOTH_HIGH", "trip does not switch off"),
    "dead band for the other polarity": (
        F28377S, "ht_pwm.c", "low ? DBCTL_ACTIVE_LOW : DBCTL_ACTIVE_HIGH",
        "low ? DBCTL_ACTIVE_HIGH : DBCTL_ACTIVE_LOW", "without dead band"),
    "polarity of the other drivers in the board's table": (
        LAUNCHPAD, "ht_board.c", "#ifndef HT_GATES_ACTIVE_LOW\n#define HT_GATES_ACTIVE_LOW 0\n",
        "#if 1\n#undef HT_GATES_ACTIVE_LOW\n#define HT_GATES_ACTIVE_LOW 1\n",
        "trip does not switch off"),
    "no dead band": (
        LAUNCHPAD, "ht_pwm.c",
        "    HT_WR16(io, base + m->dbctl, low ? DBCTL_ACTIVE_LOW : DBCTL_ACTIVE_HIGH);\n", "",
        "without dead band"),
    "no delay of the rise": (
        F28335, "ht_pwm.c", "    HT_WR16(io, base + m->dbred, setup->dead_counts);\n", "",
        "with DBRED or DBFED = 0"),
    "no delay of the fall": (
        F28377S, "ht_pwm.c", "    HT_WR16(io, base + m->dbfed, setup->dead_counts);\n", "",
        "with DBRED or DBFED = 0"),
    "dead time taken away while the drive is set up again": (
        LAUNCHPAD, "ht_pwm.c", "    HT_WR16(io, base + m->dbfed, setup->dead_counts);\n",
        "    HT_WR16(io, base + m->dbfed, 0u);\n"
        "    HT_WR16(io, base + m->dbfed, setup->dead_counts);\n",
        "DBRED or DBFED = 0 at a module with pins"),
    "dead time without a minimum": (
        F28377S, "ht_port_c2000.c", "    range.min_us = port->board->dead_min_us;",
        "    range.min_us = 0.0f;", "dead time is refused"),
    "dead time without the register's maximum": (
        F28335, "ht_port_c2000.c",
        "(float)port->map->dead_max_counts * 1.0e6f / port->map->pwm_clock_Hz", "20.0f",
        "dead time is refused"),
    "divider before the lock": (
        F28335, "ht_clock_f28335.c", "    locked = lock(port);", "    locked = true;",
        "start is reported"),
    "missing-clock detection left on": (
        F28335, "ht_clock_f28335.c", "ht_change16(port->io, PLLSTS, 0u, PLLSTS_MCLKOFF);", "",
        "missing-clock detection on"),
    "PLL selected before the lock": (
        F28377S, "ht_clock_f28377s.c", "(HT_RD32(port->io, SYSPLLSTS) & PLL_LOCKS) == 0u",
        "looks > LOOKS", "PLL selected before it has locked"),
    "PLL stopped while selected": (
        F28377S, "ht_clock_f28377s.c", "(port->io, SYSPLLCTL1, PLLCLKEN, 0u);",
        "(port->io, SYSPLLCTL1, 0u, PLLCLKEN | PLLEN);", "while the PLL is selected"),
    "crystal selected but off": (
        F28377S, "ht_clock_f28377s.c", "    ht_change32(port->io, CLKSRCCTL1, XTALOFF, 0u);",
        "    ht_change32(port->io, CLKSRCCTL1, 0u, XTALOFF);", "crystal selected but off"),
    "flash without its pump": (
        F28377S, "ht_flash.c", "    HT_WR32(port->io, PUMPREQUEST, PUMP_KEY | PUMP_BANK0);\n", "",
        "the flash pump is not bank 0's"),
    "flash pump without the key": (
        F28377S, "ht_flash.c", "#define PUMP_KEY 0x5A5A0000u", "#define PUMP_KEY 0u",
        "0x5A5A is missing"),
    "wait states under the cache": (
        F28377S, "ht_flash.c", "FRD_INTF_CTRL, PREFETCH_AND_CACHE, 0u);",
        "FRD_INTF_CTRL, 0u, PREFETCH_AND_CACHE);", "cache or prefetch on"),
    "pin group after the pin": (
        LAUNCHPAD, "ht_pins.c",
        "    ht_change32(port->io, first + GPYPUD, bit, pull_up ? 0u : bit);",
        "    ht_change32(port->io, half + GPYMUX1, field, (mux & 3u) << shift);\n"
        "    ht_change32(port->io, first + GPYPUD, bit, pull_up ? 0u : bit);",
        "pin group changed under a peripheral"),
    "capture prescaler changed while it runs": (
        F28335, "ht_eqep.c", "eqep + QCAPCTL, QCAPCTL_CCPS_128", "eqep + QCAPCTL, QCAPCTL_CEN",
        "while the capture unit runs"),
    "SCI changed while it runs": (
        F28335, "ht_sci.c", "    HT_WR16(port->io, sci + SCICTL1, 0u);",
        "    HT_WR16(port->io, sci + SCICTL1, SCICTL1_RUN);", "changed while the SCI runs"),
    "ADC not calibrated": (
        F28335, "ht_adc.c", "    HT_CALL(port->io, ADC_CAL);\n", "", "without calibration"),
    "ADC not trimmed": (
        F28377S, "ht_adc.c", "        HT_CALL(port->io, linearity);\n", "",
        "without calibration"),
    "second ADC not trimmed": (
        F28377S, "ht_adc.c", "(adc == ADCA) ? OTP_INL_TRIM_A : OTP_INL_TRIM_B", "OTP_INL_TRIM_A",
        "without calibration"),
    "no Device_cal": (
        LAUNCHPAD, "ht_clock_f28377s.c", CALIBRATED, "", "start is reported"),
    "Device_cal after the clock's measurement": (
        F28377S, "ht_clock_f28377s.c",
        CALIBRATED + MEASURED, MEASURED + CALIBRATED,
        "start is reported"),
    "EALLOW relied on across Device_cal": (
        F28377S, "ht_clock_f28377s.c", CALIBRATED, CALIBRATED.split("\n")[0] + "\n", "no EALLOW"),
    "ADC not settled, F28335": (
        F28335, "ht_adc.c", "    HT_WAIT_US(port->io, POWER_UP_F28335_US);\n", "",
        "the ADC has not settled yet"),
    "ADC not settled, F28377S": (
        F28377S, "ht_adc.c", "    HT_WAIT_US(port->io, POWER_UP_F28377S_US);\n", "",
        "the ADC has not settled yet"),
    # width
    "16 bits of a 32-bit timer register": (
        F28335, "ht_timer.c", "    HT_WR32(port->io, timer + HT_TIMER_PRD, from);",
        "    HT_WR16(port->io, timer + HT_TIMER_PRD, (uint16_t)from);", "TIMER1.PRD: width"),
    "16 bits of a pin register": (
        F28377S, "ht_pins.c", "ht_change32(port->io, first + GPYPUD, bit, pull_up ? 0u : bit);",
        "HT_WR16(port->io, first + GPYPUD, 0u);", "PUD: width"),
    "32 bits of a 16-bit register": (
        F28335, "ht_eqep.c", "    HT_WR16(port->io, eqep + QDECCTL, 0u);",
        "    HT_WR32(port->io, eqep + QDECCTL, 0u);", "QDECCTL: width"),
    # bits and registers
    "reserved bit": (
        F28335, "ht_sci.c", "#define SCICCR_8N1 0x0007u", "#define SCICCR_8N1 0x0107u",
        "SCICCR: reserved bit"),
    "flag instead of force": (
        F28377S, "ht_pwm.c",
        "        HT_WR16(port->io, port->leg[leg] + port->map->tzfrc, TZ_OST);\n    }",
        "        HT_WR16(port->io, port->leg[leg] + port->map->tzflg, TZ_OST);\n    }",
        "TZFLG: read-only"),
    "wrong address": (
        F28335, "ht_watchdog.c", "#define WDCR 0x7029u", "#define WDCR 0x7027u",
        "no such register"),
    # clocks
    "no clock for the PWM": (
        F28335, "ht_clock_f28335.c", "(PCLKCR1_EQEP1 << port->board->eqep) | port->board->modules",
        "PCLKCR1_EQEP1", "EPWM1.TZCTL: no clock"),
    "no clock for one PWM module": (
        F28377S, "ht_board.c", "    .pll_multiplier = 20u,\n    .modules = 0x003Fu,",
        "    .pll_multiplier = 20u,\n    .modules = 0x002Fu,", "EPWM5.TZCTL: no clock"),
    "no clock for the encoder": (
        F28377S, "ht_clock_f28377s.c",
        "ht_change32(port->io, PCLKCR4, 0u, (uint32_t)PCLKCR4_EQEP1 << port->board->eqep);", "",
        "EQEP1.QDECCTL: no clock"),
    "another encoder's clock": (
        LAUNCHPAD, "ht_clock_f28377s.c", "<< port->board->eqep);", "<< 0u);",
        "EQEP3.QDECCTL: no clock"),
    "no clock for the ADC": (
        F28335, "ht_clock_f28335.c", "PCLKCR0_ADC | PCLKCR0_SCIA", "PCLKCR0_SCIA",
        "calibration without ADC clock"),
    "no clock for the SCI": (
        F28377S, "ht_clock_f28377s.c", "ht_change32(port->io, PCLKCR7, 0u, PCLKCR7_SCIA);", "",
        "SCIA.SCICTL1: no clock"),
    "clocks not settled, F28335": (
        F28335, "ht_clock_f28335.c", "    HT_SETTLE(port->io);\n    return", "    return",
        "no clock"),
    "clocks not settled, F28377S": (
        F28377S, "ht_clock_f28377s.c", "    HT_SETTLE(port->io);\n    return", "    return",
        "no clock"),
    # watchdog
    "watchdog off": (
        F28335, "ht_watchdog.c", "#define WDCR_CHECK 0x0028u", "#define WDCR_CHECK 0x0068u",
        "watchdog bites without"),
    "watchdog with the wrong check bits": (
        F28377S, "ht_watchdog.c", "#define WDCR_CHECK 0x0028u", "#define WDCR_CHECK 0x0020u",
        "WDCHK is not 101"),
    "watchdog: first key missing": (
        F28335, "ht_image.c", "    ht_watchdog_first(&ht_image_port);\n    ht_pie_end",
        "    ht_pie_end", "not serviced in time"),
    "watchdog: second key missing": (
        F28377S, "ht_image.c", "    ht_watchdog_second(&ht_image_port);\n", "",
        "not serviced in time"),
    "watchdog: wrong key": (
        F28335, "ht_watchdog.c", "#define KEY_SECOND 0x00AAu", "#define KEY_SECOND 0x00A5u",
        "neither 0x55 nor 0xAA"),
    "lost interrupt not looked for": (
        F28335, "ht_drive_slow.c", "if (tick == d->tick_last)", "if (tick == d->tick_last - 1u)",
        "lost interrupt is named"),
    "lost interrupt's parameters not taken over": (
        F28377S, "ht_drive_faults.c", "        d->staged = NULL;\n    }\n    if (state",
        "    }\n    if (state", "a parameter does not wait for it"),
    "watchdog fed by the slow interrupt alone": (
        F28377S, "ht_image.c", "    ht_pie_end_slow(&ht_image_port);",
        "    ht_watchdog_second(&ht_image_port);\n    ht_pie_end_slow(&ht_image_port);",
        "watchdog bites without the background"),
    "watchdog too short for the start": (
        F28335, "ht_watchdog.c", "    prescale(port, WDPS_LONGEST);", "    prescale(port, 1u);",
        "not serviced in time"),
    "watchdog too short for the slow interrupt": (
        F28377S, "ht_watchdog.c", "#define SLOW_PERIODS 2.5f", "#define SLOW_PERIODS 0.5f",
        "-WD.WDCR"),
    # interrupts
    "fast interrupt not acknowledged at the PIE": (
        F28335, "ht_pie.c",
        "void ht_port_ack_fast(ht_port *port)\n{\n    HT_WR16(port->io, PIEACK, GROUP1);",
        "void ht_port_ack_fast(ht_port *port)\n{\n    (void)port;", "every fast interrupt arrives"),
    "wrong group acknowledged": (
        F28377S, "ht_pie.c", "#define GROUP1 0x0001u", "#define GROUP1 0x0004u",
        "every fast interrupt arrives"),
    "fast interrupt not acknowledged at the ADC": (
        F28335, "ht_adc.c",
        "void ht_port_begin_fast(ht_port *port)\n{\n"
        "    HT_WR16(port->io, port->map->adc_clear, port->map->adc_clear_bit);",
        "void ht_port_begin_fast(ht_port *port)\n{", "every fast interrupt arrives"),
    "fast interrupt not acknowledged at the ADC, F28377S": (
        F28377S, "ht_adc.c",
        "void ht_port_begin_fast(ht_port *port)\n{\n"
        "    HT_WR16(port->io, port->map->adc_clear, port->map->adc_clear_bit);",
        "void ht_port_begin_fast(ht_port *port)\n{", "drive runs"),
    "ADC's interrupts may stop": (
        F28377S, "ht_adc.c", "INT1CONT | INT1E", "INT1E", "-ADCA.ADCINTSEL1N2"),
    "ADC's overflow not looked at": (
        F28377S, "ht_adc.c", "(HT_RD16(port->io, ADCA + ADCINTOVF) & ADCINT1) != 0u",
        "port->map->adc_sequencer", "no overflow is left"),
    "no NOP between PIEACK and EINT": (
        F28335, "ht_pie.c",
        "    HT_NOP(port->io);\n", "", "EINT right after PIEACK"),
    "sequencer not reset": (
        F28335, "ht_adc.c",
        "        HT_WR16(port->io, ADCTRL2, ADCTRL2_RUN | ADCTRL2_RST_SEQ1);\n    } else",
        "    } else", "sequencer started at its end"),
    "no interrupt from the ADC": (
        F28335, "ht_adc.c", "#define ADCTRL2_INT_ENA_SEQ1 0x0800u",
        "#define ADCTRL2_INT_ENA_SEQ1 0u", "every fast interrupt arrives"),
    "interrupt before the last channel": (
        F28377S, "ht_adc.c", "(CONVERSIONS_A - 1u)", "(CONVERSIONS_A - 2u)",
        "every fast interrupt arrives"),
    "ADC started by another module": (
        F28377S, "ht_adc.c", "((uint32_t)5u << 20)", "((uint32_t)7u << 20)",
        "every fast interrupt arrives"),
    "one channel too few": (
        F28335, "ht_adc.c",
        "ADCMAXCONV, CONVERSIONS_F28335 - 1u", "ADCMAXCONV, CONVERSIONS_F28335 - 2u",
        "every fast interrupt arrives"),
    "second ADC without its start": (
        LAUNCHPAD, "ht_adc.c", "    convert_f28377s(port, ADCB, 1u, CONVERSIONS_B);\n", "",
        "every fast interrupt arrives"),
    "no start of conversion": (
        LAUNCHPAD, "ht_pwm.c", "#define ETSEL_SOCA_CTR0 0x0900u",
        "#define ETSEL_SOCA_CTR0 0x0100u", "every fast interrupt arrives"),
    "time base without its module": (
        LAUNCHPAD, "ht_pwm.c", "if (!master_is_a_leg)", "if (master_is_a_leg)",
        "every fast interrupt arrives"),
    "timer stopped": (
        F28335, "ht_timer.c", "HT_TIMER0 + HT_TCR, TCR_INTERRUPT);",
        "HT_TIMER0 + HT_TCR, TCR_INTERRUPT | TCR_STOP);", "slow interrupt is taken"),
    "timer without interrupt": (
        F28377S, "ht_timer.c", "    HT_WR16(port->io, HT_TIMER0 + HT_TCR, TCR_INTERRUPT);",
        "    HT_WR16(port->io, HT_TIMER0 + HT_TCR, 0u);", "slow interrupt is taken"),
    "slow interrupt lets nothing in": (
        F28335, "ht_pie.c", "cleared it on the way in */\n    HT_EINT(port->io);",
        "cleared it on the way in */", "a fast interrupt comes within a slow one"),
    "slow interrupt forgets IER": (
        F28377S, "ht_pie.c",
        "    HT_IER_SET(port->io, GROUP1); /* the CPU cleared it on the way in */\n", "",
        "a fast interrupt comes within a slow one"),
    "slow interrupt does not acknowledge": (
        F28335, "ht_pie.c", "PIEIER1, FAST);\n    HT_WR16(port->io, PIEACK, GROUP1);",
        "PIEIER1, FAST);", "interrupt"),
    "slow interrupt does not enable itself again": (
        F28335, "ht_pie.c", "    HT_DINT(port->io);\n    HT_WR16(port->io, PIEIER1, FAST | SLOW);",
        "    HT_DINT(port->io);", "slow interrupt arrives"),
    "slow interrupt within itself": (
        F28377S, "ht_pie.c", "    HT_WR16(port->io, PIEIER1, FAST);\n",
        "    HT_WR16(port->io, PIEIER1, FAST | SLOW);\n", "slow interrupt waits for itself"),
    "vectors exchanged": (
        F28335, "ht_image.c", "isrs = {fast, slow, lost", "isrs = {slow, fast, lost", "interrupt"),
    "interrupts never enabled": (
        F28377S, "ht_image.c", "    ht_pie_enable(&ht_image_port);\n", "",
        "interrupts are let through"),
    # start and memory
    "code not copied": (
        F28335, "main.c",
        "    copy(ht_code_run, ht_code_load, (uint32_t)(uintptr_t)ht_code_size);\n", "",
        "code is copied"),
    "constants not copied": (
        F28377S, "main.c",
        "    copy(ht_const_run, ht_const_load, (uint32_t)(uintptr_t)ht_const_size);\n", "",
        "constants are copied"),
    "one word too many copied": (
        F28335, "main.c", "for (n = 0u; n < words; n++)", "for (n = 0u; n <= words; n++)",
        "no more than that is copied"),
    # values that no rule forbids: the golden image
    "flash wait states forgotten": (F28335, INIT, "    ht_flash_start(port);", "    ", "-FLASH"),
    "trip pin not listened to": (
        F28335, "ht_pwm.c", "    HT_WR16(io, base + m->tzsel, m->one_shot);\n", "",
        "trip pin switches off by itself"),
    "emulation stop not listened to": (
        F28377S, "ht_pwm.c", "base + m->tzsel, m->one_shot", "base + m->tzsel, 0x1100u",
        "an emulation stop switches off"),
    "clock failure not listened to": (
        LAUNCHPAD, "ht_pwm.c", "base + m->tzsel, m->one_shot", "base + m->tzsel, 0x2100u",
        "a clock failure switches off"),
    "gates on without a look at the trip pin": (
        F28335, "ht_pwm.c", "bool allowed = !ht_port_trip_pin_low(port);", "bool allowed = true;",
        "trip cleared while its pin is low"),
    "start without a look at the trip pin": (
        F28377S, "ht_drive_commands.c",
        "    int leg;\n    if (ht_port_trip_pin_low(d->port)) {\n        return",
        "    int leg;\n    if (d == NULL) {\n        return", "a low trip pin refuses"),
    "clear without a look at the trip pin": (
        F28335, "ht_drive_commands.c",
        "    if (ht_port_trip_pin_low(d->port)) {\n        return HT_ERROR_TRIP;\n    }\n"
        "    if ((d->state != (uint16_t)HT_STATE_FAULT)",
        "    if ((d->state != (uint16_t)HT_STATE_FAULT)",
        "a low trip pin refuses"),
    "calibration without a look at the trip pin": (
        LAUNCHPAD, "ht_drive.c",
        "    if (ht_port_trip_pin_low(d->port)) { /* before the gates ever come on */",
        "    if (d->state_ticks == 0u) {", "a low trip pin is the fault"),
    "gates on refused and not heeded": (
        F28377S, "ht_drive.c",
        "    return (d->state_ticks == 1u) && !ht_port_gates_on(d->port, used_legs(d));",
        "    return (d->state_ticks == 1u) && !ht_port_gates_on(d->port, used_legs(d)) && false;",
        "a low trip pin is the fault"),
    "level of another pin": (
        F28377S, "ht_pwm.c", "uint32_t gpio = port->board->trip.gpio;",
        "uint32_t gpio = port->board->trip.gpio + 1u;", "start is accepted"),
    "one leg's flag for all": (
        F28335, "ht_pwm.c",
        "HT_RD16(port->io, port->leg[leg] + port->map->tzflg) & TZ_OST",
        "HT_RD16(port->io, port->leg[leg & 0u] + port->map->tzflg) & TZ_OST",
        "one leg's trip is noticed"),
    "trip pin synchronised": (
        F28335, "ht_pins.c", "set_up(port, &board->trip, QUALIFY_ASYNC, false)",
        "set_up(port, &board->trip, QUALIFY_SYNC, false)", "-GPIO.GPAQSEL1"),
    "trip pin pulled up": (
        F28377S, "ht_pins.c", "set_up(port, &board->trip, QUALIFY_ASYNC, false)",
        "set_up(port, &board->trip, QUALIFY_ASYNC, true)", "pull-ups: 12 20"),
    "trip pin not connected": (
        F28377S, "ht_pins.c",
        "        HT_WR16(port->io, port->map->trip_select, board->trip.gpio);\n", "", "-INPUTXBAR"),
    "two channels exchanged": (
        F28377S, "ht_board.c", ".encoder_index = {23u, 1u},\n    .receive = {28u, 1u},\n"
        "    .transmit = {29u, 1u},\n    .channel = {2u, 2u, 3u, 3u, 4u",
        ".encoder_index = {23u, 1u},\n    .receive = {28u, 1u},\n"
        "    .transmit = {29u, 1u},\n    .channel = {3u, 2u, 2u, 3u, 4u",
        "+ADCA.ADCSOC0CTL         0x07410  0x00518013"),
    "two legs exchanged": (
        LAUNCHPAD, "ht_board.c", "{2u, 1u}, {3u, 1u}, {10u, 1u}", "{3u, 1u}, {4u, 1u}, {10u, 1u}",
        "GPIO"),
    "clock halved in the module": (
        F28335, "ht_pwm.c", "#define TBCTL_FREE_RUN 0x8000u", "#define TBCTL_FREE_RUN 0x8080u",
        "HSPCLKDIV=1"),
    "wrong multiplier": (
        LAUNCHPAD, "ht_board.c", ".pll_multiplier = 40u", ".pll_multiplier = 20u", "IMULT=20"),
    "dead-man timer not started": (
        F28335, INIT, "    ht_dead_man_start(port, setup->period_counts);\n", "",
        "gates are off after three fast periods"),
    "dead-man timer not started, F28377S": (
        F28377S, INIT, "    ht_dead_man_start(port, setup->period_counts);\n", "",
        "gates are off after three fast periods"),
    "dead-man timer not wound": (
        F28335, "ht_adc.c", "    ht_dead_man_wind(port);\n", "", "drive runs"),
    "dead-man timer not wound, F28377S": (
        LAUNCHPAD, "ht_adc.c", "    ht_dead_man_wind(port);\n", "", "drive runs"),
    "dead-man timer too short": (
        F28377S, "ht_dead_man.c", "#define PERIODS 2.5f", "#define PERIODS 1.5f",
        "gates are on after two fast periods"),
    "dead-man timer too long": (
        F28335, "ht_dead_man.c", "#define PERIODS 2.5f", "#define PERIODS 3.5f",
        "gates are off after three fast periods"),
    "INT13 not let through": (
        F28335, "ht_pie.c", "HT_IER_WRITE(port->io, GROUP1 | INT13)",
        "HT_IER_WRITE(port->io, GROUP1)", "gates are off after three fast periods"),
    "INT13 taken for another": (
        F28335, "ht_pie.c", "#define VECTOR_INT13 13u", "#define VECTOR_INT13 14u",
        "VECTOR13"),
    "X-BAR closed": (
        F28377S, "ht_dead_man.c", "    HT_WR32(io, TRIP4MUXENABLE, MUX0);\n", "",
        "gates are off after three fast periods"),
    "digital compare is no one-shot trip": (
        F28377S, "ht_pwm.c", "m->one_shot);", "(uint16_t)(m->one_shot & 0x3FFFu));",
        "gates are off after three fast periods"),
    "digital compare floats the output": (
        LAUNCHPAD, "ht_pwm.c", "low ? TZCTL_DCAEVT1_HIGH : TZCTL_DCAEVT1_LOW", "0u",
        "digital compare does not switch off"),
    "comparators not started": (
        F28377S, INIT, "    ht_cmpss_start(port);\n", "", "-CMPSS1.COMPCTL"),
    "low comparators not inverted": (
        LAUNCHPAD, "ht_cmpss.c", "CTRIPLSEL_FILTER | COMPLINV |", "CTRIPLSEL_FILTER |",
        "+CMPSS1.COMPCTL"),
    "comparators' filter left out": (
        F28377S, "ht_cmpss.c", "#define CTRIPHSEL_FILTER 0x0008u", "#define CTRIPHSEL_FILTER 0u",
        "+CMPSS1.COMPCTL"),
    "comparator of another pin": (
        F28377S, "ht_board.c", "positive_a[SUBSYSTEMS] = {2u, 4u,",
        "positive_a[SUBSYSTEMS] = {2u, 5u,",
        "TRIP5MUX0TO15CFG"),
    "dc link's comparator not heard": (
        F28377S, "ht_cmpss.c",
        "channel < (uint16_t)HT_ADC_CHANNELS; channel++) {\n"
        "        uint16_t number = ht_board_cmpss(port->board, channel);\n"
        "        if (number != 0u) {\n            uint32_t multiplexer",
        "channel < (uint16_t)HT_LEGS; channel++) {\n"
        "        uint16_t number = ht_board_cmpss(port->board, channel);\n"
        "        if (number != 0u) {\n            uint32_t multiplexer",
        "+EPWMXBAR.TRIP5MUXENABLE"),
    "dc link's low comparator heard": (
        LAUNCHPAD, "ht_cmpss.c", "return channel != (uint16_t)HT_ADC_VDC;", "return channel < 8u;",
        "+EPWMXBAR.TRIP5MUX0TO15CFG"),
    "levels by the ADC's reference": (
        F28377S, "ht_board.c", "(3.0f / 3.3f)", "1.0f", "+CMPSS1.DACHVALS"),
    "comparators float the output": (
        LAUNCHPAD, "ht_pwm.c", "low ? TZCTL_DCBEVT1_HIGH : TZCTL_DCBEVT1_LOW", "0u",
        "comparators do not switch off"),
    "expired timer not forgotten": (
        F28335, "ht_pwm.c", "        ht_dead_man_forget(port);\n", "",
        "the next trip has its own cause"),
    "parity": (
        F28377S, "ht_sci.c", "#define SCICCR_8N1 0x0007u", "#define SCICCR_8N1 0x0027u",
        "PARITYENA=1"),
}  # fmt: skip


#: What is planted in the chip's clock; "late": right at the second try.
CLOCKS = ("wrong", "never", "missing", "late")


@pytest.mark.parametrize("planted", CLOCKS)
@pytest.mark.parametrize("board", image.BOARDS)
def test_image_of_a_board_with_a_wrong_clock(builder, board, planted):
    """The gates' pins stay inputs, the fault is latched and told over the line at 115200 baud,
    and no watchdog starts all over again."""
    good, lines = image.run(builder.build(board), planted)
    assert not image.complaints(lines)
    assert good


@pytest.mark.parametrize("board", image.BOARDS)
def test_restart_without_a_reset_takes_the_gates_off_first(builder, board):
    """A debugger halts the chip while the drive runs and starts the image at its entry. The gates
    are off before the start waits for anything, changes the clock or stops the counters."""
    good, lines = image.run(builder.build(board), "restart")
    assert not image.complaints(lines)
    assert good


@pytest.mark.parametrize("board", image.BOARDS)
def test_restart_that_leaves_the_gates_on_is_found(builder, board):
    change = (INIT, "    ht_pins_release(port); /* a debugger", "    /* a debugger")
    _, lines = image.run(builder.build(board, change), "restart")
    assert any("with a gate on" in line for line in image.complaints(lines))


NO_FLAG, POWER, PIN, DOG, NMI, OTHER = range(6)
#: Flags as the boot ROM hands them over, and the cause: WDFLAG, and the bits of RESC. A watchdog's
#: reset pulls the pin as well.
CAUSES = {
    F28335: ((0x00, NO_FLAG), (0x80, DOG)),
    F28377S: (
        (0x00, NO_FLAG), (0x03, POWER), (0x01, POWER), (0x02, PIN), (0x06, DOG), (0x04, DOG),
        (0x0A, NMI), (0x08, NMI), (0x0E, NMI), (0x07, DOG), (0x42, OTHER), (0x20, OTHER),
        (0x100, OTHER), (0x10, NO_FLAG), (0x80, NO_FLAG),
    ),
}  # fmt: skip
STARTS = [(chip, *row) for chip, rows in CAUSES.items() for row in rows]


def tells(program, *words):
    _, lines = image.run(program, "reset", *map(str, words))
    return image.complaints(lines)


@pytest.mark.parametrize(("board", "flags", "cause"), STARTS)
def test_start_tells_what_has_reset_the_chip(builder, board, flags, cause):
    """And how often a watchdog did so, as far as the memory still knows it: power-on leaves
    anything there, or zeros, and its flag says so as well."""
    program = builder.build(board)
    dog = cause in (DOG, NMI)
    for kept in (-2, -1, 0, 6, 65534, 65535):
        count = 0 if kept < 0 or cause == POWER else kept
        assert not tells(program, flags, kept, cause, min(count + dog, 65535))


#: A mistake, the flags and the count that show it.
RESET_FAULTS = {
    "flag not cleared, F28335": (
        F28335, "ht_watchdog.c", "prescale(port, WDCR_FLAG | WDPS_LONGEST)",
        "prescale(port, WDPS_LONGEST)", (0x80, 0, DOG, 1)),
    "flag not cleared, F28377S": (
        F28377S, "ht_watchdog.c", "    HT_WR32(port->io, at, flags);\n", "", (4, 0, DOG, 1)),
    "the pin before the watchdog": (
        F28377S, "ht_watchdog.c", "#define RESC_WATCHDOG 0x00000004u",
        "#define RESC_WATCHDOG 0x00000010u", (6, 0, DOG, 1)),
    "not read": (
        F28377S, "ht_port_c2000.c", "port->reset_cause = ht_watchdog_cause(port);",
        "(void)ht_watchdog_cause(port);", (8, 0, NMI, 1)),
    "not counted": (
        F28335, "ht_reset.c", "        count++;\n", "", (0x80, 3, DOG, 4)),
    "count of a damaged memory": (
        F28335, "ht_reset.c", "((m->word ^ m->inverse) == 0xFFFFFFFFu)",
        "(m->inverse != 1u)", (0, -2, NO_FLAG, 0)),
    "not told": (
        F28377S, "ht_image.c", "link.reset = &reset;", "link.reset = (const ht_reset *)0;",
        (2, 0, PIN, 0)),
}  # fmt: skip


@pytest.mark.parametrize("fault", RESET_FAULTS)
def test_a_reset_that_is_not_told_right_is_found(builder, fault):
    board, source, old, new, words = RESET_FAULTS[fault]
    assert tells(builder.build(board, (source, old, new)), *words)


#: Source, text, replacement, what is planted in the chip, what a complaint says.
CLOCK_FAULTS = {
    "not measured, F28335": (
        F28335, "ht_clock_f28335.c", "frequency_is_right(port) ?", "true ?", "wrong",
        "start says why"),
    "not measured, F28377S": (
        F28377S, "ht_clock_f28377s.c", "|| !frequency_is_right(port)", "", "wrong",
        "start says why"),
    "not tried again": (
        LAUNCHPAD, "ht_clock_f28377s.c", "#define TRIES 5u", "#define TRIES 1u", "late",
        "start is reported"),
    "missing crystal not looked for": (
        F28377S, "ht_clock_f28377s.c", "return missing(port) ? HT_CLOCK_MISSING : clock;",
        "return (clock == HT_CLOCK_MISSING) ? HT_CLOCK_RIGHT : clock;", "missing",
        "start says why"),
    "PWM set up all the same": (
        F28377S, "ht_port_c2000.c", "if (port->clock != HT_CLOCK_RIGHT) {\n        return true;",
        "if (port->clock == HT_CLOCK_NO_LOCK) {\n        return true;", "wrong",
        "no pin is the PWM's"),
    "watchdog left alone": (
        F28335, "ht_image.c",
        "HT_FAULT_CLOCK);\n    ht_watchdog_first(&ht_image_port);",
        "HT_FAULT_CLOCK);", "never", "no resets for ever"),
    "fault that can be cleared": (
        F28335, "ht_drive_commands.c", "(d->faults & (uint32_t)HT_FAULT_CLOCK) != 0u",
        "d->faults > 0xFFFEu", "wrong", "clear is refused"),
    "line at the usual rate": (
        F28377S, "ht_port_c2000.c", "ht_sci_start(port, EMERGENCY_BAUD)",
        "ht_sci_start(port, 9600u)", "wrong", "line runs at 115200 baud"),
}  # fmt: skip


def test_each_mistake_has_its_place_in_the_source():
    """The quick tests make only some of them: a text that has changed is found at once."""
    for name, (_, source, old, *_) in (FAULTS | CLOCK_FAULTS).items():
        (path,) = (image.ROOT / "firmware").rglob(source)
        assert path.read_text().count(old) == 1, name


@pytest.mark.parametrize("fault", CLOCK_FAULTS)
def test_mistakes_in_the_clocks_set_up_are_found(builder, fault):
    board, source, old, new, planted, said = CLOCK_FAULTS[fault]
    _, lines = image.run(builder.build(board, (source, old, new)), planted)
    found = image.complaints(lines)
    assert any(said in line for line in found), "\n".join(found) or "nothing found"


@pytest.mark.parametrize("fault", part(list(FAULTS), 18))
def test_fault_is_found(builder, fault):
    board, source, old, new, said = FAULTS[fault]
    _, lines = image.run(builder.build(board, (source, old, new)))
    found = [*image.complaints(lines), *difference(board, lines)]
    assert any(said in line for line in found), "\n".join(found) or "nothing found"


@pytest.mark.parametrize("board", image.BOARDS)
def test_image_for_gate_drivers_that_invert(builder, board):
    """The whole run is in order, and what the start leaves differs in nothing but this: the
    dead band inverts output A in place of B, a trip forces both outputs high, the dead-man timer's
    event output A, the comparators' output B, and the pins have pull-ups while they are inputs."""
    good, lines = image.run(builder.build(board, active_low=True))
    assert not image.complaints(lines)
    assert good
    changed = [
        line for line in difference(board, lines) if not line.startswith(("---", "+++", "@@"))
    ]
    kinds = {line.split()[0][1:].split(".")[1] for line in changed}
    assert kinds == {"DBCTL", "TZCTL", "GPAPUD"}
    found = {(line[0], *line.split()[2:]) for line in changed if "TZCTL" in line or "DBCTL" in line}
    event = board != F28335
    low, high = (
        (("0x022A", "DCBEVT1=2", "DCAEVT1=2"), ("0x0115", "DCBEVT1=1", "DCAEVT1=1"))
        if event
        else (("0x000A",), ("0x0005",))
    )
    assert found == {
        ("-", *low, "TZB=2", "TZA=2"), ("+", *high, "TZB=1", "TZA=1"),
        ("-", "0x000B", "POLSEL=2", "OUT_MODE=3"), ("+", "0x0007", "POLSEL=1", "OUT_MODE=3"),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("source", "old", "new", "said"),
    (
        ("ht_pwm.c", "low ? TZCTL_BOTH_HIGH : TZCTL_BOTH_LOW", "TZCTL_BOTH_LOW",
         "trip does not switch off"),
        ("ht_pwm.c", "low ? DBCTL_ACTIVE_LOW : DBCTL_ACTIVE_HIGH", "DBCTL_ACTIVE_HIGH",
         "without dead band"),
    ),
)  # fmt: skip
def test_a_missing_polarity_setting_is_found(builder, source, old, new, said):
    _, lines = image.run(builder.build(F28335, (source, old, new), active_low=True))
    assert any(said in line for line in image.complaints(lines))


def test_change_that_does_not_fit_is_refused(builder):
    with pytest.raises(ValueError, match="0 times"):
        builder.build(F28335, ("ht_pwm.c", "not there", ""))
