from collections.abc import Iterable

from torch import Tensor
from torch.optim import lr_scheduler as lr_scheduler

class Optimizer:
    def step(self) -> None: ...
    def zero_grad(self) -> None: ...

class AdamW(Optimizer):
    def __init__(self, params: Iterable[Tensor], *, lr: float = ..., weight_decay: float = ...) -> None: ...
