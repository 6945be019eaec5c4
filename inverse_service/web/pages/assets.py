"""Files that pages load: our style sheets, scripts and font."""

from __future__ import annotations

import base64
import gzip
import hashlib
import re
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources

from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import Response

from inverse_service.web.problems import Refusal

TYPES = {"css": "text/css", "js": "text/javascript", "svg": "image/svg+xml", "png": "image/png", "woff2": "font/woff2"}
FONT = "stix-two-math.woff2"
NAMES = (FONT, "style.css", "page.js", "figures.js", "motion.js", "play.js", "system.js", "icon.svg")
LOADED = {
    "style.css": (FONT,),
    "motion.js": ("system.js",),
    "page.js": ("motion.js",),
    "play.js": ("figures.js", "motion.js", "system.js"),
}
# A changed file has another address, so an address never changes its content.
FOREVER = "public, max-age=31536000, immutable"


@dataclass(frozen=True, slots=True)
class Asset:
    """A file with its compressed form; `mark` is a hash of its content."""

    data: bytes
    compressed: bytes
    mark: str


@lru_cache(maxsize=len(NAMES))
def asset(name: str) -> Asset:
    """The file of this name; KeyError for any other."""
    if name not in NAMES:
        raise KeyError(name)
    data = _source(name)
    return Asset(data, gzip.compress(data, 6, mtime=0), hashlib.sha256(data).hexdigest()[:12])


def _source(name: str) -> bytes:
    data = (resources.files("inverse_service.web") / "static" / name).read_bytes()
    # What they load themselves is named by its marked address, so that it is asked for once.
    for named in LOADED.get(name, ()):
        data = re.sub(rb'"[./]*%b"' % re.escape(named.encode()), b'"%b"' % address(named).encode(), data)
    return data


@lru_cache(maxsize=1)
def style() -> Markup:
    """The style sheet, which stands in each page: its first paint waits for nothing else."""
    return Markup(asset("style.css").data.decode())


@lru_cache(maxsize=1)
def style_hash() -> str:
    """What the policy of the pages names it by."""
    return "sha256-" + base64.b64encode(hashlib.sha256(asset("style.css").data).digest()).decode()


@lru_cache(maxsize=len(NAMES))
def address(name: str) -> str:
    """Where a page finds the file."""
    return f"/static/{asset(name).mark}/{name}"


async def static(request: Request, mark: str, name: str) -> Response:
    """One file; whoever asks with an old mark gets the file of today, without leave to keep it."""
    if name not in NAMES:
        raise Refusal(404, "not-found", "There is no such file.")
    found = asset(name)
    keep = FOREVER if address(name).split("/")[2] == mark else "no-cache"
    headers = {"Cache-Control": keep, "ETag": f'"{found.mark}"', "Vary": "Accept-Encoding"}
    if request.headers.get("if-none-match") == headers["ETag"]:
        return Response(status_code=304, headers=headers)
    media_type = TYPES[name.rpartition(".")[2]]
    if "gzip" in request.headers.get("accept-encoding", ""):
        return Response(found.compressed, headers={**headers, "Content-Encoding": "gzip"}, media_type=media_type)
    return Response(found.data, headers=headers, media_type=media_type)
