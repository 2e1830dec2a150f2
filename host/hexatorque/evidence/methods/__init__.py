"""Methods compared at equal switching frequency. Neither paper makes these comparisons.

At equal sampling frequency, a scheme that switches twice as often looks better than it is. Here
every method chooses its sampling frequency and its bands freely, by the same search, and is judged
by its best setting within the same limit of switching frequency.

fsw: the firmware's schemes on the papers' machines, at 20 points; references: also what an expert
would use instead, on four machines, with torque steps, sags and wrong parameters.

methods: what is compared, and what is free in each; places: machines and operating points; bench:
how a setting is measured; search: the settings that are tried, kept in files; steps: torque step,
reversal, load step, sag; errors: wrong parameters; variants: schemes at a fixed sampling frequency;
dynamics, robustness: studies of their steps and errors; carrier: the analytic line of carrier
modulation; judging: best settings, and sentences that follow from them; pictures: the fronts.
"""
