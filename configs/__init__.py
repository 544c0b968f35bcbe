"""Installed scenarios by family, and their data."""

__all__ = ["FAMILIES"]

FAMILIES = {
    "Soft tissue": ("palpation", "palpation-by-hand", "retraction", "colon-grasp", "caliper"),
    "Needle and suture": ("suturing", "suturing-by-hand", "pick", "hand-over", "rolling", "needle-tracking"),
    "Training tasks": (
        "pick-and-place",
        "peg-board",
        "peg-board-fls",
        "peg-board-surrol",
        "peg-board-by-hand",
        "peg-board-keys",
        "peg-board-masters",
    ),
    "Leading an arm yourself": ("browser", "keys", "table", "teleop"),
    "Camera": ("visual-servoing",),
    "Programs for the real dVRK": ("ros", "ros-masters", "ros-mirror", "ros-vrep"),
    "The whole robot": ("cart", "identify"),
}
"""Names of the scenarios, in the order of a first look, by subject."""
