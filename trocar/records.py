"""State with named fields that is hashed, saved and restored as one vector.

    from trocar import Controller
    from trocar.records import Record, array, flag, number

    class PdState(Record):
        goal = number()       # rad
        torque = array(1)     # N m, a view that is written in place
        holds = flag()

A `trocar.Controller` declares its records once, by `keep`, and needs no `state_hash`, `save`, `restore` and
`close` of its own.
"""

from hub.participant.state import Record, array, choice, flag, integer, number

__all__ = ["Record", "array", "choice", "flag", "integer", "number"]
