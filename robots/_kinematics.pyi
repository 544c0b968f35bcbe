from schemas.vectors import Vector

Numbers = tuple[Vector, Vector, Vector, Vector, Vector]
"""`SerialChain.numbers`."""

Form = tuple[Vector, Vector, Vector, Vector]
"""`robots.dvrk.inverse._Form.numbers`."""

def frames(chain: Numbers, q: Vector, /) -> Vector | None: ...
def pursue(
    chain: Numbers,
    q: Vector,
    position: Vector,
    orientation: Vector,
    largest_move: Vector,
    length: float,
    damping: float,
    met: float,
    corrections: int,
    /,
) -> Vector | None: ...
def inverse(chain: Numbers, form: Form, pose: Vector, near: Vector, /) -> Vector | None: ...
def tips(chain: Numbers, state: Vector, tips: Vector, twists: Vector, jacobian: Vector, /) -> bool: ...
def tip_poses(base: Vector, tips: Vector, poses: Vector, /) -> bool: ...
