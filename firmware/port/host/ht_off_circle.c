#include "ht_off_circle.h"

#include "ht_configure.h"

#include <math.h>
#include <string.h>

float ht_off_circle(const ht_port *port, const ht_params *p, ht_ab psi_Wb, ht_ab i_A)
{
    ht_drive_config config;
    ht_protect_state state;
    ht_control_state control;
    memset(&config, 0, sizeof config);
    memset(&state, 0, sizeof state);
    memset(&control, 0, sizeof control);
    config.params = *p;
    ht_configure_rest(port, &config);
    config.protect.flux_gain = 1.0f;
    config.protect.magnetise_A_Wb = 0.0f;
    control.estimate.psi_Wb = psi_Wb;
    control.observer.i_A = i_A;
    (void)ht_protect_slow(&config.protect, &state, &control, 0.0f);
    return sqrtf(state.circle2);
}
