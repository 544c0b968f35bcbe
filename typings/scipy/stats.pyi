"""What Trocar uses of SciPy's statistics."""

from typing import Literal, NamedTuple

class ConfidenceInterval(NamedTuple):
    low: float
    high: float

class BinomTestResult:
    pvalue: float
    def proportion_ci(
        self, confidence_level: float = ..., method: Literal["exact", "wilson", "wilsoncc"] = ...
    ) -> ConfidenceInterval: ...

def binomtest(k: int, n: int, p: float = ...) -> BinomTestResult: ...
