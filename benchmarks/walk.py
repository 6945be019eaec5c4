"""The files that one question touches: `python -m benchmarks.walk ["x'' = -x - c*x'"]`.

A file counts if one of its functions is called, in any process or thread of the command `solve`,
outside of what imports run. A profiler in each of them writes down each file once. The second
number counts the files that are loaded. Run it twice: the first run after a change also compiles.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).parents[1]
QUESTION = "x'' = -x - c*x'"
_OURS = (str(ROOT / "inverse_service"), str(ROOT / "api_schemas"))
_FUNCTION = 1  # the flag of code that has fast locals: functions, not bodies of classes and modules
_RUN = (
    "import sys; from benchmarks import walk; walk.record(sys.argv.pop(1)); "
    "from inverse_service.cli import main; main()"
)


def record(file: str) -> None:
    """Write each file of ours in which a function is called, and "import" before those that an
    import calls, to the file, from now on and in all processes and threads that begin here.
    """
    known = set[tuple[str, bool]]()

    def note(frame: FrameType, event: str, _: Any) -> None:
        name = frame.f_code.co_filename
        if event != "call" or not name.startswith(_OURS):
            return
        imports = not frame.f_code.co_flags & _FUNCTION or _is_importing(frame)
        if (name, imports) not in known:
            known.add((name, imports))
            written = os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
            os.write(written, f"{'import' * imports}\t{name}\n".encode())
            os.close(written)

    def begin() -> None:
        threading.setprofile(note)
        sys.setprofile(note)

    os.register_at_fork(after_in_child=begin)
    begin()


def _is_importing(frame: FrameType | None) -> bool:
    """Whether a module of ours is being loaded below this frame."""
    while frame is not None:
        code = frame.f_code
        if code.co_name == "<module>" and code.co_filename.startswith(_OURS):
            return True
        frame = frame.f_back
    return False


def files_of(question: str) -> tuple[list[str], int]:
    """The files in which a function runs for this question, and the number of those loaded."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "files"
        command = [sys.executable, "-c", _RUN, str(file), "solve", question]
        subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
        lines = [line.split("\t") for line in file.read_text("utf-8").splitlines()]
    ran = {name for how, name in lines if not how}
    loaded = {name for _, name in lines}
    return sorted(str(Path(name).relative_to(ROOT)) for name in ran), len(loaded)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the numbers, the rooms, and the files."""
    question = next(iter(sys.argv[1:] if arguments is None else arguments), QUESTION)
    found, loaded = files_of(question)
    rooms = Counter(str(Path(name).parent) for name in found)
    print(f"{question}: a function runs in {len(found)} files; {loaded} are loaded")
    print(*(f"{number:3} {room}" for room, number in rooms.most_common()), sep="\n")
    print(*found, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
