"""The steps of docs/how-to/deploy.md on a bare Debian: TLS, keys, backup, restore, a new key, an
upgrade.
"""

from __future__ import annotations

import re
import shutil

import pytest

from tests.deploy.bare import ROOT, bare_debian, can_bootstrap, run_in
from tests.docs.blocks import blocks

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(not can_bootstrap(), reason="needs root and debootstrap"),
]
PAGE = ROOT / "docs" / "how-to" / "deploy.md"
INSTALL, *STEPS, UPGRADE = [block.text for block in blocks(PAGE) if block.language == "sh"]
SOURCES = "/root/inverse-service"
# Does what systemd does with the unit of the page, in a root without systemd.
SYSTEMCTL = r"""#!/bin/bash
set -eu
unit=${!#}; file=/etc/systemd/system/$unit.service
of() { sed -n "s/^$1=//p" "$file"; }
stop() {
  if [ "$unit" = nginx ]; then nginx -s stop 2>/dev/null || true; return; fi
  if [ -f "/run/$unit.pid" ]; then
    kill -TERM "$(cat "/run/$unit.pid")"; tail --pid="$(cat "/run/$unit.pid")" -f /dev/null; rm "/run/$unit.pid"
  fi
}
start() {
  if [ "$unit" = nginx ]; then nginx; return; fi
  user=$(of User)
  install -d -m "$(of StateDirectoryMode)" -o "$user" -g "$user" "/var/lib/$(of StateDirectory)"
  env=$(sed 's/.*/"&"/' "$(of EnvironmentFile)" | tr '\n' ' ')
  eval "exec_env=($env)"
  cd /
  setsid setpriv --reuid="$user" --regid="$user" --init-groups \
    env -i PATH="$PATH" HOME="/var/lib/$(of StateDirectory)" "${exec_env[@]}" $(of ExecStart) \
    >>"/var/log/$unit.log" 2>&1 </dev/null & echo $! > "/run/$unit.pid"
}
case $1 in daemon-reload) ;; stop) stop ;; restart) stop; start ;; start|enable) start ;; *) exit 2 ;; esac
"""
# A database of 0.1.0 is upgraded and keeps its content.
OLD = """
systemctl stop inverse-service
rm /var/lib/inverse-service/jobs.sqlite*
python3 - <<'END'
import os, shutil, sqlite3
path = "/var/lib/inverse-service/jobs.sqlite"
with sqlite3.connect(path) as connection:
    connection.executescript(open("/root/version_1.sql").read())
connection.close()
shutil.chown(path, "inverse", "inverse")
os.chmod(path, 0o600)
END
"""
LOOK = """
ask /v1/jobs/answered | grep --only-matching '"status": *"successful"'
ask /v1/solve --json '{"coordinates": ["x"], "equations": {"x": "-4*x"}}' | grep --only-matching '"verdict": *"[a-z]*"'
curl --silent --output /dev/null --write-out 'plain %{http_code}\\n' --resolve lagrangians.example:80:127.0.0.1 http://lagrangians.example/
stat --format '%U %a' /var/lib/inverse-service /var/lib/inverse-service/jobs.sqlite
systemctl stop inverse-service
systemctl stop nginx
"""


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The output of the commands of the page."""
    root = bare_debian(tmp_path_factory.mktemp("debian"))
    sources = root / SOURCES.lstrip("/")
    kept_out = shutil.ignore_patterns("build", ".venv", ".git", "__pycache__", ".*_cache")
    shutil.copytree(ROOT, sources, ignore=kept_out)
    (root / "usr/local/bin/systemctl").write_text(SYSTEMCTL)
    (root / "usr/local/bin/systemctl").chmod(0o755)
    shutil.copyfile(ROOT / "tests/store/version_1/sqlite.sql", root / "root/version_1.sql")
    # An upgrade takes its packages, and those that compile the kernels of the wheel, from this folder,
    # because the other steps have only loopback.
    wheels = "/opt/inverse-service/bin/pip download --quiet -d /wheels -c constraints.txt '.[simulation]' hatchling editables"
    run_in(root, f"cd {SOURCES}\n{INSTALL}\n{wheels}", {"DEBIAN_FRONTEND": "noninteractive"})
    script = "\n".join([f"cd {SOURCES}", *STEPS, OLD, UPGRADE, LOOK])
    return run_in(root, script, {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": "/wheels"}, is_alone=True)


def test_the_page_gives_a_proxy_with_tls_keys_and_a_restore_that_was_tried(said: str) -> None:
    print(said)
    before, after = said.split('"successful"', 1)
    assert re.search(r'"verdict": *"variational"\n', before)
    assert "401" in before
    assert "refused\n" in before
    assert before.rstrip().endswith('"status":')
    assert "ok\n" in before
    assert "both keys\n" in after
    assert "the old key is" in after


def test_a_store_of_0_1_0_is_upgraded_by_the_page(said: str) -> None:
    after = said.split("the old key is refused\n")[1]
    assert re.search(r'"status": *"successful"', after)
    assert re.search(r'"verdict": *"variational"', after)
    assert "plain 301\n" in after
    assert after.splitlines()[-2:] == ["inverse 700", "inverse 600"]
