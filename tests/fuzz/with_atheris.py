"""`python -m tests.fuzz.with_atheris TARGET -runs=N [options of libFuzzer]`: run a target driven by
coverage.

Needs `pip install atheris`, which is not a dependency of the tests.
"""

from __future__ import annotations

import sys

import atheris

# Only the readers are instrumented: lines of libraries would mislead the search.
WATCHED = [
    "inverse_service.expressions",
    "inverse_service.service.documents.plain_data",
    "inverse_service.mechanics.second_order_system",
]


def main() -> None:
    """Run one target until `-runs`, or until it fails."""
    with atheris.instrument_imports(include=WATCHED):
        from tests.fuzz.targets import TARGETS
    target = TARGETS[sys.argv.pop(1)]
    # Short inputs end before hypothesis has drawn anything from them.
    arguments = [*sys.argv[:1], "-len_control=0", "-max_len=2048", *sys.argv[1:]]
    atheris.Setup(arguments, target.hypothesis.fuzz_one_input)  # type: ignore[attr-defined]
    atheris.Fuzz()


if __name__ == "__main__":
    main()
