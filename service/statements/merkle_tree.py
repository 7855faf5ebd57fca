"""Hash tree of an append-only log, and proofs that an entry is in it: RFC 9162, section 2.1.

Hashes are 32 bytes. Leaves are numbered from 0.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

_EMPTY_ROOT = hashlib.sha256().digest()


def hash_leaf(entry: bytes) -> bytes:
    """Return the hash of an entry as a leaf of the tree."""
    return hashlib.sha256(b"\x00" + entry).digest()


def compute_root(leaves: Sequence[bytes]) -> bytes:
    """Return the root of the tree with these leaf hashes. Takes as many hashes as there are leaves."""
    subtrees: list[tuple[int, bytes]] = []  # sizes and roots of complete subtrees, from left to right
    for leaf in leaves:
        size, root = 1, leaf
        while subtrees and subtrees[-1][0] == size:
            root = _hash_pair(subtrees.pop()[1], root)
            size *= 2
        subtrees.append((size, root))
    if not subtrees:
        return _EMPTY_ROOT
    _, root = subtrees.pop()
    while subtrees:
        root = _hash_pair(subtrees.pop()[1], root)
    return root


def build_inclusion_proof(leaves: Sequence[bytes], number: int) -> tuple[bytes, ...]:
    """Return the proof that leaf ``number`` is in the tree, from the leaf to the root: PATH(m, D_n)."""
    start, stop, siblings = 0, len(leaves), []
    if not start <= number < stop:
        raise ValueError(f"leaf {number} is not one of {stop}")
    while stop - start > 1:
        split = start + _find_split(stop - start)
        if number < split:
            siblings.append(compute_root(leaves[split:stop]))
            stop = split
        else:
            siblings.append(compute_root(leaves[start:split]))
            start = split
    return tuple(reversed(siblings))


def is_included(leaf: bytes, number: int, size: int, proof: Sequence[bytes], root: bytes) -> bool:
    """Return whether the proof shows that ``leaf`` is number ``number`` in the tree of ``size`` leaves: 2.1.3.2."""
    if not 0 <= number < size:
        return False
    node, last, result = number, size - 1, leaf
    for sibling in proof:
        if last == 0:
            return False
        if node & 1 or node == last:
            result = _hash_pair(sibling, result)
            while not node & 1 and node:
                node, last = node >> 1, last >> 1
        else:
            result = _hash_pair(result, sibling)
        node, last = node >> 1, last >> 1
    return last == 0 and result == root


def _hash_pair(left: bytes, right: bytes) -> bytes:
    return hashlib.sha256(b"\x01" + left + right).digest()


def _find_split(size: int) -> int:
    """Return the largest power of two that is smaller than ``size``."""
    return 1 << ((size - 1).bit_length() - 1)
