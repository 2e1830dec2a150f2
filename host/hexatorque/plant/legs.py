"""States of a leg of the inverter, and what can be broken in it."""

LOW, HIGH, OFF = 0, 1, 2
#: Devices of a leg, and the kind of each as the set-up names it.
UPPER_SWITCH, UPPER_DIODE, LOWER_SWITCH, LOWER_DIODE = range(4)
DEVICE_KINDS = ("switch", "diode", "switch", "diode")
#: Conduction drops of switches and diodes, as the set-up's section [inverter] names them.
DROPS = ("v_switch_V", "v_diode_V", "r_switch_ohm", "r_diode_ohm")

#: What is broken, by number: nothing; winding, cable or fuse, so that no current flows; both
#: switches stay off and their diodes remain; the upper or the lower switch alone stays off.
KINDS = ("none", "open", "blocked", "upper", "lower")
WHOLE, OPEN, BLOCKED, UPPER, LOWER = range(5)

#: An edge with the state BREAK + kind breaks its leg, or mends it.
BREAK = 3
#: Most breaks that may be to come.
MAX_BREAKS = 30  # those of all legs, while their contacts bounce

#: A contact that bounces closes, opens, closes and opens again, at these parts of the time for
#: which it bounces: each interval is half of the one before, the last two are alike.
BOUNCE = ((0.5, "none"), (0.75, "open"), (0.875, "none"), (1.0, "open"))
