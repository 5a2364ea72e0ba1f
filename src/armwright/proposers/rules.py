from armwright.proposers.proposer import *


class RulesProposer(Proposer):
    name = "rules"
