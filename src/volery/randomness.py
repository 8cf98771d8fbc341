"""Keyed random streams: each draw is a function only of (seed, purpose, names of the ends, index).

A stream draws in blocks from the counter-based generator Philox. The draw of an index does not depend on the draws
taken before it, and adding an agent or a fault does not change the draws of others.
"""

from __future__ import annotations

import hashlib
from statistics import NormalDist

from numpy.random import Philox

_BLOCK = 64
_STANDARD_NORMAL = NormalDist()


class Stream:
    """Draws for one purpose, by index. It stores one block of 64 draws, and the generator of the next block."""

    __slots__ = ("_block", "_draws", "_generator", "_key")

    def __init__(self, key: int) -> None:
        self._key = key
        self._block = -1
        self._draws: list[int] = []
        self._generator: Philox | None = None

    def uniform(self, index: int) -> float:
        """The index-th draw, uniform in the open interval (0, 1), with 52 bits."""
        block, offset = divmod(index, _BLOCK)
        if block != self._block:
            if self._generator is None or block != self._block + 1:
                self._generator = Philox(key=self._key, counter=block * (_BLOCK // 4))
            self._draws = self._generator.random_raw(_BLOCK).tolist()
            self._block = block
        return ((self._draws[offset] >> 12) + 0.5) * 2.0**-52

    def normal(self, index: int) -> float:
        """The index-th draw from the standard normal distribution, by the inverse of its distribution function."""
        return _STANDARD_NORMAL.inv_cdf(self.uniform(index))

    def normals(self, first: int, count: int) -> list[float]:
        """`normal` for `count` indices from the first on; faster than single draws if they are in one block."""
        offset = first % _BLOCK
        if offset + count > _BLOCK:
            return [self.normal(first + further) for further in range(count)]
        self.uniform(first)
        inverse = _STANDARD_NORMAL.inv_cdf
        return [inverse(((draw >> 12) + 0.5) * 2.0**-52) for draw in self._draws[offset : offset + count]]


def keyed_seed(seed: int, purpose: str, *names: str) -> int:
    """A seed of 32 bits for another generator, such as one of a user's own."""
    return int(stream(seed, purpose, *names).uniform(0) * 2**32)


def stream(seed: int, purpose: str, *names: str) -> Stream:
    """The stream of one purpose between the named ends; the same on every machine."""
    words = "\x1f".join((str(seed), purpose, *names)).encode()
    return Stream(int.from_bytes(hashlib.blake2b(words, digest_size=16).digest(), "little"))
