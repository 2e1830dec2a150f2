"""The host's end of the serial link: `drive.Drive` for scripts, `devices.find` for boards.

The wire is defined by docs/protocol.md. What a board can do (parameters, channels, faults,
states) is what the board's own dictionary says, never the firmware compiled into this package.
"""

from ..errors import HexatorqueError

#: Of the images for the F28377S and the F28335; of both when their clock is wrong.
BAUDS = (1_250_000, 937_500, 115_200)
#: In the metadata of a recording that a reset of the board has ended.
BOARD_RESET = "board reset"
#: What a reset does to the parameters; STATUS says which of the two it was.
RESET_VALUES = "its parameters are at their saved or initial values"


class LinkError(HexatorqueError, RuntimeError):
    """The link failed or the board refused; the text says which and what is allowed.

    `status` is the board's answer (docs/protocol.md), or None if it gave none; `mistake`
    says that the request itself was wrong, whatever the board's state; `ended` is what a
    recording that this error ends has in its metadata, "" for the text.
    """

    def __init__(
        self, text: str, status: int | None = None, mistake: bool = False, ended: str = ""
    ) -> None:
        super().__init__(text)
        self.status = status
        self.mistake = mistake
        self.ended = ended
        self.exit_code = 2 if mistake else 1
