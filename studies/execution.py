"""How the execution of cases ends when the engine neither answers nor refuses."""

CRASHED, TIMED_OUT, OUT_OF_MEMORY = "crashed", "timed out", "out of memory"


class CaseEnded(Exception):
    """The process that ran one case died or was killed: a row of this ``status``, for this ``reason``."""

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(status, reason)
        self.status, self.reason = status, reason


class RunBroken(Exception):
    """No case can go on; the message says why. What was finished is kept."""
