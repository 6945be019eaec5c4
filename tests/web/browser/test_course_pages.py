"""What docs/how-to/teach.md gives to pages of a course: the call of its STACK question."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from tests.serving import serving

pytestmark = pytest.mark.slow
GUIDE = Path(__file__).parents[3] / "docs" / "how-to" / "teach.md"
# The two inputs that STACK makes, in a frame without an origin, of its library what the block uses,
# and the block as stack/cas/castext2/blocks/javascript.block.php wraps it: a module in which the
# names of input-ref-... are identifiers.
FRAME = """<iframe sandbox="allow-scripts" srcdoc='<input id="one"><input id="two"><script type="module">
const stack_js = {request_access_to_input: async (name) => ({ans1: "one", ans2: "two"})[name]};
Promise.all([%s]).then(([%s]) => {
%s
});</script>'></iframe>"""


@pytest.mark.parametrize(
    ("answer", "verdict"),
    [
        ("exp(t)*(x'^2/2 - 2*x^2)", "valid"),
        ("3*exp(t)*(x'^2 - 4*x^2) + x'*x", "valid"),
        ("x'^2/2 - 2*x^2", "invalid"),
        ("x'^2/2 -", "unread"),
    ],
)
def test_the_block_of_a_stack_question_writes_the_verdict(
    browser: Browser, answer: str, verdict: str
) -> None:
    ((head, block),) = re.findall(
        r"\[\[javascript(.*?)\]\]\n(.*?)\[\[/javascript\]\]", GUIDE.read_text(), re.DOTALL
    )
    inputs = re.findall(r'input-ref-(\w+)="(\w+)"', head)
    asked = ", ".join(f'stack_js.request_access_to_input("{name}", true)' for name, _ in inputs)
    with serving(cors_origins="*") as (_, address):
        page = browser.new_page()
        page.set_default_timeout(120_000)
        script = (
            block.replace("https://SERVICE", address).replace("&", "&amp;").replace("'", "&#39;")
        )
        page.set_content(FRAME % (asked, ", ".join(name for _, name in inputs), script))
        frame = page.frame_locator("iframe")
        frame.locator("#one").fill(answer)
        frame.locator("#one").dispatch_event("change")
        page.frames[1].wait_for_function(
            "() => !['', 'pending'].includes(document.getElementById('two').value)"
        )
        assert frame.locator("#two").input_value() == verdict
        page.close()
