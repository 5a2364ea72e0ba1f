"""Calls to a language model. Only this file, connections.py, errors.py and responses.py import pydantic-ai."""

import asyncio
import logging
import threading
import time
import warnings
from collections.abc import Callable, Coroutine, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import replace
from functools import cache, partial
from typing import Any, TypeVar

from armwright.exceptions import SettingsError, UsageError
from armwright.extras import naming_extras
from armwright.files import replace_surrogates
from armwright.llm.backend import (
    CHECK,
    FREE_TEXT,
    MAX_REQUESTS,
    AskOptions,
    CallError,
    Interrupted,
    LlmBackend,
    OutputFormat,
    Question,
    Reply,
)
from armwright.llm.model_options import MODEL_SECONDS, ModelOptions
from armwright.llm.redaction import WithoutKeys, redacted, redacted_line
from armwright.llm.servers import server_of
from armwright.text import map_text

with naming_extras("a language model", "llm"):
    from pydantic_ai import Agent, ModelRetry, NativeOutput, PromptedOutput, ToolOutput, capture_run_messages
    from pydantic_ai import exceptions as faults
    from pydantic_ai.messages import ModelMessage, ModelRequest, ModelResponse, TextPart, UserPromptPart
    from pydantic_ai.models import ModelRequestParameters
    from pydantic_ai.models.wrapper import WrapperModel
    from pydantic_ai.output import StructuredDict
    from pydantic_ai.settings import ModelSettings
    from pydantic_ai.usage import UsageLimits

    from armwright.llm.connections import model_on, vendor_model
    from armwright.llm.errors import CALL_FAULTS, PASSING, describe_fault, kind_of_fault, may_pass, may_refuse_output
    from armwright.llm.responses import cost_of, json_alone, not_empty, only_reasoning, text_of

# Forecasts and the budget report unknown prices.
warnings.filterwarnings("ignore", category=faults.CostCalculationFailedWarning)

REASKS = MAX_REQUESTS - 1  # after an invalid answer
RETRIES = 2  # after a fault that may pass
RETRY_SECONDS = 0.5  # before the first retry, unless the server states it; doubled before the next

_OUTPUTS: Mapping[str, Any] = {"tool": ToolOutput, "native": NativeOutput, "prompted": PromptedOutput}
# Modes in the order in which `output: auto` tries them, with a vendor and with another server.
HOSTED_MODES, SERVER_MODES = ("tool", "native", "prompted"), ("native", "tool", "prompted")

# With OPENAI_LOG=debug and the like, libraries log requests and responses.
for _logger in ("openai._base_client", "anthropic._base_client", "httpx2", "httpcore2.http11"):
    logging.getLogger(_logger).addFilter(WithoutKeys())

Result = TypeVar("Result")


class _RetryingModel(WrapperModel):
    """A model with retries after faults that may pass, and with answers reduced to their JSON.

    Vendors' clients retry, too, but also after a spent quota, and wait for an hour if the server says so. Here a server
    that wants a longer pause than the deadline allows has failed.
    """

    async def request(
        self,
        messages: list[ModelMessage],
        model_settings: ModelSettings | None,
        model_request_parameters: ModelRequestParameters,
    ) -> ModelResponse:
        messages = [not_empty(message) for message in messages]
        deadline = time.monotonic() + (model_settings or {}).get("request_timeout", MODEL_SECONDS)
        retries = 0
        while True:
            try:
                response = await super().request(messages, model_settings, model_request_parameters)
                in_text = model_request_parameters.output_mode in ("native", "prompted")
                return json_alone(response) if in_text else response
            except PASSING as fault:
                pause = RETRY_SECONDS * 2**retries if fault.retry_after is None else fault.retry_after
                if retries == RETRIES or time.monotonic() + pause >= deadline or not may_pass(fault):
                    raise
            retries += 1
            await asyncio.sleep(pause)


class _FormError(CallError):
    """An answer without the JSON that was asked for: the server may accept an output mode and ignore it."""


