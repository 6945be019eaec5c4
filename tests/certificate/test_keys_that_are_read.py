"""What a comparison takes as read by the checker stands in the format of certificates."""

from __future__ import annotations

from pathlib import Path

import pytest

from api_schemas.system import KINDS_OF_LAGRANGIANS
from inverse_service.certificate import checker
from inverse_service.service.documents import examining

FORMAT = Path(checker.__file__).with_name("FORMAT.md").read_text(encoding="utf-8")
KINDS = [kind for kind in ("lagrangian", "existence", "nonexistence") if f'`"{kind}"`' in FORMAT]


@pytest.mark.parametrize(("among", "kind"), examining._READ_OF)
def test_each_kind_of_proof_with_keys_of_its_own_is_in_the_format(among: str, kind: str) -> None:
    assert kind in KINDS
    assert among in ("", "rayleigh_general", *KINDS_OF_LAGRANGIANS)
    assert examining.read_keys({"among": among, "kind": kind}) > examining.read_keys({})
