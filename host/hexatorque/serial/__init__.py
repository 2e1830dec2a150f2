"""The host's end of the serial link. docs/protocol.md defines the protocol.

`devices.find` finds boards, and `drive.board.BoardDrive` is the interface for scripts. Parameters,
channels, faults and states always come from the board's own dictionary, never from the firmware
that is compiled into this package.
"""

from ..errors import HexatorqueError, InputError

#: Baud rates of the images for the F28377S and the F28335, and of both if their clock is missing.
BAUDS = (1_250_000, 937_500, 115_200)
#: The metadata `ended` of a recording that was ended by a reset of the board.
BOARD_RESET = "board reset"
#: The parameters after a reset. STATUS says which of the two applies.
RESET_VALUES = "its parameters are at their saved or initial values"


class LinkError(HexatorqueError, RuntimeError):
    """The link failed, or the board refused a request. The text says why and what is allowed.

    status: the status of the board's reply (docs/protocol.md), None without a reply;
    mistake: the request itself was wrong, in whatever state the board is;
    ended: the metadata `ended` of a recording that this error ends, "" for the error's text.
    """

    def __init__(
        self, text: str, status: int | None = None, mistake: bool = False, ended: str = ""
    ) -> None:
        super().__init__(text)
        self.status = status
        self.mistake = mistake
        self.ended = ended
        self.exit_code = 2 if mistake else 1


class LinkInputError(LinkError, InputError):
    """A name or a value in a request to a board is wrong. The text has the nearest name, or the
    allowed range."""

    def __init__(self, text: str, status: int | None = None) -> None:
        super().__init__(text, status, mistake=True)
