"""Proposals in any study: one trial in ten is a language model's, or one of built-in rules."""

try:
    from armwright import ModelOptions
    from armwright import ProposalCallback
    from armwright import StudyLlmProposer
    from armwright import StudyProposal
    from armwright import StudyProposer
    from armwright import StudyRulesProposer
except ModuleNotFoundError as missing:
    if missing.name != "armwright":
        raise
    raise ModuleNotFoundError(
        'armwright is missing: pip install "armwright[llm]" ([studies] for the rules alone)',
        name=missing.name,
    ) from missing


__all__ = [
    "ModelOptions",
    "ProposalCallback",
    "StudyLlmProposer",
    "StudyProposal",
    "StudyProposer",
    "StudyRulesProposer",
]
