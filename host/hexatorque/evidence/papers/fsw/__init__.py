"""All schemes at equal switching frequency. Neither paper makes this comparison.

At equal sampling frequency, a scheme that switches twice as often looks better than it is. Here
every scheme chooses its sampling frequency and its bands freely, at 20 operating points, and is
judged by its best setting within the same limit of switching frequency.

points: the operating points; search: the settings that are tried; bench: how a setting is measured;
carrier: the analytic line of carrier modulation; comparison: best settings and verdicts;
pictures: the fronts.
"""
