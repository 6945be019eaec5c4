"""What every result goes through before it leaves: checked, one verdict over its cells, its fields in order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from inverse_service import errors
from inverse_service.service.documents import checking

if TYPE_CHECKING:
    from api_schemas.result import ResultDocument

# The solver stops by itself a little before its process is killed, so that it can say how far it came.
SHARE_OF_SOLVER = 0.8
FIRST_FIELDS = ("format", "system", "question", "verdict", "verdict_with_time", "reason", "checked")


def checked(result: ResultDocument, time_limit: float) -> dict[str, Any]:
    """The document, its system compared with the document as given; CertificateRefused where an answer is unchecked.

    The solver has its certificates checked itself: no definite verdict leaves that the checker did not call valid.
    """
    document = result.model_dump(mode="json")
    answers = [document, *document["branches"]]
    for answer in filter(None, [*answers, *(one["with_time"] for one in answers)]):
        if answer["verdict"] != "undetermined" and answer["checked"] != "valid":
            raise errors.CertificateRefused("an answer was left unchecked")
    checking.compare_before_leaving(document, time_limit)
    return document


def with_one_verdict(document: dict[str, Any]) -> dict[str, Any]:
    """The main verdicts are `differs` where those of the cells do."""
    for key in ("verdict", "verdict_with_time"):
        if len({branch[key] for branch in document["branches"]}) > 1:
            document[key] = "differs"
    return document


def ordered(document: dict[str, Any]) -> dict[str, Any]:
    """The fields in the order of the contract, which is the order in which a person reads them."""
    return {key: document[key] for key in FIRST_FIELDS} | document
