"""The hash tree agrees with the published example of Certificate Transparency, and proofs prove nothing else."""

from __future__ import annotations

import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.statements.merkle_tree import build_inclusion_proof, compute_root, hash_leaf, is_included

pytestmark = pytest.mark.fast

#: Inputs, roots and paths of the reference implementation of RFC 6962 and 9162 (certificate-transparency, merkletree).
INPUTS = ["", "00", "10", "2021", "3031", "40414243", "5051525354555657", "606162636465666768696a6b6c6d6e6f"]
ROOTS = [
    "6e340b9cffb37a989ca544e6bb780a2c78901d3fb33738768511a30617afa01d",
    "fac54203e7cc696cf0dfcb42c92a1d9dbaf70ad9e621f4bd8d98662f00e3c125",
    "aeb6bcfe274b70a14fb067a5e5578264db0fa9b51af5e0ba159158f329e06e77",
    "d37ee418976dd95753c1c73862b9398fa2a2cf9b4ff0fdfe8b30cd95209614b7",
    "4e3bbb1f7b478dcfe71fb631631519a3bca12c9aefca1612bfce4c13a86264d4",
    "76e67dadbcdf1e10e1b74ddc608abd2f98dfb16fbce75277b5232a127f2087ef",
    "ddb89be403809e325750d3d263cd78929c2942b7942a34b77e122c9594a74c8c",
    "5dc9da79a70659a9ad559cb701ded9a2ab9d823aad2f4960cfe370eff4604328",
]
LEAVES = [hash_leaf(bytes.fromhex(text)) for text in INPUTS]


def test_roots_are_those_of_the_reference_implementation() -> None:
    assert [compute_root(LEAVES[:size]).hex() for size in range(1, 9)] == ROOTS
    assert compute_root([]) == hashlib.sha256().digest()


def test_a_proof_is_that_of_the_reference_implementation() -> None:
    assert [each.hex() for each in build_inclusion_proof(LEAVES, 5)] == [
        "bc1a0643b12e4d2d7c77918f44e0f4f79a838b6cf9ec5b5c283e1f4d88599e6b",
        "ca854ea128ed050b41b35ffc1b87b8eb2bde461e9e3b5596ece6b9d5975a0ae0",
        "d37ee418976dd95753c1c73862b9398fa2a2cf9b4ff0fdfe8b30cd95209614b7",
    ]


@given(size=st.integers(1, 70), data=st.data())
def test_a_proof_holds_for_its_leaf_number_and_tree_only(size: int, data: st.DataObject) -> None:
    leaves = [hash_leaf(bytes([number])) for number in range(size)]
    root, number = compute_root(leaves), data.draw(st.integers(0, size - 1))
    proof = build_inclusion_proof(leaves, number)
    assert is_included(leaves[number], number, size, proof, root)
    assert not is_included(hash_leaf(b"another"), number, size, proof, root)
    other_number = data.draw(st.integers(-1, size))
    assert is_included(leaves[number], other_number, size, proof, root) == (other_number == number)
    assert not is_included(leaves[number], number, size, (*proof, root), root)
    if proof:
        assert not is_included(leaves[number], number, size, proof[:-1], root)
    assert not is_included(leaves[number], number, size, proof, compute_root([*leaves, leaves[0]]))
