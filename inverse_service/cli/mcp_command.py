"""`inverse-service mcp`: four tools for other programs, by the Model Context Protocol over standard
input and output.

What a tool computes runs in a worker process with the limits of the settings; what it refuses is a
fault of the tool, with the sentences of the refusal. Whole results are resources, for answers are
short.
"""

import asyncio
import hashlib
import json
from collections import OrderedDict
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Annotated, Any

from mcp.server.mcpserver import MCPServer
from mcp.server.mcpserver.exceptions import ToolError
from pydantic import BaseModel, Field

from inverse_service import __version__, errors, settings
from inverse_service.service.documents import answers, growing, plain_data, printed_pages, stated
from inverse_service.service.jobs import model, tasks, workers

INSTRUCTIONS = (
    "Decides whether q'' = f(t, q, q') comes from a Lagrangian; a second program checks each proof. Give "
    "equations as text (\"x'' = -x - c*x'\") or a document {equations, parameters, functions}; constraints with "
    "{lagrangian, constraints}. Call parse first where a formula may be read in two ways."
)
# Whole results that are kept to be read, and characters of a formula in a short answer.
MOST_RESULTS, LONGEST = 64, 2_000
System = Annotated[
    str | dict[str, Any], Field(description="equations as text, or a document as a JSON object")
]


class Parsed(BaseModel):
    """A system as it was parsed."""

    coordinates: list[str]
    equations: dict[str, str] = Field(description="accelerations as text")
    parameters: list[str]
    guessed: list[str] = Field(
        description="names that were not declared and are taken as constants"
    )


class Solved(BaseModel):
    """The answer to whether a system has a Lagrangian; `resource` is the full result with its certificate."""

    verdict: str = Field(
        description="of L(q, q'): variational, not_variational, undetermined or differs"
    )
    verdict_with_time: str | None = Field(description="of L(t, q, q')")
    motion: str | None = Field(
        description="with constraints: whether any associated system has a Lagrangian"
    )
    lagrangian: str | None
    hamiltonian: str | None
    domain: list[str]
    checked: str | None = Field(description="what the independent checker says")
    reason: str
    proof: list[str] = Field(description="the first steps of the explanation")
    family: list[str] = Field(
        description="with `family`: the verdict on all members, and a line for each set of them"
    )
    incomplete: list[str] = Field(description="parts for which the time was over")
    resource: str


class Checked(BaseModel):
    """The independent checker's verdict."""

    verdict: str
    statement: str | None = None
    reasons: list[str] = Field(default_factory=list)


class Simulated(BaseModel):
    """How each method of a scene ended; `resource` is the full summary."""

    methods: list[dict[str, Any]]
    resource: str


class Tools:
    """The tools on a pool of worker processes."""

    def __init__(self) -> None:
        self._settings = settings.read_settings()
        self._workers = workers.Workers(self._settings.workers, self._settings.memory_limit)
        self._results: OrderedDict[str, str] = OrderedDict()

    @asynccontextmanager
    async def alive(self, _: MCPServer[Any]) -> AsyncIterator[None]:
        """The worker processes live as long as the server."""
        self._workers.start()
        try:
            yield
        finally:
            self._workers.stop()

    async def parse(self, system: System) -> Parsed:
        """Show how a system is parsed: coordinates, equations, parameters. Takes milliseconds; solves nothing."""
        found = await self._run(
            tasks.parse_task, json.dumps(_document(system)).encode(), seconds=5.0
        )
        whole = json.loads(found)
        equations = {name: formula["text"] for name, formula in whole["equations"].items()}
        return Parsed(
            equations=equations,
            **{key: whole[key] for key in ("coordinates", "parameters", "guessed")},
        )

    async def solve(
        self,
        system: System,
        time_limit: Annotated[float | None, Field(description="seconds", gt=0)] = None,
    ) -> Solved:
        """Decide whether a system comes from a Lagrangian. Verdict, L and H, proof; each answer is checked first."""
        server = model.JobOptions(self._settings.time_limit, self._settings.memory_limit)
        document, given = model.split_options(_document(system))
        options = model.read_options(
            given if time_limit is None else {"time_limit": time_limit}, server
        )
        asked, so_far = tasks.solve_options(options), dict[str, Any]()

        def hear(value: Any) -> None:
            if isinstance(value, dict):
                so_far.update(growing.grown(so_far, value))

        call = tasks.Call(
            tasks.solve_task,
            (document, asked),
            options.time_limit,
            options.memory_limit,
            reports=True,
        )
        outcome = await asyncio.wrap_future(self._workers.submit(call, hear).outcome)
        result = _value(
            lambda: answers.result_document(outcome, asked, options.memory_limit, so_far or None)
        )
        return in_short(result, self._kept(result))

    async def check(
        self,
        system: System | None = None,
        lagrangian: Annotated[
            str | None, Field(description="a Lagrangian of yours for `system`")
        ] = None,
        result: Annotated[
            str | None, Field(description="the JSON, or the resource, of a result to check")
        ] = None,
    ) -> Checked:
        """Run the independent checker on a result, or on your own Lagrangian for a system."""
        if result is not None:
            text = self._results.get(result, result)
        elif system is not None and lagrangian is not None:
            text = json.dumps({"system": _document(system), "lagrangian": lagrangian})
        else:
            raise ToolError("Give `result`, or `system` and `lagrangian`.")
        found = await self._run(tasks.check_task, text, seconds=self._settings.time_limit)
        statement = found.get("statement")
        shown = statement.get("text") if isinstance(statement, dict) else statement
        return Checked(
            verdict=found["verdict"], statement=_short(shown), reasons=found.get("reasons") or []
        )

    async def simulate(
        self, scene: Annotated[dict[str, Any], Field(description="a Scene document")]
    ) -> Simulated:
        """Integrate a scene (system, initial values, step, methods): how each method ended, and its observed errors."""
        plain = _value(lambda: plain_data.read_json(json.dumps(scene)))
        limit = self._settings.time_limit
        found = await self._run(tasks.simulate_task, plain, None, limit, seconds=limit)
        kept = ("label", "outcome", "steps", "energy", "doubt")
        methods = [
            {key: method[key] for key in kept if key in method} for method in found["methods"]
        ]
        return Simulated(methods=methods, resource=self._kept(found))

    def read(self, name: str) -> str:
        """A whole result as JSON."""
        if (found := self._results.get(f"result://{name}")) is None:
            raise ValueError("This result is not kept any more; ask again.")
        return found

    async def _run(self, task: Any, *arguments: Any, seconds: float) -> Any:
        outcome: tasks.Outcome = await asyncio.wrap_future(
            self._workers.submit(tasks.Call(task, arguments, seconds)).outcome
        )
        return _value(lambda: tasks.value_of(outcome))

    def _kept(self, result: dict[str, Any]) -> str:
        text = json.dumps(result, ensure_ascii=False)
        place = f"result://{hashlib.sha256(text.encode()).hexdigest()[:16]}"
        self._results[place] = text
        while len(self._results) > MOST_RESULTS:
            self._results.popitem(last=False)
        return place


