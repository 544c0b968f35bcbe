"""Environments to learn in, after Gymnasium: importing this module registers them as `trocar/...-v0`.

    import trocar.environments     # before numpy: then state hashes are those of the command line
    import gymnasium

    env = gymnasium.make("trocar/NeedlePick-v0", reward="sparse", record="recordings/needle")

`gymnasium.make("trocar.environments:trocar/NeedlePick-v0")` imports it by itself. `ENVIRONMENTS` has all ids;
`oracle(env.unwrapped)` returns a scripted policy for one episode. Observations, actions and rewards:
docs/how-to/learn.md.
"""

from learning.environments import ENVIRONMENTS, register
from learning.environments.oracles import oracle

__all__ = ["ENVIRONMENTS", "oracle", "register"]
