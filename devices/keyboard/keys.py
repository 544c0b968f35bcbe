"""The keys and their commands."""

from __future__ import annotations

from collections.abc import Collection

from devices.keyboard.virtual_stylus import NOTHING, Wish

__all__ = ["KEYS", "wish_of"]

KEYS: dict[str, tuple[str, Wish]] = {
    "w": ("ahead", Wish(linear=(1.0, 0.0, 0.0))),
    "s": ("back", Wish(linear=(-1.0, 0.0, 0.0))),
    "a": ("left", Wish(linear=(0.0, 1.0, 0.0))),
    "d": ("right", Wish(linear=(0.0, -1.0, 0.0))),
    "r": ("up", Wish(linear=(0.0, 0.0, 1.0))),
    "f": ("down", Wish(linear=(0.0, 0.0, -1.0))),
    "up": ("point up", Wish(turn=(0.0, -1.0, 0.0))),
    "down": ("point down", Wish(turn=(0.0, 1.0, 0.0))),
    "left": ("point left", Wish(turn=(0.0, 0.0, 1.0))),
    "right": ("point right", Wish(turn=(0.0, 0.0, -1.0))),
    "q": ("roll left", Wish(angular=(0.0, 0.0, -1.0))),
    "e": ("roll right", Wish(angular=(0.0, 0.0, 1.0))),
    "space": ("button 0, the dead-man", Wish(dead_man=True)),
    "c": ("button 1, and close the gripper", Wish(gripper=-1.0, jaw=True)),
    "v": ("open the gripper", Wish(gripper=1.0)),
    "x": ("button 2, power or suction", Wish(pedal=True)),
    "z": ("button 3, saline", Wish(rinse=True)),
}
"""Meaning in words and command of each key, by the key's name in pygame.

Keys that point turn about the axes of the base frame, so that up stays up however the stylus is rolled.
"""


def wish_of(pressed: Collection[str]) -> Wish:
    """Return the sum of the commands of the keys held down."""
    return sum((wish for key, (_, wish) in KEYS.items() if key in pressed), NOTHING)
