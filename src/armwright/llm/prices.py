"""Expected cost of calls, by public prices."""

from armwright.extras import naming_extras
from armwright.llm.model_options import ModelOptions
from armwright.llm.servers import server_of

with naming_extras("a language model", "llm"):
    from genai_prices import Usage, calc_price


def estimated_cost(options: ModelOptions, requests: int, given: int, written: int) -> float | None:
    """Return about what requests cost [USD], by the prices that calls are accounted with; None if unknown.

    The tokens of all prompts are `given`, none from a provider's cache; those of all answers are `written`. Requests
    count as equally long: prices may depend on the length of each.
    """
    server = server_of(options)
    vendor, _, name = (options.model or "").partition(":")
    n = max(1, requests)
    usage = Usage(input_tokens=given / n, output_tokens=written / n)
    try:
        if server is None:
            price = calc_price(usage, model_ref=name, provider_id=vendor.removesuffix("-chat"))
        else:
            price = calc_price(usage, model_ref=server.model, provider_api_url=server.address)
    except LookupError:
        return None
    return n * float(price.total_price)


def describe_cost(options: ModelOptions, requests: int, given: int, written: int) -> str:
    """Return the estimated cost in one phrase."""
    cost = estimated_cost(options, requests, given, written)
    return "price unknown" if cost is None else f"about {cost:.2f} USD by public prices"
