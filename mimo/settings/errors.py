"""The one base of all faults whose message is a sentence for people."""


class Fault(Exception):  # noqa: N818
    """Something a person can mend; the message says what is wrong, where, and what to do."""