def _document(system: str | dict[str, Any]) -> Any:
    """A document; undeclared names of a text are constants."""
    if isinstance(system, str) and not system.lstrip().startswith("{"):
        return {"equations": system, "parameters": "guess"}
    text = system if isinstance(system, str) else json.dumps(system)
    return _value(lambda: plain_data.read_document(text, ""))


def _value(work: Any) -> Any:
    """The result of the work; a refusal or a failure becomes an error of the tool in one sentence."""
    try:
        return work()
    except errors.InputError as error:
        cures = [f"Write {' or '.join(place.instead)}." for place in error.places if place.instead]
        raise ToolError(" ".join([error.detail, *cures])) from None
    except Exception as error:
        raise ToolError(str(error)) from None


def _short(text: str | None) -> str | None:
    return (
        text
        if text is None or len(text) <= LONGEST
        else f"{text[:LONGEST]}... ({len(text)} characters)"
    )


def in_short(result: dict[str, Any], resource: str) -> Solved:
    """What an assistant gets of a result: that of its first statement."""
    about, first = result.get("any_associated") or {}, stated.first_answer(result)
    lagrangian, hamiltonian = (
        _short((first.get(key) or {}).get("text")) for key in ("lagrangian", "hamiltonian")
    )
    reason = result.get("reason") or ""
    if "verdict" not in result:  # a Lagrangian was given, which is its own answer
        equations = ", ".join(
            f"{name}'' = {formula['text']}" for name, formula in result["equations"].items()
        )
        reason = f"The equations of this Lagrangian: {equations}"
    return Solved(
        verdict=result.get("verdict", "variational"),
        verdict_with_time=result.get("verdict_with_time", "variational"),
        motion=about.get("verdict"),
        lagrangian=lagrangian,
        hamiltonian=hamiltonian,
        domain=list(stated.conditions_of(first)),
        checked=result.get("checked"),
        reason=reason,
        proof=[
            _short(step["text"]) or ""
            for step in (first.get("explanation") or result.get("explanation") or [])[:8]
        ],
        family=[_short(line) or "" for line in printed_pages.family_lines(result)],
        incomplete=[entry["part"] for entry in result.get("incomplete") or []],
        resource=resource,
    )


def server() -> MCPServer[Any]:
    """The server with its tools."""
    tools = Tools()
    found = MCPServer[Any](
        "inverse-service",
        instructions=INSTRUCTIONS,
        version=__version__,
        lifespan=tools.alive,
        log_level="WARNING",
    )
    for tool in (tools.solve, tools.check, tools.parse, tools.simulate):
        found.add_tool(tool, structured_output=True)
    found.resource("result://{name}", mime_type="application/json", description="A whole result.")(
        tools.read
    )
    return found
