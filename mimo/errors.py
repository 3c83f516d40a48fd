"""The one base of all faults whose message is a sentence for people."""


class Fault(Exception):
    """Something a person can mend; the message says what is wrong, where, and what to do."""
