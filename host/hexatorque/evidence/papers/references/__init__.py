"""The comparison a reviewer would ask for: the table schemes, our law, and what an expert would use
instead, on four machines, at equal switching frequency, every method tuned by the same search with
the same budget.

methods: what is compared, and what is free in each; places: machines and operating points; search:
the settings that are tried, kept in files; steps: torque step, reversal, sag; errors: wrong
parameters; judging: best settings and sentences; comparison: the figure; pictures: the fronts.
"""
