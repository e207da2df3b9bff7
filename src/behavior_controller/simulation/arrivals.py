"""Poisson arrivals: messages that arrive independently of each other, at a given average rate."""
import math
import random
from typing import Iterator


class Arrivals:
    """Exponential gaps between messages (document section 6.1). The same seed gives the same gaps.
    """

    def __init__(self, rate: float, seed: str):
        """``rate``: messages per minute, more than 0; infinite means no gaps at all."""
        self._per_second, self._random = rate / 60, random.Random(seed)

    def times(self, start: float) -> Iterator[float]:
        """Yield when each message is due; the mean of their gaps is exactly 60 / rate seconds.

        Late delivery of one message does not shift the next.
        """
        due = start
        while True:
            if math.isfinite(self._per_second):
                due += self._random.expovariate(self._per_second)
            yield due
