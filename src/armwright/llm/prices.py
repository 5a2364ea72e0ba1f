"""Expected cost of calls, by public prices."""

from dataclasses import dataclass

from armwright.extras import requires_extra
from armwright.llm.model_options import ModelOptions
from armwright.llm.servers import server_of

with requires_extra("llm", "a language model"):
    from genai_prices import Usage, calc_price


@dataclass(frozen=True)
class ExpectedTokens:
    """Expected tokens of requests.

    Attributes:
        requests: Number of requests; prices may depend on the length of each.
        input: Tokens of all prompts.
        output: Tokens of all answers.
        conversation: Tokens of prompts that a provider is asked to cache; part of `input`.
        repeated: Tokens that the cache holds already; part of `conversation`.
    """

    requests: int
    input: int
    output: int
    conversation: int = 0
    repeated: int = 0


def estimated_cost(options: ModelOptions, tokens: ExpectedTokens, cached: bool = False) -> float | None:
    """Return about what requests cost [USD], by the prices that calls are accounted with; None if unknown.

    Args:
        options: The model and its server.
        tokens: The requests, which count as equally long.
        cached: Whether the provider's cache holds what is repeated.
    """
    server = server_of(options)
    vendor, _, name = (options.model or "").partition(":")
    n = max(1, tokens.requests)
    read = tokens.repeated if cached else 0
    usage = Usage(
        input_tokens=tokens.input / n,
        output_tokens=tokens.output / n,
        cache_read_tokens=read / n,
        cache_write_tokens=(tokens.conversation - read) / n,
    )
    try:
        if server is None:
            price = calc_price(usage, model_ref=name, provider_id=vendor.removesuffix("-chat"))
        else:
            price = calc_price(usage, model_ref=server.model, provider_api_url=server.address)
    except LookupError:
        return None
    return n * float(price.total_price)


def describe_cost(options: ModelOptions, tokens: ExpectedTokens) -> str:
    """Return the estimated cost in one phrase."""
    cost = estimated_cost(options, tokens)
    cached = estimated_cost(options, tokens, cached=True)
    if cost is not None and cached is not None:
        if not tokens.repeated:
            return f"about {cost:.2f} USD by public prices"
        if cached < cost:
            return f"about {cached:.2f} USD by public prices, {cost:.2f} USD if the provider caches no earlier turns"
        return f"about {cost:.2f} USD by public prices (at full price: none is known for cached turns)"
    server = server_of(options)
    if server is None:
        return "price unknown"
    return "on a local server" if server.is_local else f"at {server.address}, price unknown"
