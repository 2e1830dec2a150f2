"""The host's end of the serial link: `drive.Drive` for scripts, `devices.find` for boards.

The wire is defined by docs/protocol.md. What a board can do (parameters, channels, faults,
states) is what the board's own dictionary says, never the firmware compiled into this package.
"""

#: Of the images for the F28377S and the F28335.
BAUDS = (1_250_000, 937_500)


class LinkError(RuntimeError):
    """The link failed or the board refused; the text says which and what is allowed.

    `status` is the board's answer (docs/protocol.md), or None if it gave none; `mistake`
    says that the request itself was wrong, whatever the board's state.
    """

    def __init__(self, text: str, status: int | None = None, mistake: bool = False) -> None:
        super().__init__(text)
        self.status = status
        self.mistake = mistake
        #: For the metadata of a recording that this has ended; "" if it is nothing special.
        self.ended = ""
