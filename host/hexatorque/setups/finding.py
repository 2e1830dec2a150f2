"""What a review finds."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

#: Verdicts with which a scheme is not ready, the worse one first.
NOT_READY = ("bad", "doubtful")


@dataclass(frozen=True)
class Finding:
    subject: str
    value: float
    sign: str  #: "<=" or ">=": what the value must be against the limit; "" without a limit
    limit: float
    unit: str
    verdict: str  #: "ok", "note", "doubtful" or "bad"
    advice: str  #: what to change; empty if there is nothing to change
    scheme: str = ""  #: of one scheme only
    where: str = ""  #: of another machine only, in the range of an estimate
    runs: str = ""  #: where an estimate decides: with which value the scheme runs

    @property
    def stops(self) -> bool:
        """Whether the drive cannot run with the values of the set-up."""
        return self.verdict in NOT_READY and not self.where

    @property
    def what(self) -> str:
        return f"{self.subject}, with {self.where}" if self.where else self.subject

    def as_json(self) -> dict[str, Any]:
        return asdict(self)