class ModelClient(LlmBackend):
    """Call one model.

    With `output: auto`, hosted models receive the schema as a tool and other servers as a native response format. If
    the server refuses or ignores that, the first question tries the other modes; the one that works is kept.
    """

    def __init__(self, options: ModelOptions) -> None:
        model = options.model or ""
        if not model.rpartition(":")[2].strip():
            raise SettingsError(f'model "{model}" names no model; expected a name such as openai-chat:gpt-4o')
        if options.answer == "text":
            raise SettingsError('answer "text" is for manual answers; a model needs "two-step" or "one-step"')
        super().__init__(model, options.origin)
        self.timeout = options.timeout
        self._server = server_of(options)
        seconds = options.timeout
        called = vendor_model(model, seconds) if self._server is None else model_on(self._server, seconds)
        self._model = _RetryingModel(called)
        automatic = HOSTED_MODES if self._server is None else SERVER_MODES
        self._modes = automatic if options.output == "auto" else (options.output,)  # one, once it is known
        self._settings = options.model_dump(include={"temperature", "seed"}, exclude_none=True)
        self._pending: set[Future[Any]] = set()
        self._cancelled = False

    def begin(self) -> None:
        """Start a session."""
        self._cancelled = False

    def ask(self, question: Question, options: AskOptions = FREE_TEXT) -> Reply:
        """Return the answer to a prompt; refusals of its output format are sent back to the model.

        The first output mode that the server accepts and respects is used from then on.
        """
        output, most_requests = options.output, options.most_requests
        if output is None:
            reply = self._run(Agent(self._model, retries=REASKS), question, options)
            if not reply.answer.strip():
                raise CallError("answer", f"{self.model} gave an empty answer", reply)
            return reply
        spent, modes = Reply(), self._modes
        for mode in modes:
            left = None if most_requests is None else most_requests - spent.requests
            try:
                run = partial(self._run, question=question, options=replace(options, most_requests=left))
                reply = self._ask_in(mode, output, 0 if question is CHECK else REASKS, run)
            except (CallError, Interrupted) as fault:
                fault.reply = spent = spent.plus(fault.reply)
                others = modes[modes.index(mode) + 1 :]
                if question is CHECK and not others and isinstance(fault, _FormError) and fault.reply.answer.strip():
                    self._modes = (mode,)  # the model is there, and may understand a larger question
                    form = "in another form than its JSON schema; its proposals may fail"
                    self.note = f"{self.model} answered the check {form}; this run uses output {mode}"
                    return replace(spent, output_mode=mode)
                if others and isinstance(fault, _FormError):
                    self._modes = others  # also for the next question, if this one has no requests left
                elif not others or fault.reply.requests or not may_refuse_output(fault.kind, str(fault)):
                    raise
                if most_requests is not None and spent.requests >= most_requests:
                    raise
            else:
                self._modes = (mode,)
                if unsupported := " and ".join(modes[: modes.index(mode)]):
                    self.note = f"{self.model} does not support output {unsupported}; this run uses output {mode}"
                return replace(spent.plus(reply), output_mode=mode)
        raise AssertionError("there is at least one mode")

    def _ask_in(self, mode: str, output: OutputFormat, retries: int, run: Callable[[Agent[None, Any]], Reply]) -> Reply:
        """Ask in one output mode; refusals go back to the model, so many times."""
        accepted: list[str] = []
        refusals: list[str] = []

        def accept(answer: dict[str, Any]) -> dict[str, Any]:
            try:
                # Keys are redacted before reading, so that the recorded text can be read again.
                accepted.append(replace_surrogates(output.read(map_text(answer, redacted))))
            except UsageError as refusal:
                refusals.append(str(refusal))
                raise ModelRetry(str(refusal)) from refusal
            return answer

        schema = _OUTPUTS[mode](StructuredDict(dict(output.schema)))
        agent: Agent[None, Any] = Agent(self._model, output_type=schema, retries=retries)
        agent.output_validator(accept)
        try:
            reply = run(agent)
        except CallError as fault:
            if fault.kind in ("answer", "limit") and fault.reply.requests and not refusals:
                raise _FormError(fault.kind, str(fault), fault.reply) from fault
            if fault.kind != "limit" or not refusals:
                raise
            reason = f"max_calls leaves no request after an invalid answer ({redacted_line(refusals[-1])})"
            raise CallError(fault.kind, f"{self.model}: {reason}", fault.reply) from fault
        return replace(reply, answer=accepted[-1])

    def cancel(self) -> None:
        """Cancel all calls, including those about to start."""
        self._cancelled = True
        for future in list(self._pending):
            future.cancel()

    def _run(self, agent: Agent[None, Any], question: Question, options: AskOptions) -> Reply:
        started = time.perf_counter()
        settings = ModelSettings(**self._settings, request_timeout=self.timeout, max_retries=0)
        if options.earlier is not None:
            settings["cache"] = True  # where a provider does not cache by itself: the next question repeats this one
        past: list[ModelMessage] = []
        for turn in options.earlier or ():  # structured answers are text, whichever output mode they were given in
            past += [ModelRequest([UserPromptPart(turn.question)]), ModelResponse([TextPart(turn.answer)])]
        limits = UsageLimits(request_limit=options.most_requests)
        call = agent.run(question.prompt, message_history=past, model_settings=settings, usage_limits=limits)
        with capture_run_messages() as messages:
            try:
                self._wait(call)
            except KeyboardInterrupt as fault:
                raise Interrupted(self._reply(messages[len(past) :], started)) from fault
            except CALL_FAULTS as fault:
                reason = only_reasoning(messages) if isinstance(fault, faults.UnexpectedModelBehavior) else ""
                message = f"{self.model}: {redacted_line(reason or describe_fault(fault))}"
                raise CallError(kind_of_fault(fault), message, self._reply(messages[len(past) :], started)) from fault
        return self._reply(messages[len(past) :], started)

    def _reply(self, messages: Sequence[ModelMessage], started: float) -> Reply:
        reply = Reply()
        for response in messages:
            if isinstance(response, ModelResponse):
                usage, cost = response.usage, cost_of(response, self._server)
                reply = reply.plus(Reply(text_of(response), 1, usage.input_tokens, usage.output_tokens, cost))
        return replace(reply, seconds=round(time.perf_counter() - started, 3))

    def _wait(self, coroutine: Coroutine[Any, Any, Result]) -> Result:
        """Run the coroutine in the event-loop thread and return its result.

        One loop serves all callers: it keeps connections open and works from any thread, also inside the running loop
        of a notebook.
        """
        future = asyncio.run_coroutine_threadsafe(coroutine, _loop())
        self._pending.add(future)
        if self._cancelled:  # checked after the future was listed, so that `cancel` misses none
            future.cancel()
        try:
            return future.result()
        except BaseException:
            future.cancel()  # on Ctrl-C, end the request, too
            raise
        finally:
            self._pending.discard(future)


@cache
def _loop() -> asyncio.AbstractEventLoop:
    loop = asyncio.new_event_loop()
    threading.Thread(target=loop.run_forever, name="armwright-llm", daemon=True).start()
    return loop
