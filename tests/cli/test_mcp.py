"""Call the tools of `mcp` as a client does: over standard input and output of the command."""

from __future__ import annotations

import asyncio
import json
import sys
from importlib.util import find_spec
from typing import Any

import pytest

pytestmark = pytest.mark.skipif(find_spec("mcp") is None, reason="mcp is not installed")


async def _ask(calls: list[tuple[str, dict[str, Any]]]) -> list[Any]:
    import mcp  # which takes half a second, and each worker loads this file
    from mcp.client.stdio import stdio_client

    command = mcp.StdioServerParameters(
        command=sys.executable, args=["-m", "inverse_service", "mcp"]
    )
    async with mcp.Client(stdio_client(command)) as client:
        tools = (await client.list_tools()).tools
        assert {tool.name for tool in tools} == {"solve", "check", "parse", "simulate"}
        assert all(tool.output_schema and tool.description for tool in tools)
        found: list[Any] = []
        for name, arguments in calls:
            if arguments.get("result") == "the last":
                arguments = {"result": found[-1].structured_content["resource"]}
            found.append(await client.call_tool(name, arguments))
        resource = next(one.structured_content["resource"] for one in found if not one.is_error)
        whole = await client.read_resource(resource)
        return [*found, json.loads(whole.contents[0].text)]


def test_an_assistant_solves_checks_parses_and_hears_what_is_wrong() -> None:
    calls: list[tuple[str, dict[str, Any]]] = [
        ("solve", {"system": "x'' = -k*x^3", "time_limit": 30}),
        ("check", {"result": "the last"}),
        ("check", {"system": "x'' = -x", "lagrangian": "x'^2/2 - x^2"}),
        ("parse", {"system": {"equations": {"x": "-x*y", "y": "x"}}}),
        ("parse", {"system": "x'' = -k*x*"}),
        ("check", {"system": "x'' = -x"}),
    ]
    solved, checked, wrong, parsed, refused, empty, whole = asyncio.run(_ask(calls))
    answer = solved.structured_content
    assert (answer["verdict"], answer["checked"], answer["incomplete"]) == (
        "variational",
        "valid",
        [],
    )
    assert (
        answer["lagrangian"] == whole["answers"][0]["lagrangian"]["text"]
    )  # what every door shows
    assert len(json.dumps(answer)) < len(json.dumps(whole)) / 2
    assert checked.structured_content["verdict"] == "valid"
    assert wrong.structured_content["verdict"] in ("invalid", "differs")
    assert parsed.structured_content["equations"] == {"x": "-x*y", "y": "x"}
    assert (refused.is_error, empty.is_error) == (True, True)
    assert "Give `result`" in empty.content[0].text
    assert "k*x*" not in refused.content[0].text
    assert len(refused.content[0].text) > 20


@pytest.mark.slow
def test_an_assistant_hears_which_members_of_a_family_have_a_lagrangian() -> None:
    family = {
        "equations": {"x": "-a*y", "y": "-b*x'^2"},
        "parameters": ["a", "b"],
        "family": True,
    }
    damped = {"system": "x'' = -k*x - c*x'", "time_limit": 30}
    solved, members, whole = asyncio.run(_ask([("solve", damped), ("solve", {"system": family})]))
    assert (
        solved.structured_content["lagrangian"] == whole["answers"][0]["lagrangian"]["text"]
    )  # what every door shows
    assert "Two sets of members do, and no others." in members.structured_content["family"][0]
    assert any(line.startswith("a = 0: yes L = ") for line in members.structured_content["family"])


def test_of_many_results_the_latest_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    from inverse_service.cli import mcp_command

    monkeypatch.setattr(mcp_command, "MOST_RESULTS", 2)
    tools = mcp_command.Tools()
    names = [tools._kept({"k": k}).removeprefix("result://") for k in range(3)]
    with pytest.raises(ValueError, match="not kept"):
        tools.read(names[0])
    assert [json.loads(tools.read(name)) for name in names[1:]] == [{"k": 1}, {"k": 2}]
