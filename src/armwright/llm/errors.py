"""Classify and describe the errors of a call to a model."""

import re
from concurrent.futures import CancelledError
from typing import Any, cast

import httpx2
from pydantic_ai import exceptions as faults

from armwright.llm.transport import ResponseError

# Kind of fault by exception; subclasses first.
_KINDS: tuple[tuple[type[Exception] | tuple[type[Exception], ...], str], ...] = (
    (faults.ModelAuthenticationError, "key"),
    (faults.ModelQuotaExceededError, "quota"),
    (faults.ModelRateLimitError, "rate_limit"),
    (faults.ModelNotFoundError, "unknown_model"),
    (faults.ModelContextWindowExceededError, "context"),
    (faults.ModelRequestRejectedError, "rejected"),
    ((faults.ModelRequestTimeout, faults.ModelTimeoutError), "timeout"),
    (faults.ModelConnectionError, "connection"),
    ((faults.ModelUnavailableError, faults.ModelServerError), "server"),
    (faults.ModelHTTPError, "rejected"),  # any other status
    (faults.ModelAPIError, "answer"),  # an unreadable response
    (faults.ContentFilterError, "refused"),
    (faults.UnexpectedModelBehavior, "answer"),
    (faults.UsageLimitExceeded, "limit"),
    ((faults.RunCancelled, CancelledError), "cancelled"),
    (httpx2.TransportError, "connection"),
)

# pydantic-ai raises these for some malformed responses: an empty list of choices, a truncated stream, deeply nested
# JSON, a wrong Content-Encoding.
_MALFORMED = (
    LookupError,
    TypeError,
    ValueError,
    AttributeError,
    AssertionError,
    ArithmeticError,
    RecursionError,
    httpx2.DecodingError,
)

# Every exception of a failed call.
CALL_FAULTS = (faults.AgentRunError, faults.UserError, httpx2.TransportError, CancelledError, *_MALFORMED)

# Faults that may pass: the request is repeated.
PASSING = (
    faults.ModelRateLimitError,
    faults.ModelUnavailableError,
    faults.ModelServerError,
    faults.ModelConnectionError,
)

_LENGTH_WORDS = re.compile(
    r"context (length|window|size|limit)|too many (input )?tokens|(prompt|input) is too long", re.I
)
_OUTPUT_WORDS = re.compile(r"\b(tools?|tool_choice|functions?|response_format|json|schemas?|grammar|jinja)\b", re.I)


def kind_of_fault(fault: Exception) -> str:
    """Classify a failed call in one word, such as key, quota, rate_limit, server, timeout, context or answer."""
    if _key_cannot_be_sent(fault):
        return "key"
    if isinstance(fault, _MALFORMED) or _response_error(fault):
        return "answer"
    kind = next((kind for cls, kind in _KINDS if isinstance(fault, cls)), "settings")
    return "context" if kind == "rejected" and _is_about_length(fault) else kind


def may_pass(fault: Exception) -> bool:
    """Return whether the same request may succeed a little later."""
    return isinstance(fault, PASSING) and _response_error(fault) is None


def may_refuse_output(kind: str, message: str) -> bool:
    """Return whether a server may have refused a request for its tools or its JSON schema.

    No code says so, hence any refusal counts. A status with another meaning (404 of OpenRouter, 500 of llama-server)
    counts if the message is about tools or schemas.
    """
    about_output = _OUTPUT_WORDS.search(message) is not None
    return kind in ("rejected", "settings") or (kind in ("unknown_model", "server") and about_output)


def describe_fault(fault: Exception) -> str:
    """Describe an error by the server's own message, or else by its cause."""
    if _key_cannot_be_sent(fault):
        return "its key cannot be sent: it contains a line break or a character outside ASCII"
    if (unusable := _response_error(fault)) is not None:
        return str(unusable)
    if isinstance(fault, CancelledError):
        return "the call was cancelled"
    if isinstance(fault, faults.ModelHTTPError):
        message = _message(fault.body)
        return f"{message} (HTTP {fault.status_code})" if message else str(fault)
    if isinstance(fault, faults.UnexpectedModelBehavior | faults.ModelConnectionError):
        causes = _causes(fault)
        behind = next((cause for cause in causes if isinstance(cause, faults.ModelRetry)), causes[-1])
        reason = str(behind) or type(behind).__name__
        return fault.message if reason in str(fault) else f"{fault.message.rstrip('.')}: {reason}"
    return str(fault)


def _is_about_length(fault: Exception) -> bool:
    """Return whether a refusal is about the length of a prompt; several servers say so by their message alone."""
    is_too_large = isinstance(fault, faults.ModelHTTPError) and fault.status_code == 413
    return is_too_large or _LENGTH_WORDS.search(describe_fault(fault)) is not None


def _message(body: Any) -> str | None:
    """Return the message of an error body: {"message": …} (OpenAI) or {"error": {"message": …}} (Anthropic)."""
    for _ in range(2):
        if isinstance(body, dict):
            content = cast("dict[str, Any]", body)
            body = content.get("message") or content.get("error")
    return body if isinstance(body, str) else None


def _key_cannot_be_sent(fault: BaseException) -> bool:
    """Return whether a header refused the key: headers are ASCII without line breaks."""
    return any(
        (isinstance(cause, UnicodeEncodeError) and cause.encoding == "ascii")
        or str(cause).startswith("Illegal header value")
        for cause in _causes(fault)
    )


def _response_error(fault: BaseException) -> ResponseError | None:
    """Return the error of a response that held no answer; Anthropic's client calls each a failed connection."""
    return next((cause for cause in _causes(fault) if isinstance(cause, ResponseError)), None)


def _causes(fault: BaseException) -> list[BaseException]:
    """Return the exception and its causes."""
    causes = [fault]
    while (cause := causes[-1].__cause__) is not None and cause not in causes:
        causes.append(cause)
    return causes
