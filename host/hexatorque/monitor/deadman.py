"""The dead man of the pages. It tells when a drive that a page has started must be stopped, because
nobody watches it.

It knows no thread and no clock. All times are seconds of one clock of the caller.
"""

from __future__ import annotations

import math

#: A drive that was started here is stopped if no page has answered for this long. Together with
#: the time that STOP takes, this is less than 2 s.
SILENT_S = 1.5
#: The drive is also stopped if all pages that answer have been hidden for this long.
HIDDEN_S = 10.0
#: After START the board's state changes within this time.
START_S = 0.5


class DeadMan:
    """`started` when a page starts the drive, `answered` when a page answers, `reason` again and
    again."""

    def __init__(self, silent_s: float = SILENT_S, hidden_s: float = HIDDEN_S) -> None:
        self.silent_s, self.hidden_s = silent_s, hidden_s
        self._started_s: float | None = None  # when the drive was started here
        # When the frame was sent that was answered last: by any page, and by a visible page.
        self._answered_s = self._visible_s = -math.inf

    @property
    def watches(self) -> bool:
        """Whether the drive was started here."""
        return self._started_s is not None

    def started(self, now_s: float) -> None:
        self._started_s = now_s

    def ended(self) -> None:
        """The drive is off. Its next start may come from somebody else."""
        self._started_s = None

    def answered(self, sent_s: float, visible: bool) -> None:
        """A page has shown the frame that was sent at `sent_s`."""
        self._answered_s = max(self._answered_s, sent_s)
        if visible:
            self._visible_s = max(self._visible_s, sent_s)

    def reason(self, now_s: float, working: bool, pages: bool) -> str:
        """Why the drive has to be stopped now, or empty. working: the gates may be on; pages: there
        are some."""
        started_s = self._started_s
        if started_s is None:
            return ""
        if not working:
            # The drive has stopped. Its next start may come from another client, so forget ours;
            # but wait first, since our own START takes time to show.
            if now_s - started_s > START_S:
                self.ended()
            return ""
        # START came from a page, so it counts as an answer of a visible page.
        if now_s - max(self._answered_s, started_s) > self.silent_s:
            if pages:
                return f"no page answered for {self.silent_s:g} s (the browser did not run)"
            return "no page was open"
        if now_s - max(self._visible_s, started_s) > self.hidden_s:
            return f"all pages were hidden for {self.hidden_s:g} s"
        return ""

    def stops_in_s(self, now_s: float) -> float | None:
        """Seconds until a drive at work is stopped because all pages are hidden; None if it is not
        going to be."""
        started_s = self._started_s
        if started_s is None:
            return None
        hidden_for_s = now_s - max(self._visible_s, started_s)
        return max(0.0, self.hidden_s - hidden_for_s) if hidden_for_s > self.silent_s else None
